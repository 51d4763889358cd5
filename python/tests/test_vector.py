# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from conftest import gripper_model

import lockstep as ls
from lockstep.conformance import check
from lockstep.vector import VectorEnv

MODES = ["NextStep", "SameStep", "Disabled"]
plan = ls.compile(gripper_model(), vary=["gear_ratio", "mass", "offset"])
QUERIES = ["q", ls.Query("qd", scale=0.1), ls.Query("site_position", ["tip"])]


def randomize(env, which):
    env.batch.randomize("gear_ratio", "scale", 0.9, 1.1, which=which)
    env.batch.randomize("mass", "scale", 0.8, 1.2, which=which)


def make(num_envs=7, **options):
    given = dict(observe=QUERIES, randomize=randomize, limit=13, seed=5, threads=1,
                 reward=lambda env: env.batch.q[:, 0], terminate=lambda env: env.batch.q[:, 2] > 1.1)
    return VectorEnv(plan, num_envs, **{**given, **options})


def episodes(env, steps=40, seed=5):
    """By environment id: the observations of all its episodes in turn, without repeats by the autoreset mode."""
    seen, info = env.reset(seed=seed)
    mode = env.autoreset_mode.value
    ids = env.batch.env_id.tolist()
    told = {i: [seen[place].tobytes()] for place, i in enumerate(ids)}
    wanted = max(ids) + 1
    random = np.random.default_rng(1)
    actions = random.uniform(-1, 1, (wanted, 4000, 4)).astype(np.float32)
    taken = dict.fromkeys(ids, 0)
    restarting = np.zeros(len(ids), bool)
    while min(len(v) for v in told.values()) < steps:
        if mode == "Disabled" and restarting.any():
            seen = env.reset(options={"reset_mask": restarting})[0]
            for place in np.flatnonzero(restarting):
                told[ids[place]].append(seen[place].tobytes())
            restarting[:] = False
        given = np.array([actions[i, taken[i]] for i in ids])
        before = restarting.copy() if mode == "NextStep" else np.zeros(len(ids), bool)
        seen, _, terminated, truncated, info = env.step(given)
        ended = terminated | truncated
        for place, i in enumerate(ids):
            if not before[place]:
                taken[i] += 1
            if mode == "SameStep" and ended[place]:
                told[i].append(info["final_obs"][place].tobytes())
            told[i].append(seen[place].tobytes())
        restarting = ended
    return {i: v[:steps] for i, v in told.items()}


def test_an_environment_sees_the_same_whatever_is_around_it():
    expected = episodes(make(num_envs=12, autoreset_mode="NextStep"))
    assert len({v[0] for v in expected.values()}) == 12
    for mode in MODES:
        assert episodes(make(num_envs=12, autoreset_mode=mode)) == expected
    for threads in (2, 3, 5):
        assert episodes(make(num_envs=12, threads=threads)) == expected
    for num_envs, first in ((1, 4), (7, 3)):
        told = episodes(make(num_envs=num_envs, first_id=first))
        assert told == {i: expected[i] for i in told}
    shuffled = make(num_envs=12)
    shuffled.batch.env_id[:] = np.random.default_rng(0).permutation(12)
    assert episodes(shuffled) == expected
    poisoned = make(num_envs=12)
    honest = poisoned.advance

    def advance(actions):
        poisoned.batch.q[5] = np.nan
        honest(actions)

    poisoned.advance = advance
    told = episodes(poisoned)
    assert all(told[i] == expected[i] for i in range(12) if i != 5)
    assert told[5] != expected[5]


def test_many_environments_see_what_few_do():
    few, many = make(num_envs=3), make(num_envs=4096, threads=2)
    a, b = few.reset(seed=9)[0], many.reset(seed=9)[0]
    assert np.array_equal(a, b[:3])
    actions = np.random.default_rng(2).uniform(-1, 1, (4096, 4)).astype(np.float32)
    for _ in range(20):
        a, b = few.step(actions[:3])[0], many.step(actions)[0]
        assert np.array_equal(a, b[:3])


@pytest.mark.parametrize("mode", MODES)
def test_the_rules_of_vector_environments(mode):
    assert check(lambda: make(autoreset_mode=mode)) == []
    groups = {"policy": {"q": "q"}, "critic": {"qd": "qd", "q": "q"}}
    assert check(lambda: make(autoreset_mode=mode, observe=groups)) == []
    assert any("must not change" in line for line in check(lambda: make(autoreset_mode=mode, observe=groups, copy=False)))


class Broken(VectorEnv):
    wrong = ""

    def reset(self, *, seed=None, options=None):
        if self.wrong == "ignores seeds":
            seed = None
        if self.wrong == "resets all" and options:
            options = None
        if self.wrong == "takes any mask" and options:
            options = {"reset_mask": np.ones(self.num_envs, bool)}
        return super().reset(seed=seed, options=options)

    def step(self, actions):
        seen, rewards, terminated, truncated, info = super().step(actions)
        if self.wrong == "doubles":
            seen = seen.astype(np.float64)
        if self.wrong == "pays for resets":
            rewards = rewards + 1
        if self.wrong == "integers":
            terminated = terminated.astype(int)
        if self.wrong == "forgets":
            info.pop("final_obs", None)
        return seen, rewards, terminated, truncated, info


@pytest.mark.parametrize(
    "wrong, mode, words",
    [
        ("ignores seeds", "NextStep", "same seed"),
        ("resets all", "Disabled", "leave the others alone"),
        ("takes any mask", "Disabled", "must be refused"),
        ("doubles", "NextStep", "dtype"),
        ("pays for resets", "NextStep", "reward 0"),
        ("integers", "NextStep", "terminated must be bools"),
        ("forgets", "SameStep", "final_obs"),
    ],
)
def test_the_checker_finds_what_is_broken(wrong, mode, words):
    def broken():
        env = Broken(plan, 7, observe=QUERIES, randomize=randomize, limit=13, threads=1, autoreset_mode=mode,
                     terminate=lambda env: env.batch.q[:, 2] > 0.5)
        env.wrong = wrong
        return env

    assert any(words in line for line in check(broken)), check(broken)


def test_shared_observations_are_found():
    assert any("must not change" in line for line in check(lambda: make(copy=False)))


def test_faults_end_episodes_with_finite_numbers():
    env = make(autoreset_mode="SameStep")
    env.reset(seed=1)
    env.batch.effort[3] = np.inf
    seen, rewards, terminated, _, info = env.step(np.zeros((7, 4), np.float32))
    assert terminated.tolist() == [False] * 3 + [True] + [False] * 3
    assert info["final_info"]["fault"][3] != 0 and info["final_info"]["fault"].dtype == np.uint8
    assert np.isfinite(seen).all() and np.isfinite(rewards).all() and not env.batch.fault.any()


def test_wrong_calls():
    env = make()
    with pytest.raises(RuntimeError, match="reset"):
        env.step(np.zeros((7, 4)))
    env.reset()
    with pytest.raises(ValueError, match="shape"):
        env.step(np.zeros((7, 3)))
    for wrong in ({"autoreset_mode": "Sometimes"}, {"action_kind": "torque"}, {"spread": 2.0}, {"limit": 0},
                  {"decimation": 0}, {"observe": lambda env: env.batch.rows.q}):
        with pytest.raises(ValueError):
            make(**wrong)
    for seed in (-1, 1 << 64, [1] * 6, [1.5] * 7, [4, "x", 6, 7, 8, 9, 10]):
        with pytest.raises((ValueError, TypeError)):
            env.reset(seed=seed)
    assert set(env.batch.seed) == {5}
    for rule in ("reward", "terminate"):
        wide = make(**{rule: lambda env: env.batch.q[:, :1]})
        wide.reset()
        with pytest.raises(ValueError, match=rule):
            wide.step(np.zeros((7, 4)))
    env.close()
    with pytest.raises(RuntimeError, match="close"):
        env.step(np.zeros((7, 4)))


def test_every_kind_of_action():
    for kind in ("position", "position_change", "velocity", "effort"):
        env = make(action_kind=kind)
        env.reset()
        assert env.action_space.contains(env.action_space.sample())
        env.step(env.action_space.sample())
        assert not env.batch.fault.any()


def test_the_seed_of_the_constructor_is_that_of_a_reset():
    assert np.array_equal(make(seed=3).reset()[0], make(seed=4).reset(seed=3)[0])


def test_the_checker_needs_episodes():
    assert any("no episode ended" in line for line in check(lambda: make(limit=None, terminate=None)))


def test_the_form_of_rsl_rl():
    torch = pytest.importorskip("torch")
    from lockstep.vector import RslRlEnv

    env = RslRlEnv(make(autoreset_mode="SameStep"))
    assert env.get_observations().shape == (7, env.env.single_observation_space.shape[0])
    env.episode_length_buf = torch.randint(0, 13, (7,))
    for _ in range(15):
        seen, rewards, dones, extras = env.step(torch.zeros(7, 4))
    assert rewards.shape == dones.shape == extras["time_outs"].shape == (7,)
