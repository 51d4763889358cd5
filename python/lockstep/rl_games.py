# The form of rl_games. SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .rsl_rl import same_step

if TYPE_CHECKING:
    from .vector import VectorEnv


class RlGamesEnv:
    """A VectorEnv in the form of rl_games' IVecEnv, with torch tensors. The autoreset mode must be SameStep. The first
    group is "obs", a group named "critic" is "states"."""

    def __init__(self, env: "VectorEnv") -> None:
        import torch

        same_step(env, "rl_games")
        self._torch = torch
        self.env = env

    def _seen(self, seen: Any) -> Any:
        names = self.env.group_names
        groups = seen if len(names) > 1 else {names[0]: seen}
        given = {"obs": self._torch.from_numpy(groups[names[0]])}
        if "critic" in names[1:]:
            given["states"] = self._torch.from_numpy(groups["critic"])
        return given

    def reset(self) -> Any:
        return self._seen(self.env.reset()[0])

    def step(self, actions: Any) -> tuple[Any, Any, Any, dict[str, Any]]:
        seen, rewards, terminated, truncated, info = self.env.step(actions.detach().cpu().numpy())
        tensor = self._torch.from_numpy
        extras: dict[str, Any] = {"time_outs": tensor(truncated & ~terminated)}
        if "log" in info:
            extras["episode"] = info["log"]
        return self._seen(seen), tensor(rewards), tensor(terminated | truncated), extras

    def get_number_of_agents(self) -> int:
        return 1

    def get_env_info(self) -> dict[str, Any]:
        names, space = self.env.group_names, self.env.single_observation_space
        spaces = {name: space[name] for name in names} if len(names) > 1 else {names[0]: space}
        return {"observation_space": spaces[names[0]], "action_space": self.env.single_action_space,
                "state_space": spaces.get("critic") if "critic" in names[1:] else None}
