# Observations in groups, rewards, ends, events, and the forms of trainers. SPDX-License-Identifier: Apache-2.0
import copy
import pickle

import numpy as np
import pytest
from conftest import gripper_model

import lockstep as ls
from lockstep.draws import OWN, normal, uniform
from lockstep.events import Event
from lockstep.observations import Group, Normal, Observations, Term, Uniform
from lockstep.stable_baselines3 import Sb3VecEnv
from lockstep.vector import RslRlEnv, VectorEnv

plan = ls.compile(gripper_model(), vary=["mass"])
GROUPS = {
    "policy": Group({"q": Term("q", noise=Uniform(-0.01, 0.01)), "qd": Term(ls.Query("qd", scale=0.1), clip=(-1, 1)),
                     "height": lambda env: env.batch.q[:, 0], "one": 1.0}, history=3),
    "critic": {"q": "q", "noisy": Term("q", noise=Normal(0.02))},
}


def first(env):
    return env.batch.q[:, 0]


def low(env):
    return env.batch.q[:, 1] < -0.9


def touch(env, which):
    env.touched += which


class Task(VectorEnv):
    def __init__(self, num_envs=5, **options):
        self.touched = np.zeros(num_envs, int)
        given = dict(observe=GROUPS, reward={"a": (2.0, first), "b": (-1.0, first)}, terminate={"low": low}, limit=9,
                     seed=3, threads=1, autoreset_mode="SameStep",
                     events={"push": Event(touch, "interval", every=(0.05, 0.2))})
        super().__init__(plan, num_envs, **{**given, **options})


def roll(env, steps=20):
    env.reset()
    actions = np.random.default_rng(0).uniform(-1, 1, (steps, 64, 4)).astype(np.float32)[:, : env.num_envs]
    return [env.step(a) for a in actions]


def test_groups_do_not_depend_on_the_size_of_the_batch():
    for a, b in zip(roll(Task(3)), roll(Task(7))):
        for name in GROUPS:
            assert np.array_equal(a[0][name], b[0][name][:3])


def test_noise_history_clip_and_constants():
    env = Task(limit=None, terminate=None)
    seen = env.reset()[0]
    k = seen["policy"].shape[1] // 3
    n = len(plan.dof_names)
    frames = seen["policy"].reshape(5, 3, k)
    assert np.array_equal(frames[:, 0], frames[:, 2]) and np.all(frames[:, :, -1] == 1)
    difference = frames[:, 2, :n] - env.batch.q
    assert 0 < np.abs(difference).max() <= 0.0101 and np.unique(difference).size > n
    assert np.array_equal(seen["critic"][:, :n], env.batch.q)
    later = env.step(np.zeros((5, 4), np.float32))[0]["policy"].reshape(5, 3, k)
    assert np.array_equal(later[:, 1], frames[:, 2]) and not np.array_equal(later[:, 2], frames[:, 2])
    assert np.abs(frames[:, :, n : 2 * n]).max() <= 1
    many = Observations({"x": {"z": Term(np.zeros(50), noise=Normal(2.0))}})(plan_batch())["x"]
    assert abs(many.mean()) < 0.05 and abs(many.std() - 2) < 0.05


class plan_batch:
    def __init__(self):
        self.batch = plan.batch(400, threads=1)


def test_terms_add_up_and_the_log_is_their_mean():
    env, total = Task(limit=4, terminate=None), np.zeros(5)
    results = roll(env, 4)
    for result in results:
        total += result[1]
    info = results[-1][4]
    assert info["log"]["reward/total"] == pytest.approx(total.mean(), rel=1e-5)
    assert info["log"]["reward/a"] == pytest.approx(-2 * info["log"]["reward/b"], rel=1e-5)
    assert info["log"]["episode/length"] == 4 and info["log"]["end/time_out"] == 1
    assert info["final_info"]["reason"].tolist() == ["time_out"] * 5


def test_draws_follow_their_formula():
    """(M143), in Python's integers"""
    word, golden = (1 << 64) - 1, 0x9E3779B97F4A7C15

    def mix(x):
        for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB), (31, 1)):
            x = (x ^ x >> shift) * factor & word
        return x

    batch = plan.batch(3, seed=2**63 + 5, first_id=7)
    batch.episode[1] = 9
    batch.step(2)
    drawn = uniform(batch, np.empty((5, 3)))
    for e in range(3):
        x = mix(int(batch.seed[e]) + golden & word)
        for part in (batch.env_id[e], batch.episode[e], batch.steps[e], OWN):
            x = mix(x + golden + int(part) & word)
        for row in range(5):
            numbers = mix(x + golden * (row // 2 + 1) & word)
            assert drawn[row, e] == (numbers >> (40 if row % 2 else 8) & 0xFFFFFF) / 2**24
    assert np.array_equal(uniform(batch, np.empty((2, 3), np.float32)), uniform(batch, np.empty((2, 3))))
    with pytest.raises(ls.UsageError, match="has 4 columns"):
        uniform(batch, np.empty((2, 4)))
    with pytest.raises(TypeError):
        uniform(batch, np.empty((2, 3), int))


def test_intervals_differ_and_repeat():
    a, b = Task(40, limit=None, terminate=None), Task(8, limit=None, terminate=None)
    roll(a, 60), roll(b, 60)
    assert np.array_equal(a.touched[:8], b.touched) and len(set(a.touched)) > 1 and a.touched.min() > 0


def test_draws_of_a_row_do_not_depend_on_how_many_are_asked_for():
    batch = plan.batch(3, seed=4)
    for draw in (uniform, normal):
        few, many = draw(batch, np.empty((2, 3))), draw(batch, np.empty((5, 3)))
        assert np.array_equal(few, many[:2]) and np.array_equal(draw(batch, np.empty((3, 3))), many[:3])
    drawn = normal(plan.batch(4000, threads=1), np.empty((3, 4000)))
    assert np.abs(np.corrcoef(drawn) - np.eye(3)).max() < 0.06


def test_intervals_do_not_depend_on_lengths_that_a_trainer_sets():
    env = Task(limit=1000, terminate=None)
    env.reset()
    env.elapsed[:] = 900
    env.step(np.zeros((5, 4), np.float32))
    assert not env.touched.any()  # 0.05 s are three control steps


@pytest.mark.parametrize("moment", ["start", "randomize", "reset"])
def test_draws_of_events_do_not_depend_on_the_autoreset_mode(moment):
    def masses_of_episodes(mode):
        seen = []

        def draw(env, which):
            drawn = uniform(env.batch, np.empty((1, 2)))[0]
            seen.append([(place, drawn[place]) for place in np.flatnonzero(which)])

        env = Task(2, limit=3, terminate=None, autoreset_mode=mode, events={"draw": Event(draw, moment)})
        env.reset(seed=4)
        for _ in range(10):
            ended = np.logical_or(*env.step(np.zeros((2, 4), np.float32))[2:4])
            if mode == "Disabled" and ended.any():
                env.reset(options={"reset_mask": ended})
        return seen[:3]

    assert masses_of_episodes("NextStep") == masses_of_episodes("SameStep") == masses_of_episodes("Disabled")


def test_a_history_begins_anew_with_another_seed():
    env, fresh = Task(), Task()
    env.reset(seed=1)
    assert np.array_equal(env.reset(seed=2)[0]["policy"], fresh.reset(seed=2)[0]["policy"])


def test_observations_belong_to_one_environment():
    shared = Observations({"policy": Group({"q": "q"}, history=2)})
    one = Task(observe=shared)
    with pytest.raises(ls.UsageError, match="belong to another environment"):
        Task(observe=shared)
    one.reset()
    assert copy.deepcopy(one).step(np.zeros((5, 4), np.float32))[0].shape == (5, 2 * len(plan.dof_names))
    del one
    Task(7, observe=shared).reset()  # once the other is gone


def test_bounds_are_rounded_as_what_they_bound():
    env = VectorEnv(plan, 3, observe={"policy": {"q": Term(np.full(2, 9.0), clip=(-3.14159, 3.14159), scale=0.01)}})
    assert env.observation_space.high[0, 0] == env.reset()[0][0, 0]


def test_a_copy_goes_on_with_the_same_bits():
    env = Task()
    roll(env, 6)
    other, third = copy.deepcopy(env), pickle.loads(pickle.dumps(Task(observe=("q",))))
    actions = np.full((5, 4), 0.3, np.float32)
    for _ in range(12):
        a, b = env.step(actions), other.step(actions)
        assert all(np.array_equal(a[0][name], b[0][name]) for name in GROUPS) and np.array_equal(a[1], b[1])
    assert third.reset()[0].shape == (5, len(plan.dof_names))


def test_the_form_of_stable_baselines3():
    with pytest.raises(ls.SettingsError, match="NextStep.*SameStep"):
        Sb3VecEnv(Task(autoreset_mode="NextStep"))
    with pytest.raises(ls.SettingsError, match="copy: is False"):
        Sb3VecEnv(Task(copy=False))
    env = Sb3VecEnv(Task(limit=3, terminate=None))
    assert env.seed(4) == [4] * 5 and set(env.reset()) == set(GROUPS)
    for _ in range(3):
        seen, rewards, dones, infos = env.step(np.zeros((5, 4), np.float32))
    assert dones.all() and all(i["TimeLimit.truncated"] and i["terminal_observation"]["critic"].ndim == 1 for i in infos)
    assert env.get_attr("limit", [1, 2]) == [3, 3]
    with pytest.raises(ls.UsageError, match="twice"):
        env.get_attr("limit", [1, 1])


def test_the_form_of_rsl_rl_for_efforts():
    torch = pytest.importorskip("torch")
    env = RslRlEnv(Task(action_kind="effort"))
    assert env.num_actions == len(plan.independent_dofs)
    env.step(torch.zeros(5, env.num_actions))


@pytest.mark.parametrize("wrong, words", [
    ({"observe": {"policy": {}}}, "policy.*no terms"), ({"observe": {"policy": Group({"q": "q"}, 0)}}, "history"),
    ({"observe": {"policy": {"x": lambda env: np.zeros(3)}}}, "policy.x.*shape"),
    ({"observe": {"policy": {"x": Term("q", noise=Uniform(1, 0))}}}, "policy.x.*noise"),
    ({"reward": {"a": first}}, "'a'.*weight"), ({"reward": {"a": (np.nan, first)}}, "'a'.*nan"),
    ({"terminate": {"a": 3}}, "'a'.*function"), ({"events": {"e": Event(touch, "never")}}, "'e'.*never"),
    ({"events": {"e": Event(touch, "interval")}}, "'e'.*every"),
    ({"reward": {"total": (1.0, first)}}, "'total'.*name"),
    ({"terminate": {"fault": low}}, "'fault'.*name"), ({"terminate": {"time_out": low}}, "'time_out'.*name"),
])
def test_bad_terms_are_named(wrong, words):
    with pytest.raises(ls.UsageError, match=words):
        Task(**wrong)


def test_names_that_every_environment_has_are_refused_when_they_are_returned():
    actions = np.zeros((5, 4), np.float32)
    for wrong, words in (({"terminate": lambda env: {"fault": low(env)}}, "'fault'"),
                         ({"reward": lambda env: {"total": first(env)}}, "'total'")):
        env = Task(**wrong)
        env.reset()
        with pytest.raises(ls.UsageError, match=words):
            env.step(actions)


def test_an_interval_may_be_longer_than_any_motion():
    happened = []
    env = Task(events={"never": Event(lambda env, which: happened.append(which), "interval", every=(1e30, 1e30))})
    env.reset()
    for _ in range(5):
        env.step(np.zeros((5, 4), np.float32))
    assert not happened


@pytest.mark.parametrize("wrong, kind", [({"limit": float("nan")}, TypeError), ({"limit": 2.5}, TypeError),
                                         ({"decimation": 2.5}, TypeError), ({"observe": []}, ValueError),
                                         ({"observe": "q"}, TypeError)])
def test_options_that_would_be_taken_for_others_are_refused(wrong, kind):
    with pytest.raises(kind):
        VectorEnv(plan, 3, **wrong)


def test_a_reset_knows_its_options():
    env = VectorEnv(plan, 3)
    with pytest.raises(ValueError, match="reset_masks"):
        env.reset(options={"reset_masks": np.ones(3, bool)})


def test_actions_take_the_options_of_act():
    joint = plan.driven_dofs[-1]
    env = VectorEnv(plan, 3, actions={"joints": [joint], "scale": 0.1, "center": 0.2}, spread=0.0)
    assert env.action_space.shape == (3, 1)
    env.reset()
    env.step(np.array([[-1], [0], [1]], np.float32))
    assert np.allclose(env.batch.q_target[:, plan.dof(joint)], [0.1, 0.2, 0.3])
    with pytest.raises(ValueError, match="unknown options.*'joint'"):
        VectorEnv(plan, 3, actions={"joint": [joint]})


def test_actions_with_a_scale_are_about_the_start():
    model = gripper_model()
    joint = plan.driven_dofs[-1]
    model.poses.append(ls.NamedPose("bent", {joint: 0.15}))
    there = ls.compile(model)
    for start, center in (("bent", 0.15), (ls.Start("bent", position=0.02), 0.15), ("", 0.0)):
        env = VectorEnv(there, 3, actions={"joints": [joint], "scale": 0.1}, start=start)
        env.reset()
        env.step(np.full((3, 1), 0.5, np.float32))
        assert np.allclose(env.batch.q_target[:, there.dof(joint)], center + 0.05, atol=1e-6)
    with pytest.raises(ls.UsageError, match="wing"):
        VectorEnv(there, 3, actions={"joints": ["wing"], "scale": 0.1})


def test_bad_actions_and_old_names():
    env = Task()
    env.reset()
    actions = np.zeros((5, 4), np.float32)
    actions[2, 1] = np.nan
    with pytest.raises(ls.UsageError, match="action 1 of environment 2"):
        env.step(actions)
    with pytest.raises(ls.UsageError, match="type"):
        env.step(np.full((5, 4), "a"))
    with pytest.raises(AttributeError, match="driven_dofs"):
        plan.driven
    with pytest.raises(ls.UsageError, match="absolute"):
        env.batch.randomize("mass", "abs", 1, 2)


def test_errors_have_the_words_of_python():
    with pytest.raises(ls.UsageError, match=r"Plan\.contact_names") as caught:
        plan.contact("none")
    assert "::" not in str(caught.value)
    with pytest.raises(ls.UsageError) as caught:
        plan.batch(1).parameter("gear_ratio")
    assert "compile(vary=...)" in str(caught.value)
