# The form of Stable-Baselines3. SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Optional

import numpy as np

from .errors import UsageError
from .rsl_rl import same_step

try:
    from stable_baselines3.common.vec_env import VecEnv as Base
except ImportError:
    Base = object

if TYPE_CHECKING:
    from .vector import VectorEnv


class Sb3VecEnv(Base):  # type: ignore[misc]
    """A VectorEnv as stable_baselines3's VecEnv, of which it is one where that can be imported. The autoreset mode must
    be SameStep. infos[i] has "TimeLimit.truncated" and "terminal_observation" when the episode of i has ended."""

    render_mode = None

    def __init__(self, env: "VectorEnv") -> None:
        same_step(env, "stable_baselines3")
        self.env = env
        if Base is not object:
            super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        else:
            self.num_envs = env.num_envs
            self.observation_space = env.single_observation_space
            self.action_space = env.single_action_space
            self.reset_infos: list[dict[str, Any]] = [{} for _ in range(env.num_envs)]
        self._seed: Optional[int] = None
        self._actions: Any = None

    def reset(self) -> Any:
        seen, _ = self.env.reset(seed=self._seed)
        self._seed = None
        return seen

    def step_async(self, actions: Any) -> None:
        self._actions = actions

    def step_wait(self) -> tuple[Any, Any, Any, list[dict[str, Any]]]:
        if self._actions is None:
            raise UsageError("step_wait()", "has no actions to wait for", "call step_async() before", "usage")
        actions, self._actions = self._actions, None
        seen, rewards, terminated, truncated, info = self.env.step(actions)
        dones = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for place in np.flatnonzero(dones):
            infos[place] = {
                "TimeLimit.truncated": bool(truncated[place] and not terminated[place]),
                "terminal_observation": info["final_obs"][place],
                "reason": info["final_info"]["reason"][place],
            }
        return seen, rewards, dones, infos

    def step(self, actions: Any) -> tuple[Any, Any, Any, list[dict[str, Any]]]:
        self.step_async(actions)
        return self.step_wait()

    def close(self) -> None:
        self.env.close()

    def seed(self, seed: Optional[int] = None) -> list[Optional[int]]:
        """The next reset() takes it."""
        self._seed = seed
        return [seed] * self.num_envs

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        return [getattr(self.env, attr_name) for _ in self._places(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """For all environments: they share their attributes."""
        if len(self._places(indices)) != self.num_envs:
            raise UsageError("indices", "are some of the environments, which share attributes", "give None", "usage")
        setattr(self.env, attr_name, value)

    def env_method(self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any) -> list[Any]:
        """Called once, for all environments."""
        result = getattr(self.env, method_name)(*method_args, **method_kwargs)
        return [result for _ in self._places(indices)]

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        return [False for _ in self._places(indices)]

    def get_images(self) -> list[Any]:
        return [None] * self.num_envs

    def _places(self, indices: Any) -> list[int]:
        if indices is None:
            return list(range(self.num_envs))
        places = [int(i) for i in np.atleast_1d(indices)]
        if len(set(places)) != len(places) or not all(0 <= i < self.num_envs for i in places):
            raise UsageError(f"indices {places}", "appear twice or are outside the batch",
                             f"give different ones from 0 to {self.num_envs - 1}", "usage.environment")
        return places
