# Vector environments by Gymnasium's rules. SPDX-License-Identifier: Apache-2.0
"""VectorEnv has the interface of gymnasium.vector.VectorEnv (1.x) and does not need Gymnasium. Where Gymnasium can be
imported, spaces and the autoreset mode are its own types. check() tests any vector environment against these rules."""

from __future__ import annotations

import operator
from contextlib import contextmanager
from typing import Any, Callable, Iterator, Mapping, Optional, Sequence, Union

import numpy as np
import numpy.typing as npt

from ._lockstep import Batch, Plan
from .errors import UsageError
from .events import Event, Events
from .model import VisualMesh
from .observations import Observations
from .recording import Recording, checked
from .rendering import Renderer
from .rewards import EpisodeLog, Rewards, Terminations, each, refuse_taken
from .query import Query
from .start import Start

try:
    from gymnasium.spaces import Box, Dict
    from gymnasium.vector import AutoresetMode
    from gymnasium.vector import VectorEnv as Base
except ImportError:
    from .spaces import AutoresetMode, Box, Dict

    Base = object

Array = npt.NDArray[Any]
Mask = npt.NDArray[np.bool_]
ACTION_KINDS = ("position", "position_change", "velocity", "effort")
ACTION_OPTIONS = {"joints", "low", "high", "scale", "center", "alpha"}
MOST_PICTURES = 64  # at once
Rule = Callable[["VectorEnv"], Array]


class VectorEnv(Base):  # type: ignore[misc]
    """Environments of one plan with observations, rewards and ends of episodes.

    Give rules as functions of the environment, or override the methods of the same names; advance can only be overridden.
    A class sets what its rules need before it calls __init__(), which observes once:
        observe    queries (see Batch.read()), a function that returns [num_envs, k] or {group: [num_envs, k]}, or
                   groups of terms (see Observations); default: q and qd. With one group observations are an array,
                   with several a dict
        reward     [num_envs] float, or {name: (weight, function)} (see Rewards); default: 0
        terminate  [num_envs] bool, or {name: function} (see Terminations); default: never. A fault terminates an
                   episode in any case, and pays nothing
        events     {name: Event}
        randomize  called with the mask of the environments that are being reset, before they get their start
        after_reset  the same, when they have it: it may change the state, the inputs and what rules know
        advance    takes the actions of a control step; default: Batch.act() and Batch.step()
    limit: control steps after which an episode is truncated. decimation: steps of dt in a control step. Actions lie in
    [-1, 1] and act on Plan.driven_dofs by `action_kind`; `actions` has other options of Batch.act(), such as joints and
    scale, which is about the pose of `start`. start: a pose of the model by name or number, or a Start, which has noise.
    spread: short for start=Start(spread=spread), from the model's own start; without both it is 1, the whole range of
    each joint. copy=False returns the same observation array in every step. render_mode="rgb_array" makes render()
    give pictures of `render_environments`, by default all, of `render_size`, width and height in pixels (see Renderer).
    visual_meshes: what links are drawn as in pictures and recordings, such as those of from_file(visual_meshes=True).

    Observations of an environment depend on its seed, its id and its actions, not on num_envs, its place, the number of
    threads or the autoreset mode.
    """

    spec = None

    def __init__(
        self,
        plan: Plan,
        num_envs: int,
        *,
        observe: Union[None, Sequence[Union[str, Query]], Mapping[str, Any], Callable[["VectorEnv"], Any]] = None,
        reward: Union[None, Mapping[str, Any], Callable[["VectorEnv"], Any]] = None,
        terminate: Union[None, Mapping[str, Any], Callable[["VectorEnv"], Any]] = None,
        randomize: Optional[Callable[["VectorEnv", Mask], None]] = None,
        after_reset: Optional[Callable[["VectorEnv", Mask], None]] = None,
        events: Optional[Mapping[str, Event]] = None,
        limit: Optional[int] = None,
        decimation: int = 4,
        action_kind: str = "position",
        actions: Optional[Mapping[str, Any]] = None,
        autoreset_mode: Any = "NextStep",
        start: Union[None, str, int, Start] = None,
        spread: Optional[float] = None,
        seed: int = 0,
        first_id: int = 0,
        threads: int = 0,
        memory_domain: int = -1,
        dtype: str = "f4",
        copy: bool = True,
        render_mode: Optional[str] = None,
        render_environments: Optional[Sequence[int]] = None,
        render_size: tuple[int, int] = (640, 480),
        visual_meshes: Sequence[VisualMesh] = (),
    ) -> None:
        if action_kind not in ACTION_KINDS:
            raise ValueError(f"action_kind {action_kind!r} is none of {', '.join(ACTION_KINDS)}")
        if isinstance(observe, str):
            raise TypeError(f"observe is the string {observe!r}: give a list of queries, such as [{observe!r}]")
        if not callable(observe) and observe is not None and len(observe) == 0:
            raise ValueError("observe is empty: leave it out for q and qd")
        if unknown := set(actions or {}) - ACTION_OPTIONS:
            raise ValueError(f"actions have the unknown options {sorted(unknown)}: give {sorted(ACTION_OPTIONS)}")
        if start is not None and spread is not None:
            raise ValueError("start and spread are both given: give start=Start(pose, spread=...)")
        if start is None:
            start = Start(spread=1.0 if spread is None else spread)
        if isinstance(start, Start) and not 0.0 <= start.spread <= 1.0:
            raise ValueError(f"spread is {start.spread}, not 0 to 1")
        for name, count in (("decimation", decimation), ("limit", limit)):
            if count is not None and not hasattr(count, "__index__"):
                raise TypeError(f"{name} is {count}: give a whole number")
        if decimation < 1 or (limit is not None and limit < 1):
            raise ValueError(f"limit and decimation must be 1 or more, not {limit} and {decimation}")
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode {render_mode!r} is neither None nor 'rgb_array'")
        self.plan = plan
        self.num_envs = num_envs
        self.batch: Batch = plan.batch(num_envs, threads=threads, memory_domain=memory_domain, seed=seed,
                                       first_id=first_id, dtype=dtype)
        self.limit = limit
        self.decimation = decimation
        self.action_kind = action_kind
        self.action_options = dict(actions or {})
        if action_kind == "position" and "scale" in self.action_options:
            self.action_options.setdefault("center", self._start_pose(start))
        self.start = start
        self.copy = copy
        self.closed = False
        self.autoreset_mode = AutoresetMode(getattr(autoreset_mode, "value", autoreset_mode))
        self.metadata: dict[str, Any] = {"autoreset_mode": self.autoreset_mode, "render_modes": ["rgb_array"],
                                         "render_fps": 1.0 / (decimation * plan.dt)}
        self.render_mode = render_mode
        self.render_size = render_size
        self.visual_meshes = visual_meshes
        self.render_environments = checked(self.batch, range(num_envs) if render_environments is None else
                                           render_environments)
        if render_mode and len(self.render_environments) > MOST_PICTURES:
            raise UsageError("render_environments", f"are {len(self.render_environments)}",
                             f"give the numbers of at most {MOST_PICTURES}, as in [0, 1]", "usage.environment")
        self._renderer: Optional[Renderer] = None
        self._recordings: list[Recording] = []
        self._observe: Any = Observations(observe) if isinstance(observe, Mapping) else observe or ("q", "qd")
        self._reward: Any = Rewards(reward) if isinstance(reward, Mapping) else reward
        self._terminate: Any = Terminations(terminate) if isinstance(terminate, Mapping) else terminate
        self._events = Events(events or {}, num_envs, decimation * plan.dt)
        self._log = EpisodeLog(num_envs)
        self.ends: dict[str, Mask] = {}  # which rules ended episodes in the latest step
        self._randomize = randomize
        self._after_reset = after_reset
        self.elapsed = np.zeros(num_envs, np.int64)  # control steps of the episode
        self._ended = np.ones(num_envs, np.bool_)  # the next step resets these, or refuses
        self._started = False

        self.batch.episode[:] = -1  # so that the first reset begins episode 0
        commanded = plan.independent_dofs if action_kind == "effort" else plan.driven_dofs
        columns = len(self.action_options.get("joints") or commanded)
        self.single_action_space = Box(-1.0, 1.0, (columns,), np.float32)
        self.action_space = Box(-1.0, 1.0, (num_envs, columns), np.float32)
        seen = self.observe()
        self.group_names = tuple(seen) if isinstance(seen, Mapping) else ("policy",)
        bounds = self._observe.bounds() if isinstance(self._observe, Observations) else {}
        single, batched, self._buffers = {}, {}, {}
        for name, values in self._grouped(seen).items():
            if values.ndim != 2 or len(values) != num_envs:
                raise UsageError(f"observations '{name}'", f"have the shape {values.shape}", f"give ({num_envs}, k)",
                                 "usage.query")
            size = values.shape[1]
            low, high = bounds.get(name, (np.full(size, -np.inf, np.float32), np.full(size, np.inf, np.float32)))
            single[name] = Box(low, high, (size,), np.float32)
            batched[name] = Box(np.tile(low, (num_envs, 1)), np.tile(high, (num_envs, 1)), (num_envs, size), np.float32)
            self._buffers[name] = np.zeros((num_envs, size), np.float32)
        self.single_observation_space = Dict(single) if len(single) > 1 else single[self.group_names[0]]
        self.observation_space = Dict(batched) if len(batched) > 1 else batched[self.group_names[0]]

    # --- rules, to override ------------------------------------------------------------------

    def observe(self) -> Any:
        """[num_envs, k], or a dict of them by group"""
        if callable(self._observe):
            return self._observe(self)
        return self.batch.read(*self._observe)

    def reward(self) -> Any:
        """[num_envs], or a dict of terms, which are added up"""
        return self._reward(self) if self._reward else np.zeros(self.num_envs, np.float32)

    def terminate(self) -> Any:
        """[num_envs] bool, or a dict of them by reason"""
        return self._terminate(self) if self._terminate else np.zeros(self.num_envs, np.bool_)

    def randomize(self, which: Mask) -> None:
        """Called before the environments of the mask get their start."""
        if self._randomize:
            self._randomize(self, which)

    def after_reset(self, which: Mask) -> None:
        """Called when they have it."""
        if self._after_reset:
            self._after_reset(self, which)

    def advance(self, actions: Array) -> None:
        """A control step of all environments."""
        self.batch.act(actions, self.action_kind, **self.action_options)
        self.batch.step(self.decimation)

    # --- Gymnasium's interface ---------------------------------------------------------------

    def reset(
        self, *, seed: Union[None, int, Sequence[Optional[int]]] = None, options: Optional[Mapping[str, Any]] = None
    ) -> tuple[Array, dict[str, Any]]:
        """All environments, or those of options["reset_mask"]. A seed is for all of them; ids make the difference. A
        list has a seed for each, and None keeps what the environment has. Without a seed random numbers go on."""
        which = self._mask(options)
        self._seed(seed, which)
        self._prepare(which)
        self._begin(which)
        return self._observed(), {}

    def step(self, actions: npt.ArrayLike) -> tuple[Array, Array, Mask, Mask, dict[str, Any]]:
        """One control step: observations, rewards, terminated, truncated, info."""
        if not self._started or self.closed:
            raise RuntimeError("step() comes after reset() and before close()")
        given = np.asarray(actions)
        if given.shape != self.action_space.shape:
            raise UsageError("actions", f"have the shape {given.shape}", f"give {self.action_space.shape}",
                             "usage.actions")
        if given.dtype.kind not in "fiu":
            raise UsageError("actions", f"have the type {given.dtype}", "give float32", "usage.actions")
        if not np.isfinite(given).all():
            place, column = np.argwhere(~np.isfinite(given))[0]
            raise UsageError(f"action {column} of environment {place}", f"is {given[place, column]}",
                             "give finite numbers", "usage.actions")
        disabled = self.autoreset_mode.value == "Disabled"
        if disabled and self._ended.any():
            place = int(np.argmax(self._ended))
            raise RuntimeError(f"environment {place} has ended: reset it with options={{'reset_mask': mask}}")

        for recording in self._recordings:
            recording.require_room()
        restarted = self._ended.copy()
        if restarted.any():
            self._prepare(restarted)  # before the step that these skip: draws are those of the other modes
        self.advance(given)
        self.elapsed += 1
        if restarted.any():
            self._begin(restarted)
        for recording in self._recordings:
            recording.add()
        fault = self.batch.fault != 0
        running = ~restarted
        self.ends = {"fault": fault & running}
        for name, holds in self._named(self.terminate(), "terminated").items():
            refuse_taken(name)
            self.ends[name] = each(holds, self.num_envs, np.bool_, f"terminate '{name}'") & running
        terminated = np.logical_or.reduce(list(self.ends.values()))
        truncated = np.zeros(self.num_envs, np.bool_)
        if self.limit is not None:
            truncated = (self.elapsed >= self.limit) & running
        self.ends["time_out"] = truncated
        terms = {name: each(values, self.num_envs, np.float32, f"reward '{name}'")
                 for name, values in self._named(self.reward(), "reward").items()}
        rewards = self._log.add(terms, running & ~fault)  # what is frozen may be no number
        self._ended = terminated | truncated
        self._events.step(self, running & ~self._ended)

        info: dict[str, Any] = {}
        if fault.any():
            info = {"fault": self.batch.fault.astype(np.uint8), "_fault": fault}
        if self._ended.any():
            reason = np.full(self.num_envs, None, object)
            for name, holds in reversed(self.ends.items()):
                if name != "time_out":
                    reason[holds] = name
            reason[truncated & ~terminated] = "time_out"
            info["reason"], info["_reason"] = reason, self._ended.copy()
            info["log"] = self._log.ended(self._ended, self.elapsed, self.ends)
        observations = self._observed()
        if self._ended.any() and self.autoreset_mode.value == "SameStep":
            observations = self._restart_ended(observations, info)
        return observations, rewards, terminated, truncated, info

    def close(self, **kwargs: Any) -> None:
        """No step follows."""
        self.closed = True
        if self._renderer:
            self._renderer.close()
            self._renderer = None

    def render(self) -> Optional[tuple[npt.NDArray[np.uint8], ...]]:
        """With render_mode "rgb_array" a picture, uint8 [height, width, 3], of each of `render_environments`, else None.
        The first call starts Chromium. Raises UsageError where there is none."""
        if self.render_mode is None:
            return None
        if self._renderer is None:
            self._renderer = Renderer(self.batch, self.render_environments, self.render_size, self.visual_meshes)
        return self._renderer.frames()

    @contextmanager
    def record(self, environments: Sequence[int] = (0,)) -> Iterator[Recording]:
        """`with env.record([0, 3]) as recording:` takes frames of these environments, one in each control step within.
        Then recording.save("page.html") writes the page that plays them. A step raises UsageError, before it does
        anything, where the page would be too large for a browser."""
        recording = Recording(self.batch, environments, self.visual_meshes)
        self._recordings.append(recording)
        try:
            yield recording
        finally:
            self._recordings.remove(recording)

    @property
    def unwrapped(self) -> "VectorEnv":
        """This environment."""
        return self

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_renderer": None, "_recordings": []}  # a copy has none of them

    def __repr__(self) -> str:
        return f"VectorEnv({self.plan!r}, num_envs={self.num_envs}, {self.autoreset_mode.value})"

    # --- parts -------------------------------------------------------------------------------

    def _start_pose(self, start: Union[str, int, Start]) -> list[float]:
        """Positions of the joints that actions command."""
        one = self.plan.batch(1, threads=1, dtype="f8")
        one.reset_to(start.pose if isinstance(start, Start) else start)
        joints = self.action_options.get("joints") or self.plan.driven_dofs
        return [float(one.q[0, self.plan.dof(joint)]) for joint in joints]

    def _mask(self, options: Optional[Mapping[str, Any]]) -> Mask:
        if unknown := set(options or {}) - {"reset_mask"}:
            raise ValueError(f"reset() has the unknown options {sorted(unknown)}: give reset_mask")
        mask = (options or {}).get("reset_mask")
        if mask is None:
            return np.ones(self.num_envs, np.bool_)
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
            raise TypeError("reset_mask must be a numpy array of bool")
        if mask.shape != (self.num_envs,) or not mask.any():
            raise ValueError(f"reset_mask must have the shape ({self.num_envs},) and one True at least")
        return mask

    def _seed(self, seed: Union[None, int, Sequence[Optional[int]]], which: Mask) -> None:
        if seed is None:
            return
        if isinstance(seed, (int, np.integer)):
            seed = [int(seed)] * self.num_envs
        seeds = [None if own is None else operator.index(own) for own in seed]
        if len(seeds) != self.num_envs:
            raise ValueError(f"{len(seeds)} seeds for {self.num_envs} environments")
        for own in seeds:
            if own is not None and not 0 <= own < 1 << 64:
                raise ValueError(f"seed {own} is outside 0 to 2^64 - 1")
        for place in np.flatnonzero(which):
            own = seeds[place]
            if own is not None:
                self.batch.seed[place] = own
                self.batch.episode[place] = -1  # the reset makes it 0

    def _prepare(self, which: Mask) -> None:
        self._events.happen("start", self, which & (self.batch.episode == -1))
        self.randomize(which)
        self._events.happen("randomize", self, which)

    def _begin(self, which: Mask) -> None:
        self.batch.reset_to(self.start, which)
        self.elapsed[which] = 0
        self._log.restart(which)
        self._events.restart(self, which)
        self._events.happen("reset", self, which)
        self._ended[which] = False
        self.after_reset(which)
        self._started = True

    def _named(self, given: Any, name: str) -> Mapping[str, Any]:
        return given if isinstance(given, Mapping) else {name: given}

    def _grouped(self, seen: Any) -> dict[str, Array]:
        groups = seen if isinstance(seen, Mapping) else {self.group_names[0]: seen}
        return {name: np.asarray(values) for name, values in groups.items()}

    def _plain(self, groups: dict[str, Any]) -> Any:
        return groups if len(groups) > 1 else groups[self.group_names[0]]

    def _observed(self) -> Any:
        seen = self._grouped(self.observe())
        if tuple(seen) != self.group_names:
            raise UsageError("observation groups", f"are {tuple(seen)}", f"give {self.group_names}", "usage.query")
        for name, values in seen.items():
            if values.shape != self._buffers[name].shape:
                raise UsageError(f"observations '{name}'", f"have the shape {values.shape}",
                                 f"give {self._buffers[name].shape}", "usage.query")
        if self.copy:
            return self._plain({name: np.array(values, np.float32, order="C") for name, values in seen.items()})
        for name, values in seen.items():
            self._buffers[name][...] = values
        return self._plain(self._buffers)

    def _restart_ended(self, observations: Any, info: dict[str, Any]) -> Any:
        ended = self._ended.copy()
        groups = self._grouped(observations)
        if not self.copy:  # the arrays are written again below
            groups = {name: values.copy() for name, values in groups.items()}
        final = self._plain(groups)
        info["final_obs"] = np.full(self.num_envs, None, object)
        for place in np.flatnonzero(ended):
            info["final_obs"][place] = self._plain({name: values[place] for name, values in groups.items()})
        info["_final_obs"] = ended
        info["final_obs_batch"] = final
        info["final_info"] = {key: info.pop(key) for key in ("fault", "_fault", "reason", "_reason") if key in info}
        info["_final_info"] = ended
        self._prepare(ended)
        self._begin(ended)
        return self._observed()


from .rsl_rl import RslRlEnv  # noqa: E402,F401  its old place
