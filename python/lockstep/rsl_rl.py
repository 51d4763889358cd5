# The form of rsl_rl. SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .errors import SettingsError

if TYPE_CHECKING:
    from .vector import VectorEnv


def same_step(env: Any, who: str) -> None:
    """Raises SettingsError unless the environment resets in the step that ends an episode, and returns what it keeps."""
    mode = env.autoreset_mode.value
    if mode != "SameStep":
        raise SettingsError("autoreset_mode", f"is {mode}, and {who} needs SameStep",
                            "give VectorEnv(..., autoreset_mode='SameStep')", "settings")
    if not env.copy:
        raise SettingsError("copy", f"is False, and {who} keeps observations over a step",
                            "give VectorEnv(..., copy=True)", "settings")


class RslRlEnv:
    """A VectorEnv in the form that rsl_rl and Isaac Lab use: torch tensors, dones, extras["time_outs"], extras["log"].
    The autoreset mode must be SameStep. Observations are a TensorDict of the groups where tensordict can be imported,
    else a dict of tensors, or a tensor with one group."""

    def __init__(self, env: "VectorEnv") -> None:
        import torch

        same_step(env, "rsl_rl")
        if env.limit is None:
            raise SettingsError("limit", "is None, and rsl_rl needs the longest episode",
                                "give VectorEnv(..., limit=STEPS)", "settings")
        self._torch = torch
        self.env = env
        self.num_envs = env.num_envs
        self.num_actions = env.single_action_space.shape[0]
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
        names = self.env.group_names
        seen: Any = self._latest if len(names) > 1 else {names[0]: self._latest}
        tensors = {name: self._torch.from_numpy(values) for name, values in seen.items()}
        try:
            from tensordict import TensorDict
        except ImportError:
            return tensors if len(names) > 1 else tensors[names[0]]
        return TensorDict(tensors, batch_size=[self.num_envs])

    def reset(self) -> tuple[Any, dict[str, Any]]:
        self._latest = self.env.reset()[0]
        return self.get_observations(), {}

    def step(self, actions: Any) -> tuple[Any, Any, Any, dict[str, Any]]:
        self._latest, rewards, terminated, truncated, info = self.env.step(actions.detach().cpu().numpy())
        tensor = self._torch.from_numpy
        extras = {"time_outs": tensor(truncated & ~terminated)}
        if "log" in info:  # rsl_rl takes the names of the first log for those of all
            extras["log"] = info["log"]
        return self.get_observations(), tensor(rewards), tensor(terminated | truncated).long(), extras
