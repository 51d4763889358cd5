# Models: mechanisms in names and SI units. SPDX-License-Identifier: Apache-2.0
"""Plain data, as in the C++ header lockstep/model.h. compile() checks it. Units: m, kg, s, rad, N, N m."""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass, field
from typing import (TYPE_CHECKING, Any, Dict, Iterable, List, Optional, Sequence, SupportsFloat, SupportsIndex, TypeVar,
                    Union, overload)

from .errors import ModelError

if TYPE_CHECKING:  # numpy cannot come before what refuses a second interpreter
    import numpy as np
    import numpy.typing as npt

infinity = math.inf

Vector = Sequence[float]
Matrix = Sequence[Sequence[float]]

IDENTITY: Matrix = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))
NO_INERTIA: Matrix = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def pose(xyz: Vector = (0.0, 0.0, 0.0), rpy: Vector = (0.0, 0.0, 0.0)) -> Matrix:
    """The 4 x 4 matrix of a frame at xyz (m), turned by roll, pitch and yaw (rad) about fixed axes, as in URDF."""
    (cr, cp, cy), (sr, sp, sy) = ([f(angle) for angle in rpy] for f in (math.cos, math.sin))
    x, y, z = xyz
    return (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, float(x)),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, float(y)),
        (-sp, cp * sr, cp * cr, float(z)),
        (0.0, 0.0, 0.0, 1.0),
    )


@dataclass
class Hard:
    """Never yields. `erp`: share of the position error that is corrected per step, in [0, 2)."""

    erp: float = 0.2


@dataclass
class ErpCfm:
    """Error reduction (0 to 1) and constraint force mixing (>= 0), as in ODE and Bullet."""

    erp: float = 0.2
    cfm: float = 0.0


@dataclass
class Spring:
    """An implicit spring: stiffness kp >= 0 and damping kd >= 0."""

    kp: float = 0.0
    kd: float = 0.0


@dataclass
class Frequency:
    """The spring with this natural frequency (rad/s) and damping ratio at the inertia that the coupling moves."""

    rad_per_s: float = 0.0
    damping_ratio: float = 1.0


Softness = Union[Hard, ErpCfm, Spring, Frequency]


@dataclass
class Inertia:
    """mass in kg; centre of mass in the link's frame, m; rotational inertia about it, kg m^2, 3 x 3."""

    mass: float = 0.0
    center: Vector = (0.0, 0.0, 0.0)
    about_center: Matrix = NO_INERTIA

    @staticmethod
    def box(mass: float, size: Vector, center: Vector = (0.0, 0.0, 0.0)) -> Inertia:
        """A solid box of uniform density with edges `size`, m."""
        square = [length * length for length in size]
        moments = [mass / 12.0 * (square[(i + 1) % 3] + square[(i + 2) % 3]) for i in range(3)]
        return Inertia(mass, center, [[moments[i] if i == k else 0.0 for k in range(3)] for i in range(3)])


@dataclass
class Link:
    """gravity: the share of the model's gravity that acts on the link's mass; 0 balances it."""

    name: str
    inertia: Inertia = field(default_factory=Inertia)
    gravity: float = 1.0


@dataclass
class Drive:
    """A servo: effort = kp (position_target - q) + kd (velocity_target - v), within the joint's effort limit.

    A kinematic drive prescribes the motion instead; `softness` is its own, kp and kd are 0 then.

    Targets and efforts take `delay` steps to the drive, 0 to 1000, which then follows them with the time constant `lag`,
    s. A reset fills both with what `batch.q_target`, `qd_target` and `effort` hold then. Of a DC motor: its effort
    at rest, `stall_effort`, and the speed at which none is left, `no_load_speed`; the joint needs an effort limit."""

    kp: float = 0.0
    kd: float = 0.0
    position_target: float = 0.0
    velocity_target: float = 0.0
    kinematic: bool = False
    softness: Softness = field(default_factory=lambda: Hard(1.0))
    delay: int = 0
    lag: float = 0.0
    stall_effort: float = infinity
    no_load_speed: float = infinity


@dataclass
class TendonSegment:
    """A straight line from a point of one link to a point of another. first, second: links, empty for the world.
    first_point, second_point: in the link's frame, m. share: how much of its length counts, 1 / n where n strands run
    side by side."""

    first: str
    second: str
    first_point: Vector = (0.0, 0.0, 0.0)
    second_point: Vector = (0.0, 0.0, 0.0)
    share: float = 1.0


@dataclass
class Joint:
    """kind: "fixed", "revolute", "continuous", "prismatic", "tendon", or "ball" for the three parts that
    `Model.add_ball()` makes. origin: the child's frame in the parent's at q = 0, 4 x 4. axis: in the child's frame.
    damping: N m s/rad or N s/m. armature: a rotor's inertia, kg m^2 or kg. stiffness and rest: a spring beside the
    drive, N m/rad or N/m. effort: feed-forward, N m or N. lower, upper, velocity_limit, effort_limit: hard bounds; the
    last is of servo and feed-forward effort together. restitution: share of the speed that an end of the range gives
    back. friction: dry, N m or N. position, velocity: the state after reset(). path: of a spatial tendon, whose
    position is the sum of these lengths, m; no coupling says it then."""

    name: str
    kind: str = "fixed"
    parent: str = ""
    child: str = ""
    origin: Matrix = IDENTITY
    axis: Vector = (1.0, 0.0, 0.0)
    damping: float = 0.0
    armature: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    drive: Drive = field(default_factory=Drive)
    effort: float = 0.0
    lower: float = -infinity
    upper: float = infinity
    limit_softness: Softness = field(default_factory=Hard)
    restitution: float = 0.0
    velocity_limit: float = infinity
    effort_limit: float = infinity
    friction: float = 0.0
    position: float = 0.0
    velocity: float = 0.0
    path: list[TendonSegment] = field(default_factory=list)


@dataclass
class Polynomial:
    """c_0 + c_1 x + c_2 x^2 + ..., at least 2 coefficients and at most 16."""

    coefficients: Sequence[float]


@dataclass
class CamTable:
    """The cubic spline through points, straight beyond its ends. `leader` ascends."""

    leader: Sequence[float]
    follower: Sequence[float]


@dataclass
class Harmonic:
    """mean + cosine cos(rate x) + sine sin(rate x)."""

    mean: float = 0.0
    cosine: float = 0.0
    sine: float = 0.0
    rate: float = 1.0


Function = Union[Polynomial, CamTable, Harmonic]


@dataclass
class Coupling:
    """joint + ratio_1 leader_1 + ... + offset = 0. `terms` are pairs of a leader's name and its ratio. URDF's
    multiplier is -ratio, its offset -offset. Beyond `force_limit` the coupling slips. With a function, joint = f(leader)
    for the one leader, whose ratio is 1."""

    joint: str
    terms: Sequence[tuple[str, float]]
    offset: float = 0.0
    softness: Softness = field(default_factory=Hard)
    force_limit: float = infinity
    function: Optional[Function] = None

    @property
    def name(self) -> str:
        """That of `joint`."""
        return self.joint


@dataclass
class Loop:
    """Holds a frame on link `second` to a frame on link `first`; "" is the world, for one of the two. kind: "point"
    (3 rows), "hinge" (5, about `axis` of both frames), "slider" (5, along it) or "weld" (6). force_limit: N, of each
    row that holds the origins; torque_limit: N m, of each that holds the directions."""

    name: str
    kind: str
    first: str
    second: str
    first_pose: Matrix = IDENTITY
    second_pose: Matrix = IDENTITY
    axis: Vector = (0.0, 0.0, 1.0)
    softness: Softness = field(default_factory=lambda: Hard(1.0))
    force_limit: float = infinity
    torque_limit: float = infinity


@dataclass
class Site:
    """A named frame on a link: a fingertip, a sensor."""

    name: str
    link: str
    pose: Matrix = IDENTITY


@dataclass
class Shape:
    """A solid. size: a height field's edges along x and y; a box's edges; a hull's radius; a cylinder's radius and length
    along z; a capsule's radius and the length of its cylinder, along z; an ellipsoid's semi-axes; a sphere's radius.
    points: a hull's, one a row, m. heights: a height field's, m, rows along y. A half_space is everything below the plane
    z = 0 of its frame."""

    kind: str
    size: Vector = (0.0, 0.0, 0.0)
    points: Sequence[Vector] = ()
    heights: Sequence[Vector] = ()

    @staticmethod
    def half_space() -> Shape:
        """All below the plane z = 0 of its frame."""
        return Shape("half_space")

    @staticmethod
    def height_field(heights: Iterable[Iterable[SupportsFloat]], x: float, y: float) -> Shape:
        """All below a surface through heights[rows, columns], m, about its frame's origin. Columns go from -x / 2 to x / 2,
        m, rows from -y / 2 to y / 2. 2 x 2 to 2.7 million heights; each cell is two triangles, cut from its corner of least
        x and y. Beyond its edges there is nothing. What touches it does so by points: docs/contacts.md says which."""
        return Shape("height_field", (x, y, 0.0), heights=tuple(tuple(map(float, row)) for row in heights))

    @staticmethod
    def box(x: float, y: float, z: float) -> Shape:
        """Edges along the axes of its frame, m."""
        return Shape("box", (x, y, z))

    @staticmethod
    def hull(points: Sequence[Vector], radius: float = 0.0) -> Shape:
        """All within `radius`, m, of the convex hull of the points, one a row. It has 4 to 64 corners."""
        return Shape("hull", (radius, 0.0, 0.0), points)

    @staticmethod
    def cylinder(radius: float, length: float) -> Shape:
        """Along z of its frame, m."""
        return Shape("cylinder", (radius, length, 0.0))

    @staticmethod
    def ellipsoid(x: float, y: float, z: float) -> Shape:
        """Semi-axes along the axes of its frame, m."""
        return Shape("ellipsoid", (x, y, z))

    @staticmethod
    def capsule(radius: float, length: float) -> Shape:
        """Points at most `radius`, m, from a segment of `length`, m, along z."""
        return Shape("capsule", (radius, length, 0.0))

    @staticmethod
    def sphere(radius: float) -> Shape:
        """Radius in m."""
        return Shape("sphere", (radius, 0.0, 0.0))


@dataclass
class Collider:
    """A solid on a link, or in the world if link is "". It touches what Model.contacts says. pose: in the link's
    frame. friction: 0 to 100, a pair has the geometric mean. restitution: 0 to 1, a pair has the larger. group: "" is none.
    torsional_friction, rolling_friction: the largest moments about normal and tangents over the normal force, m; a pair
    has the larger ones, in one cone with its friction, which must not be 0 then."""

    name: str
    link: str
    shape: Shape
    pose: Matrix = IDENTITY
    friction: float = 0.5
    restitution: float = 0.0
    softness: Softness = field(default_factory=Hard)
    group: str = ""
    torsional_friction: float = 0.0
    rolling_friction: float = 0.0


@dataclass
class Contact:
    """Two colliders that may touch, or all of a group with others. None: what the colliders have."""

    first: str
    second: str
    friction: Optional[float] = None
    restitution: Optional[float] = None
    softness: Optional[Softness] = None
    torsional_friction: Optional[float] = None
    rolling_friction: Optional[float] = None

    @property
    def name(self) -> str:
        """"FIRST-SECOND"."""
        return f"{self.first}-{self.second}"


@dataclass
class Root:
    """Where a tree begins: a link that is bolted to the world or floats in it. velocity: angular (rad/s), then linear
    (m/s), in the root's axes."""

    link: str
    floating: bool = False
    pose: Matrix = IDENTITY
    velocity: Vector = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

    @property
    def name(self) -> str:
        """That of `link`."""
        return self.link


@dataclass
class NamedPose:
    """A pose to start in, beside the model's own: Batch.reset_to() goes there. What it does not name is as the model
    starts; followers are placed by their couplings. By joint: positions (rad or m), velocities, targets, efforts; a drive
    whose position target is not named holds the joint where `positions` has it. By the link of a floating root: root_poses
    (4 x 4, see pose()) and root_velocities (angular, then linear, in the root's axes)."""

    name: str
    positions: Dict[str, float] = field(default_factory=dict)
    velocities: Dict[str, float] = field(default_factory=dict)
    position_targets: Dict[str, float] = field(default_factory=dict)
    velocity_targets: Dict[str, float] = field(default_factory=dict)
    efforts: Dict[str, float] = field(default_factory=dict)
    root_poses: Dict[str, Matrix] = field(default_factory=dict)
    root_velocities: Dict[str, Vector] = field(default_factory=dict)


Element = TypeVar("Element", Link, Joint, Coupling, Site, Collider, Contact, Loop, Root, NamedPose)


class Named(List[Element]):
    """A list whose elements can be asked for by name, too: the first one of that name."""

    def position(self, name: str) -> int:
        for place, element in enumerate(self):
            if element.name == name:
                return place
        raise KeyError(f"no {name!r}; there are {', '.join(self.names) or 'none'}")

    @property
    def names(self) -> list[str]:
        return [element.name for element in self]

    @overload
    def __getitem__(self, key: Union[SupportsIndex, str]) -> Element: ...
    @overload
    def __getitem__(self, key: slice) -> list[Element]: ...
    def __getitem__(self, key: Any) -> Any:
        return super().__getitem__(self.position(key) if isinstance(key, str) else key)

    def __contains__(self, key: object) -> bool:
        return key in self.names if isinstance(key, str) else super().__contains__(key)


@dataclass(eq=False)
class VisualMesh:
    """What a link looks like, for recordings and pictures alone. vertices: float32 [n, 3], m, in the link's frame.
    triangles: int32 [m, 3], numbers of vertices, to the left as seen from outside."""

    link: str
    vertices: npt.NDArray[np.float32]
    triangles: npt.NDArray[np.int32]


@dataclass
class Model:
    """Links and joints form one tree or several. Links, joints, couplings, loops and sites are lists that take names as
    well as numbers: model.joints["knuckle"]. gravity: m/s^2, world axes. poses: to start in, by name too. time_step: s,
    what the file asks for, 0 if nothing; compile() takes the step as dt."""

    name: str = "model"
    links: Named[Link] = field(default_factory=Named)
    joints: Named[Joint] = field(default_factory=Named)
    couplings: Named[Coupling] = field(default_factory=Named)
    loops: Named[Loop] = field(default_factory=Named)
    sites: Named[Site] = field(default_factory=Named)
    colliders: Named[Collider] = field(default_factory=Named)
    contacts: Named[Contact] = field(default_factory=Named)
    roots: Named[Root] = field(default_factory=Named)
    gravity: Vector = (0.0, 0.0, -9.81)
    poses: Named[NamedPose] = field(default_factory=Named)
    time_step: float = 0.0
    report: list[str] = field(default_factory=list, compare=False)
    warnings: list[str] = field(default_factory=list, compare=False)
    visual_meshes: list[VisualMesh] = field(default_factory=list, compare=False)

    def __setattr__(self, name: str, value: Any) -> None:
        lists = ("links", "joints", "couplings", "loops", "sites", "colliders", "contacts", "roots", "poses")
        if name in lists and not isinstance(value, Named):
            value = Named(value)
        super().__setattr__(name, value)

    def copy(self) -> Model:
        """Another Model with the same numbers."""
        return copy.deepcopy(self)

    def add_ball(self, name: str, parent: str, child: str, origin: Matrix = IDENTITY) -> list[Joint]:
        """Adds a ball joint between two links: the joints `name`.x, .y and .z, and links without mass between them.
        Their velocities are the child's angular velocity along its own axes, their positions the rotation vector.
        `upper` of the first bounds the angle. Raises ModelError where one of the names is taken."""
        taken = {element.name for element in (*self.links, *self.joints)}
        for own in (f"{name}.{part}" for part in "xyz"):
            if not name or own in taken:
                rule = f"needs the name '{own}', which is taken" if name else "has no name"
                raise ModelError(f"ball joint '{name}'", rule, "give it its own name", "model.joint")
        added, carrier = [], parent
        for part, axis in enumerate(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))):
            own = f"{name}.{'xyz'[part]}"
            to = child if part == 2 else own
            if part < 2:
                self.links.append(Link(own))
            added.append(Joint(own, "ball", carrier, to, origin if part == 0 else IDENTITY, axis))
            self.joints.append(added[-1])
            carrier = to
        return added

    def end_colliders(self) -> list[str]:
        """Names of the colliders on bodies that move and carry no other moving body: feet, fingertips, free objects.
        Links that fixed joints connect are one body. Raises ModelError where links and joints form no trees."""
        from ._lockstep import _end_colliders

        return _end_colliders(self)


def recompiled(model: Model, settings: dict[str, Any]) -> Any:
    """What a pickled Plan is made again by."""
    from ._lockstep import compile

    return compile(model, **settings)


def restored(
    plan: Any, num_envs: int, threads: int, dtype: Any, target: str, engine: str, blob: bytes
) -> Any:
    """What a pickled or copied Batch is made again by."""
    batch = plan.batch(num_envs, threads=threads, dtype=dtype, target=target, engine=engine)
    batch.restore(blob)
    return batch


@dataclass
class Export:
    """The text of a robot file, and how far it says what the model says. `warnings` are the lines of the report about
    what the format cannot say."""

    text: str
    report: List[str]
    warnings: List[str]
