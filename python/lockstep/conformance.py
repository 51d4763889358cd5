# Checks a vector environment against Gymnasium's rules. SPDX-License-Identifier: Apache-2.0
"""check(make) makes environments, steps them with random actions and returns what they break, one line each. It needs no
Gymnasium. The rules are those of Gymnasium 1.x for VectorEnv and its three autoreset modes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Callable, Dict, List

import numpy as np

MODES = ("NextStep", "SameStep", "Disabled")


class _Findings:
    def __init__(self) -> None:
        self.lines: List[str] = []

    def expect(self, holds: Any, rule: str) -> bool:
        if not holds and rule not in self.lines:
            self.lines.append(rule)
        return bool(holds)


def _mode(env: Any) -> str:
    mode = env.metadata.get("autoreset_mode")
    return str(getattr(mode, "value", mode))


def _parts(whole: Any) -> Dict[str, Any]:
    """The spaces of a space, or the arrays of observations, by name; one without names has the name ""."""
    parts = getattr(whole, "spaces", whole)
    return dict(parts) if isinstance(parts, Mapping) else {"": whole}


def _copy(seen: Any) -> Dict[str, Any]:
    return {name: np.array(part) for name, part in _parts(seen).items()}


def _rows(seen: Any, mask: Any) -> Dict[str, Any]:
    return {name: part[mask] for name, part in _parts(seen).items()}


def _equal(one: Any, other: Any) -> bool:
    one, other = _parts(one), _parts(other)
    return one.keys() == other.keys() and all(np.array_equal(part, other[name]) for name, part in one.items())


def _observations(env: Any, seen: Any, where: str, found: _Findings) -> None:
    spaces, parts = _parts(env.observation_space), _parts(seen)
    if not found.expect(parts.keys() == spaces.keys(), f"{where}: observations must have the names of the space"):
        return
    for name, part in parts.items():
        if found.expect(isinstance(part, np.ndarray), f"{where}: observations must be a numpy array, or a dict of them"):
            shape, dtype = spaces[name].shape, spaces[name].dtype
            found.expect(part.shape == shape, f"{where}: observations must have the space's shape {shape}")
            found.expect(part.dtype == dtype, f"{where}: observations must have the space's dtype {dtype}")
            found.expect(np.all(np.isfinite(part)), f"{where}: observations must be finite")


def _refuses(call: Callable[[], Any], kinds: Any) -> bool:
    try:
        call()
    except kinds:
        return True
    except Exception:  # another error than the rule asks for
        return False
    return False


def _check_attributes(env: Any, found: _Findings) -> bool:
    names = ("num_envs", "observation_space", "single_observation_space", "action_space", "single_action_space")
    for name in names + ("metadata", "render_mode", "spec", "closed", "reset", "step", "close", "unwrapped"):
        found.expect(hasattr(env, name), f"the attribute {name} is missing")
    if found.lines:
        return False
    found.expect(isinstance(env.num_envs, int) and env.num_envs > 0, "num_envs must be a positive int")
    found.expect(_mode(env) in MODES, f"metadata['autoreset_mode'] must be one of {', '.join(MODES)}")
    for single, batched in ((env.single_observation_space, env.observation_space),
                            (env.single_action_space, env.action_space)):
        if found.expect(_parts(single).keys() == _parts(batched).keys(), "a batched space has the names of the single one"):
            for name, part in _parts(single).items():
                all_of_it = _parts(batched)[name]
                found.expect(all_of_it.shape == (env.num_envs, *part.shape),
                             "a batched space is num_envs of the single ones")
                found.expect(part.dtype == all_of_it.dtype, "a batched space has the dtype of the single one")
    found.expect(env.action_space.contains(env.action_space.sample()), "action_space must contain its samples")
    return not found.lines


def _check_seeds(env: Any, found: _Findings) -> None:
    first, info = env.reset(seed=11)
    _observations(env, first, "reset", found)
    first = _copy(first)
    found.expect(isinstance(info, dict), "reset must return observations and a dict")
    env.reset(seed=12)
    found.expect(_equal(first, env.reset(seed=11)[0]), "the same seed must give the same observations")
    each = list(range(5, 5 + env.num_envs))
    found.expect(_equal(_copy(env.reset(seed=each)[0]), env.reset(seed=each)[0]),
                 "a list with a seed for each environment must be accepted, and repeat")
    found.expect(_refuses(lambda: env.reset(seed=[1] * (env.num_envs + 1)), Exception),
                 "a list of seeds of another length must be refused")


def _check_steps(env: Any, steps: int, found: _Findings) -> None:
    mode, ended, episodes = _mode(env), np.zeros(env.num_envs, bool), 0
    env.reset(seed=3)
    kept: Any = None
    for _ in range(steps):
        if mode == "Disabled" and ended.any():
            found.expect(_refuses(lambda: env.step(env.action_space.sample()), Exception),
                         "Disabled: a step of an environment that has ended must be refused")
            seen = env.reset(options={"reset_mask": ended})[0]
            _observations(env, seen, "reset with a mask", found)
            found.expect(_equal(_rows(seen, ~ended), _rows(kept[0], ~ended)),
                         "Disabled: a reset with a mask must leave the others alone")
        before = ended
        result = env.step(env.action_space.sample())
        if not found.expect(isinstance(result, tuple) and len(result) == 5, "step must return five things"):
            return
        seen, rewards, terminated, truncated, info = result
        _observations(env, seen, "step", found)
        found.expect(rewards.shape == (env.num_envs,) and np.issubdtype(rewards.dtype, np.floating),
                     "rewards must be floats, one for each environment")
        found.expect(np.all(np.isfinite(rewards)), "rewards must be finite")
        for name, flags in (("terminated", terminated), ("truncated", truncated)):
            found.expect(flags.shape == (env.num_envs,) and flags.dtype == np.bool_,
                         f"{name} must be bools, one for each environment")
        found.expect(isinstance(info, dict), "info must be a dict")
        ended = terminated | truncated
        episodes += int(ended.sum())
        if mode == "NextStep" and before.any():
            found.expect(np.all(rewards[before] == 0), "NextStep: the step that resets has the reward 0")
            found.expect(not ended[before].any(), "NextStep: the step that resets ends no episode")
        if mode == "SameStep" and ended.any():
            if found.expect("final_obs" in info and "_final_obs" in info,
                            "SameStep: info must have final_obs and _final_obs"):
                found.expect(np.array_equal(info["_final_obs"], ended), "SameStep: _final_obs must mark what has ended")
                for place in range(env.num_envs):
                    final = info["final_obs"][place]
                    found.expect((final is not None) == bool(ended[place]),
                                 "SameStep: final_obs holds an observation exactly where an episode has ended")
                    if final is not None:
                        single = _parts(env.single_observation_space)
                        found.expect({name: np.shape(part) for name, part in _parts(final).items()} ==
                                     {name: space.shape for name, space in single.items()},
                                     "SameStep: a final observation has the shape of the single space")
        if kept is not None:
            found.expect(_equal(kept[0], kept[1]), "observations that were returned must not change later")
        kept = (seen, _copy(seen))
    found.expect(episodes > 0, f"no episode ended in {steps} steps, so the rules of autoreset were not tested")


def _check_masks(env: Any, found: _Findings) -> None:
    if _mode(env) != "Disabled":
        return
    env.reset(seed=1)
    wrong = {
        "integers": np.ones(env.num_envs, int),
        "a list": [True] * env.num_envs,
        "another length": np.ones(env.num_envs + 1, bool),
        "no True": np.zeros(env.num_envs, bool),
    }
    for kind, mask in wrong.items():
        found.expect(_refuses(lambda: env.reset(options={"reset_mask": mask}), (TypeError, ValueError, AssertionError)),
                     f"Disabled: a mask of {kind} must be refused")


def check(make: Callable[[], Any], steps: int = 200) -> list[str]:
    """What environments from make() break; empty if nothing. Episodes should end within `steps`."""
    found = _Findings()
    env = make()
    if _check_attributes(env, found):
        _check_seeds(env, found)
        _check_steps(env, steps, found)
        _check_masks(env, found)
    env.close()
    return found.lines
