# Types of the extension module. SPDX-License-Identifier: Apache-2.0
import os
from typing import Any, Callable, Mapping, Optional, Sequence, Union, final

import numpy as np
import numpy.typing as npt

from .model import Export, Model, VisualMesh
from .query import Query
from .start import Start

__version__: str

_Floats = npt.NDArray[Any]  # float32 or float64, as the batch
_Counts = npt.NDArray[np.int32]
_Which = Union[None, npt.NDArray[np.bool_], npt.NDArray[np.integer[Any]], Sequence[int], Sequence[bool]]
_Unmet = list[tuple[int, str, float, float]]  # environment, coupling, error, velocity error
_Ignore = Union[None, str, Sequence[str], Mapping[str, Union[bool, str, Sequence[str]]]]

def compile(
    model: Model,
    *,
    dt: float = ...,
    vary: Union[str, Sequence[str]] = ...,
    method: str = ...,
    integrator: str = ...,
    iterations: int = ...,
    velocity_iterations: int = ...,
    ignore: _Ignore = ...,
    stage_inputs: bool = ...,
    record_impulses: bool = ...,
    diagnostics: bool = ...,
    record_efforts: bool = ...,
    record_contacts: bool = ...,
    record_accelerations: bool = ...,
    guard: float = ...,
    position_bound: float = ...,
    velocity_bound: float = ...,
    contact_settings: str = ...,
    contact_passes: Optional[int] = ...,
    contact_rounds: Optional[int] = ...,
    contact_tolerance: Optional[float] = ...,
) -> Plan: ...
def from_file(
    path: Union[str, os.PathLike[str]],
    *,
    least_mass: float = ...,
    least_inertia: float = ...,
    density: float = ...,
    repair_inertias: bool = ...,
    leave_out_foreign: bool = ...,
    colliders: bool = ...,
    keyframe: str = ...,
    body: str = ...,
    loops: str = ...,
    soft: str = ...,
    leave_out_meshes: bool = ...,
    self_collisions: bool = ...,
    hull_vertices: int = ...,
    fit: str = ...,
    fit_of_links: Mapping[str, str] = ...,
    packages: Mapping[str, Union[str, os.PathLike[str]]] = ...,
    file_roots: Sequence[Union[str, os.PathLike[str]]] = ...,
    visual_meshes: bool = ...,
    ignore: _Ignore = ...,
) -> Model: ...
def from_urdf_text(
    text: str,
    source: str = ...,
    *,
    least_mass: float = ...,
    least_inertia: float = ...,
    density: float = ...,
    repair_inertias: bool = ...,
    leave_out_foreign: bool = ...,
    colliders: bool = ...,
    keyframe: str = ...,
    body: str = ...,
    loops: str = ...,
    soft: str = ...,
    leave_out_meshes: bool = ...,
    self_collisions: bool = ...,
    hull_vertices: int = ...,
    fit: str = ...,
    fit_of_links: Mapping[str, str] = ...,
    packages: Mapping[str, Union[str, os.PathLike[str]]] = ...,
    file_roots: Sequence[Union[str, os.PathLike[str]]] = ...,
    visual_meshes: bool = ...,
    ignore: _Ignore = ...,
) -> Model: ...

from_urdf = from_file
from_mjcf = from_file
from_mjcf_text = from_urdf_text

def export_mjcf(model: Model, *, timestep: Optional[float] = ...) -> Export: ...
def export_urdf(model: Model) -> Export: ...
def _end_colliders(model: Model) -> list[str]: ...
def _require_main_interpreter() -> None: ...
def _uniform_by_step(batch: Batch, out: _Floats, stream: int) -> None: ...
def load_kernel(path: str) -> None: ...

@final
class Plan:
    @property
    def model(self) -> Model: ...
    @property
    def settings(self) -> dict[str, Any]: ...
    @property
    def dt(self) -> float: ...
    @property
    def method(self) -> str: ...
    @property
    def integrator(self) -> str: ...
    @property
    def nv(self) -> int: ...
    @property
    def dof_names(self) -> list[str]: ...
    @property
    def loops(self) -> list[tuple[str, int, int]]: ...
    @property
    def loop_dependent(self) -> list[str]: ...
    @property
    def contact_names(self) -> list[str]: ...
    @property
    def root_names(self) -> list[str]: ...
    @property
    def poses(self) -> list[str]: ...
    @property
    def row_names(self) -> list[str]: ...
    @property
    def independent_dofs(self) -> list[str]: ...
    @property
    def driven_dofs(self) -> list[str]: ...
    @property
    def coordinates(self) -> list[str]: ...
    @property
    def open_coordinates(self) -> list[str]: ...
    @property
    def followers(self) -> dict[str, tuple[tuple[tuple[str, float], ...], float]]: ...
    @property
    def vary(self) -> list[str]: ...
    @property
    def limits(self) -> npt.NDArray[np.float64]: ...
    @property
    def hash(self) -> int: ...
    @property
    def stage_times(self) -> list[float]: ...
    def parameter_rows(self, name: str) -> list[str]: ...
    def dof(self, joint: str) -> int: ...
    def link(self, name: str) -> int: ...
    def site(self, name: str) -> int: ...
    def contact(self, name: str) -> int: ...
    def obstacles(self) -> list[dict[str, str]]: ...
    def describe(self) -> str: ...
    def batch(
        self,
        num_envs: int,
        *,
        threads: int = ...,
        seed: int = ...,
        first_id: int = ...,
        dtype: npt.DTypeLike = ...,
        target: str = ...,
        engine: str = ...,
    ) -> Batch: ...

@final
class _Motion:
    @staticmethod
    def of(plan: Plan, environments: Sequence[int], visual_meshes: Sequence[VisualMesh] = ...) -> _Motion: ...
    @property
    def samples(self) -> int: ...
    def require_room(self, samples: int) -> None: ...
    def clear(self) -> None: ...
    def add(self, time: float, batch: Batch, environments: Sequence[int]) -> None: ...
    def page(self, about: str) -> bytes: ...
    def numbers(self) -> str: ...

@final
class Rows:
    q: _Floats
    qd: _Floats
    q_target: _Floats
    qd_target: _Floats
    effort: _Floats
    root_pose: _Floats
    root_twist: _Floats
    def parameter(self, name: str) -> _Floats: ...

@final
class Batch:
    q: _Floats
    qd: _Floats
    q_target: _Floats
    qd_target: _Floats
    effort: _Floats
    root_pose: _Floats
    root_twist: _Floats
    seed: npt.NDArray[np.uint64]
    env_id: npt.NDArray[np.uint32]
    episode: _Counts
    def parameter(self, name: str) -> _Floats: ...
    def expand(self, name: str) -> _Floats: ...
    def bind(self, name: str) -> _Floats: ...
    @property
    def rows(self) -> Rows: ...
    @property
    def fault(self) -> _Counts: ...
    @property
    def steps(self) -> _Counts: ...
    @property
    def num_envs(self) -> int: ...
    @property
    def plan(self) -> Plan: ...
    @property
    def dtype(self) -> np.dtype[Any]: ...
    @property
    def engine(self) -> str: ...
    @property
    def target(self) -> str: ...
    @property
    def kernel(self) -> str: ...
    def forget_contacts(self, which: _Which = ...) -> None: ...
    def step(self, substeps: int = ..., *, before: Optional[Callable[[int], object]] = ...) -> None: ...
    def reset(
        self,
        which: _Which = ...,
        q: Optional[npt.ArrayLike] = ...,
        qd: Optional[npt.ArrayLike] = ...,
        *,
        keep_inputs: bool = ...,
        project: Union[bool, str] = ...,
    ) -> _Unmet: ...
    def reset_random(self, which: _Which = ..., spread: float = ..., speed: float = ..., *, stream: int = ...) -> _Unmet: ...
    def reset_to(
        self,
        start: Union[str, int, Start] = ...,
        which: _Which = ...,
        *,
        stream: int = ...,
        keep_inputs: bool = ...,
        project: Union[bool, str] = ...,
    ) -> _Unmet: ...
    def copy_state(self, source: int, to: _Which = ...) -> None: ...
    def randomize(
        self,
        name: str,
        operation: str,
        low: float,
        high: float,
        *,
        distribution: str = ...,
        which: _Which = ...,
        rows: Optional[Sequence[Union[int, str]]] = ...,
        shared: bool = ...,
        stream: int = ...,
    ) -> None: ...
    def draw(self, count: int, which: _Which = ..., stream: int = ...) -> _Floats: ...
    def normal(self, count: int, which: _Which = ..., stream: int = ...) -> _Floats: ...
    def act(
        self,
        actions: npt.ArrayLike,
        kind: str = ...,
        which: _Which = ...,
        *,
        low: Optional[Sequence[float]] = ...,
        high: Optional[Sequence[float]] = ...,
        joints: Optional[Sequence[str]] = ...,
        scale: Union[None, float, Sequence[float]] = ...,
        center: Union[None, float, Sequence[float]] = ...,
        alpha: float = ...,
    ) -> None: ...
    def project(self, which: _Which = ..., *, soft: bool = ...) -> _Unmet: ...
    def check(self, which: _Which = ...) -> list[tuple[int, str, int, float, str]]: ...
    def read(self, *queries: Union[str, Query], out: Optional[_Floats] = ...) -> _Floats: ...
    def rollout(
        self,
        start: Union[bytes, _Which],
        controls: npt.ArrayLike,
        *,
        record: Union[str, Query, Sequence[Union[str, Query]]] = ...,
        substeps: int = ...,
        kind: str = ...,
        raw: bool = ...,
        low: Optional[Sequence[float]] = ...,
        high: Optional[Sequence[float]] = ...,
        out: Optional[_Floats] = ...,
    ) -> tuple[_Floats, _Counts]: ...
    def linearize(
        self,
        which: _Which = ...,
        *,
        inputs: str = ...,
        substeps: int = ...,
        parameters: Sequence[tuple[str, str]] = ...,
        record: Union[str, Query, Sequence[Union[str, Query]]] = ...,
        step: float = ...,
    ) -> dict[str, npt.NDArray[Any]]: ...
    def inverse_kinematics(
        self,
        site: str,
        targets: npt.ArrayLike,
        which: _Which = ...,
        *,
        iterations: int = ...,
        tolerance: float = ...,
    ) -> _Floats: ...
    def save(self, which: _Which = ...) -> bytes: ...
    def restore(self, blob: bytes, into: _Which = ..., rows: Optional[Sequence[int]] = ..., *, other_settings: bool = ...) -> None: ...
    def describe(self) -> str: ...
    def explain_fault(self, environment: int) -> str: ...
    def fault_report(self, environment: int) -> dict[str, Any]: ...
    def coupling_error(self) -> _Floats: ...
    def loop_error(self) -> _Floats: ...
    def coupling_impulse(self) -> _Floats: ...
    def row_residuals(self) -> _Floats: ...
    def row_states(self) -> _Floats: ...
    def energy_balance(self) -> _Floats: ...
    def site_jacobian(self, site: str) -> _Floats: ...
    def mass_matrix(self, which: _Which = ...) -> _Floats: ...
    def bias_forces(self, which: _Which = ...) -> _Floats: ...
    def jacobian(self, which: _Which = ..., *, link: Optional[str] = ..., site: Optional[str] = ...) -> _Floats: ...
    def conflicts(self, environment: int) -> list[str]: ...
