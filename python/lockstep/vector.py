# Vector environments by Gymnasium's rules. SPDX-License-Identifier: Apache-2.0
"""VectorEnv has the interface of gymnasium.vector.VectorEnv (1.x) and does not need Gymnasium. Where Gymnasium can be
imported, spaces and the autoreset mode are its own types. check() tests any vector environment against these rules."""

from __future__ import annotations

import operator
from typing import Any, Callable, Mapping, Optional, Sequence, Union

import numpy as np
import numpy.typing as npt

from ._lockstep import Batch, Plan
from .query import Query
from .start import Start

try:
    from gymnasium.spaces import Box
    from gymnasium.vector import AutoresetMode
    from gymnasium.vector import VectorEnv as Base
except ImportError:
    from .spaces import AutoresetMode, Box

    Base = object

Array = npt.NDArray[Any]
Mask = npt.NDArray[np.bool_]
ACTION_KINDS = ("position", "position_change", "velocity", "effort")
Rule = Callable[["VectorEnv"], Array]


class VectorEnv(Base):  # type: ignore[misc]
    """Environments of one plan with observations, rewards and ends of episodes.

    Give rules as functions of the environment, or override the methods of the same names; advance can only be overridden.
    A class sets what its rules need before it calls __init__(), which observes once:
        observe    queries (see Batch.read()), or a function that returns [num_envs, k]; default: q and qd
        reward     [num_envs] float; default: 0
        terminate  [num_envs] bool; default: never. A fault terminates an episode in any case
        randomize  called with the mask of the environments that are being reset, before they get their start
        after_reset  the same, when they have it: it may change the state, the inputs and what rules know
        advance    takes the actions of a control step; default: Batch.act() and Batch.step()
    limit: control steps after which an episode is truncated. decimation: steps of dt in a control step. Actions lie in
    [-1, 1] and act on Plan.driven_dofs by `action_kind`, see Batch.act(). start: a pose of the model by name or number, or a
    Start, which has noise. spread: short for start=Start(spread=spread), from the model's own start; without both it is 1,
    the whole range of each joint. copy=False returns the same observation array in every step.

    Observations of an environment depend on its seed, its id and its actions, not on num_envs, its place, the number of
    threads or the autoreset mode.
    """

    render_mode = None
    spec = None

    def __init__(
        self,
        plan: Plan,
        num_envs: int,
        *,
        observe: Union[None, Sequence[Union[str, Query]], Rule] = None,
        reward: Optional[Rule] = None,
        terminate: Optional[Rule] = None,
        randomize: Optional[Callable[["VectorEnv", Mask], None]] = None,
        after_reset: Optional[Callable[["VectorEnv", Mask], None]] = None,
        limit: Optional[int] = None,
        decimation: int = 4,
        action_kind: str = "position",
        autoreset_mode: Any = "NextStep",
        start: Union[None, str, int, Start] = None,
        spread: Optional[float] = None,
        seed: int = 0,
        first_id: int = 0,
        threads: int = 0,
        dtype: str = "f4",
        copy: bool = True,
    ) -> None:
        if action_kind not in ACTION_KINDS:
            raise ValueError(f"action_kind {action_kind!r} is none of {', '.join(ACTION_KINDS)}")
        if start is not None and spread is not None:
            raise ValueError("start and spread are both given: give start=Start(pose, spread=...)")
        if start is None:
            start = Start(spread=1.0 if spread is None else spread)
        if isinstance(start, Start) and not 0.0 <= start.spread <= 1.0:
            raise ValueError(f"spread is {start.spread}, not 0 to 1")
        if decimation < 1 or (limit is not None and limit < 1):
            raise ValueError(f"limit and decimation must be 1 or more, not {limit} and {decimation}")
        self.plan = plan
        self.num_envs = num_envs
        self.batch: Batch = plan.batch(num_envs, threads=threads, seed=seed, first_id=first_id, dtype=dtype)
        self.limit = limit
        self.decimation = decimation
        self.action_kind = action_kind
        self.start = start
        self.copy = copy
        self.closed = False
        self.autoreset_mode = AutoresetMode(getattr(autoreset_mode, "value", autoreset_mode))
        self.metadata: dict[str, Any] = {"autoreset_mode": self.autoreset_mode}
        self._observe = observe if observe is not None else ("q", "qd")
        self._reward = reward
        self._terminate = terminate
        self._randomize = randomize
        self._after_reset = after_reset
        self.elapsed = np.zeros(num_envs, np.int64)  # control steps of the episode
        self._ended = np.ones(num_envs, np.bool_)  # the next step resets these, or refuses
        self._started = False

        self.batch.episode[:] = -1  # so that the first reset begins episode 0
        actions = len(plan.independent_dofs if action_kind == "effort" else plan.driven_dofs)
        self.single_action_space = Box(-1.0, 1.0, (actions,), np.float32)
        self.action_space = Box(-1.0, 1.0, (num_envs, actions), np.float32)
        seen = np.asarray(self.observe())
        if seen.ndim != 2 or len(seen) != num_envs:
            raise ValueError(f"observations have the shape {seen.shape}, not ({num_envs}, k)")
        size = seen.shape[1]
        self.single_observation_space = Box(-np.inf, np.inf, (size,), np.float32)
        self.observation_space = Box(-np.inf, np.inf, (num_envs, size), np.float32)
        self._observations = np.zeros((num_envs, size), np.float32)

    # --- rules, to override ------------------------------------------------------------------

    def observe(self) -> Array:
        """[num_envs, k]"""
        if callable(self._observe):
            return self._observe(self)
        return self.batch.read(*self._observe)

    def reward(self) -> Array:
        """[num_envs]"""
        return self._reward(self) if self._reward else np.zeros(self.num_envs, np.float32)

    def terminate(self) -> Array:
        """[num_envs] bool"""
        return self._terminate(self) if self._terminate else np.zeros(self.num_envs, np.bool_)

    def randomize(self, which: Mask) -> None:
        if self._randomize:
            self._randomize(self, which)

    def after_reset(self, which: Mask) -> None:
        if self._after_reset:
            self._after_reset(self, which)

    def advance(self, actions: Array) -> None:
        """A control step of all environments."""
        self.batch.act(actions, self.action_kind)
        self.batch.step(self.decimation)

    # --- Gymnasium's interface ---------------------------------------------------------------

    def reset(
        self, *, seed: Union[None, int, Sequence[Optional[int]]] = None, options: Optional[Mapping[str, Any]] = None
    ) -> tuple[Array, dict[str, Any]]:
        """All environments, or those of options["reset_mask"]. A seed is for all of them; ids make the difference. A
        list has a seed for each, and None keeps what the environment has. Without a seed random numbers go on."""
        which = self._mask(options)
        self._seed(seed, which)
        self._start(which)
        return self._observed(), {}

    def step(self, actions: npt.ArrayLike) -> tuple[Array, Array, Mask, Mask, dict[str, Any]]:
        """One control step: observations, rewards, terminated, truncated, info."""
        if not self._started or self.closed:
            raise RuntimeError("step() comes after reset() and before close()")
        given = np.asarray(actions)
        if given.shape != self.action_space.shape:
            raise ValueError(f"actions have the shape {given.shape}, not {self.action_space.shape}")
        disabled = self.autoreset_mode.value == "Disabled"
        if disabled and self._ended.any():
            place = int(np.argmax(self._ended))
            raise RuntimeError(f"environment {place} has ended: reset it with options={{'reset_mask': mask}}")

        self.advance(given)
        self.elapsed += 1
        restarted = self._ended.copy()
        if restarted.any():
            self._start(restarted)
        fault = self.batch.fault != 0
        terminated = (self._one_each(self.terminate(), np.bool_, "terminate") | fault) & ~restarted
        truncated = np.zeros(self.num_envs, np.bool_)
        if self.limit is not None:
            truncated = (self.elapsed >= self.limit) & ~restarted
        rewards = np.where(restarted, 0, self._one_each(self.reward(), np.float32, "reward")).astype(np.float32)
        self._ended = terminated | truncated

        info: dict[str, Any] = {}
        if fault.any():
            info = {"fault": self.batch.fault.astype(np.uint8), "_fault": fault}
        observations = self._observed()
        if self._ended.any() and self.autoreset_mode.value == "SameStep":
            observations = self._restart_ended(observations, info)
        return observations, rewards, terminated, truncated, info

    def close(self, **kwargs: Any) -> None:
        self.closed = True

    def render(self) -> None:
        return None

    @property
    def unwrapped(self) -> "VectorEnv":
        return self

    def __repr__(self) -> str:
        return f"VectorEnv({self.plan!r}, num_envs={self.num_envs}, {self.autoreset_mode.value})"

    # --- parts -------------------------------------------------------------------------------

    def _mask(self, options: Optional[Mapping[str, Any]]) -> Mask:
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

    def _start(self, which: Mask) -> None:
        self.randomize(which)
        self.batch.reset_to(self.start, which)
        self.elapsed[which] = 0
        self._ended[which] = False
        self.after_reset(which)
        self._started = True

    def _one_each(self, given: Any, dtype: Any, rule: str) -> Array:
        numbers = np.asarray(given, dtype)
        if numbers.shape != (self.num_envs,):
            raise ValueError(f"{rule} gives the shape {numbers.shape}, not ({self.num_envs},)")
        return numbers

    def _observed(self) -> Array:
        seen = np.asarray(self.observe())
        if seen.shape != self.observation_space.shape:
            raise ValueError(f"observations have the shape {seen.shape}, not {self.observation_space.shape}")
        if self.copy:
            return np.array(seen, np.float32, order="C")
        self._observations[...] = seen
        return self._observations

    def _restart_ended(self, observations: Array, info: dict[str, Any]) -> Array:
        ended = self._ended.copy()
        final = observations.copy()
        info["final_obs"] = np.full(self.num_envs, None, object)
        for place in np.flatnonzero(ended):
            info["final_obs"][place] = final[place]
        info["_final_obs"] = ended
        info["final_obs_batch"] = final
        info["final_info"] = {key: info.pop(key) for key in ("fault", "_fault") if key in info}
        info["_final_info"] = ended
        self._start(ended)
        return self._observed()


class RslRlEnv:
    """A VectorEnv in the form that rsl_rl and Isaac Lab use: torch tensors, dones, extras["time_outs"]. The
    environment's autoreset mode must be SameStep. Observations are a TensorDict where tensordict can be imported."""

    def __init__(self, env: VectorEnv) -> None:
        import torch

        if env.autoreset_mode.value != "SameStep":
            raise ValueError("the environment needs autoreset_mode='SameStep'")
        if env.limit is None:
            raise ValueError("the environment needs a limit: it is the maximal length of an episode")
        self._torch = torch
        self.env = env
        self.num_envs = env.num_envs
        self.num_actions = len(env.plan.driven_dofs)
        self.max_episode_length = env.limit
        self.device = "cpu"
        self.cfg: dict[str, Any] = {}
        self._latest = env.reset()[0]

    @property
    def episode_length_buf(self) -> Any:
        return self._torch.from_numpy(self.env.elapsed)

    @episode_length_buf.setter
    def episode_length_buf(self, lengths: Any) -> None:
        self.env.elapsed[...] = lengths.cpu().numpy()

    def get_observations(self) -> Any:
        seen = self._torch.from_numpy(self._latest)
        try:
            from tensordict import TensorDict
        except ImportError:
            return seen
        return TensorDict({"policy": seen}, batch_size=[self.num_envs])

    def reset(self) -> tuple[Any, dict[str, Any]]:
        self._latest = self.env.reset()[0]
        return self.get_observations(), {}

    def step(self, actions: Any) -> tuple[Any, Any, Any, dict[str, Any]]:
        self._latest, rewards, terminated, truncated, _ = self.env.step(actions.detach().cpu().numpy())
        tensor = self._torch.from_numpy
        extras = {"time_outs": tensor(truncated & ~terminated), "log": {}}
        return self.get_observations(), tensor(rewards), tensor(terminated | truncated).long(), extras
