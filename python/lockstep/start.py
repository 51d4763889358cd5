# Where episodes start. SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import dataclass, field
from typing import Mapping, Sequence, Union


@dataclass(frozen=True)
class RootNoise:
    """What is random of a floating root, uniform up to these numbers to either side. position: along x, y and z of the
    world, m. yaw: about the world's z, rad, at most pi. any_rotation: uniform over all rotations, in place of yaw and of
    the pose's own. angular_velocity, linear_velocity: about and along each of the world's axes, rad/s and m/s."""

    position: Sequence[float] = (0.0, 0.0, 0.0)
    yaw: float = 0.0
    any_rotation: bool = False
    angular_velocity: float = 0.0
    linear_velocity: float = 0.0


@dataclass(frozen=True)
class Start:
    """A pose and uniform noise about it, for Batch.reset_to() and VectorEnv.

    pose: one of plan.poses, by name or number; "" is the model's own start. Of the independent joints, position (rad or
    m) and velocity (rad/s or m/s) change up to these numbers to either side, and position by up to the share `spread` (0
    to 1) of the way to each end of the joint's range beside that. Noise carries none of these out of its range;
    followers and tendons may leave theirs. roots: noise of all floating roots, or by name of the root, where "" is about
    all that are not named."""

    pose: Union[str, int] = ""
    position: float = 0.0
    spread: float = 0.0
    velocity: float = 0.0
    roots: Union[RootNoise, Mapping[str, RootNoise]] = field(default_factory=lambda: dict[str, RootNoise]())
