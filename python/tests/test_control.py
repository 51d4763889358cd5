# SPDX-License-Identifier: Apache-2.0
import pathlib
import re

import numpy as np
import pytest
from conftest import VARIED, gripper_model

import lockstep as ls


def test_draws_depend_on_seed_id_and_episode_alone(plan):
    one, many = plan.batch(1, seed=3, first_id=100), plan.batch(50, seed=3, first_id=90)
    assert np.array_equal(one.draw(48)[0], many.draw(48)[10])
    assert not np.array_equal(one.draw(48), one.draw(48, stream=1))
    before = one.draw(48)
    one.reset()
    assert one.episode[0] == 1 and not np.array_equal(one.draw(48), before)
    one.episode[0] = 0
    assert np.array_equal(one.draw(48), before)
    one.seed[0] = 4
    assert not np.array_equal(one.draw(48), before)
    assert many.draw(3, which=[7, 8]).shape == (2, 3)
    numbers = plan.batch(2000, seed=1).draw(100)
    assert 0 <= numbers.min() and numbers.max() < 1 and abs(numbers.mean() - 0.5) < 2e-3
    normal = plan.batch(2000, seed=1).normal(100)
    assert abs(normal.mean()) < 1e-2 and abs(normal.std() - 1) < 1e-2


def test_randomize_starts_from_the_compiled_values(batch):
    compiled = batch.parameter("mass").copy()
    for _ in range(3):
        batch.randomize("mass", "scale", 0.5, 2.0, distribution="log_uniform")
    factors = batch.parameter("mass")[:, 1:] / compiled[:, 1:]
    assert 0.5 <= factors.min() < 0.8 < 1.5 < factors.max() <= 2.0
    batch.randomize("mass", "scale", 1, 1)
    assert np.array_equal(batch.parameter("mass"), compiled)
    batch.randomize("mass", "scale", 1.5, 1.5, which=[2], rows=["palm"])
    changed = batch.parameter("mass") != compiled
    assert changed.sum() == 1 and changed[2, batch.plan.parameter_rows("mass").index("palm")]
    batch.randomize("mass", "scale", 2, 2, rows=[])
    assert (batch.parameter("mass") != compiled).sum() == 1
    batch.randomize("gear_ratio", "scale", 0.9, 1.1, shared=True)
    scales = batch.parameter("gear_ratio") / batch.plan.batch(1).parameter("gear_ratio")
    assert np.allclose(scales, scales[:, :1]) and len(np.unique(scales[:, 0])) == 9


def test_impossible_values_are_refused_before_anything_changes(batch):
    compiled = batch.parameter("mass").copy()
    for wrong in (
        lambda: batch.randomize("mass", "scale", -1.0, 1.0),
        lambda: batch.randomize("gear_ratio", "absolute", 0.0, 0.0),
        lambda: batch.randomize("mass", "scale", 2.0, 1.0),
        lambda: batch.randomize("mass", "scale", np.nan, 1.0),
        lambda: batch.randomize("mass", "times", 1.0, 2.0),
        lambda: batch.randomize("mass", "scale", 1.0, 2.0, rows=["nothing"]),
        lambda: batch.randomize("mass", "scale", 1.0, 2.0, rows=[1000]),
        lambda: batch.randomize("mass", "scale", 1.0, 2.0, distribution="cauchy"),
        lambda: batch.randomize("damping", "scale", 1.0, 2.0),
        lambda: batch.draw(3, stream=1 << 15),
    ):
        with pytest.raises(ls.UsageError):
            wrong()
    assert np.array_equal(batch.parameter("mass"), compiled)


def test_random_resets_stay_in_their_ranges(plan):
    batch = plan.batch(500, seed=2)
    assert batch.reset_random(spread=0.5, speed=0.3) == []
    driven = [plan.dof(name) for name in plan.driven_dofs]
    low, high = plan.limits[driven].T
    start = np.array([plan.model.joints[name].position for name in plan.driven_dofs])
    least, most = start + 0.5 * (low - start), start + 0.5 * (high - start)  # half of the way to each end
    share = (batch.q[:, driven] - least) / (most - least)
    assert -1e-6 <= share.min() < 0.02 and 0.98 < share.max() <= 1 + 1e-6
    assert 0.29 < np.abs(batch.qd[:, driven]).max() <= 0.3
    assert np.abs(batch.coupling_error()).max() < 1e-6


def test_actions_are_shares_of_ranges(plan, batch):
    driven = [plan.dof(name) for name in plan.driven_dofs]
    actions = np.zeros((9, 4))
    actions[0], actions[1], actions[2] = 1, -1, 5  # clipped
    actions[3, 1] = np.nan
    batch.q_target[3] = 0.25
    batch.act(actions)
    low, high = plan.limits[driven].T
    assert np.allclose(batch.q_target[0, driven], high) and np.allclose(batch.q_target[1, driven], low)
    assert np.array_equal(batch.q_target[2], batch.q_target[0])
    assert np.allclose(batch.q_target[4, driven], (low + high) / 2)
    assert np.all(batch.q_target[3] == 0.25)
    assert batch.fault_report(3)["fault"] == "bad_input" and np.count_nonzero(batch.fault) == 1
    followers = [plan.dof(name) for name in plan.followers]
    assert not batch.q_target[:3, followers].any()
    with pytest.raises(ls.UsageError, match="shape"):
        batch.act(np.zeros((9, 9)))
    with pytest.raises(ls.UsageError, match="kind"):
        batch.act(actions, "torque")
    batch.reset()
    batch.act(np.full((9, 4), 0.5), "position", low=[0, 0, 0, 0], high=[0.4] * 4)
    assert np.allclose(batch.q_target[:, driven], 0.3)
    batch.act(np.full((9, 4), 0.5), "effort", low=[-2] * 4, high=[2] * 4)
    assert np.allclose(batch.effort[:, driven], 1.0)


def test_actions_scale_about_the_pose_average_and_take_some_joints(plan, batch):
    driven = [plan.dof(name) for name in plan.driven_dofs]
    start = np.array([plan.model.joints[name].position for name in plan.driven_dofs])
    batch.act(np.full((9, 4), 0.5), scale=0.2)
    assert np.allclose(batch.q_target[:, driven], start + 0.1, atol=1e-6)
    batch.act(np.ones((9, 4)), scale=[0.2] * 4, center=1.0, alpha=0.25)
    assert np.allclose(batch.q_target[:, driven], 0.75 * (start + 0.1) + 0.25 * 1.2, atol=1e-6)
    before = batch.q_target.copy()
    batch.act(np.ones((9, 2)), joints=["elbow", "shoulder_yaw"], low=[0, 0], high=[0.3, 0.4])
    assert np.allclose(batch.q_target[:, plan.dof("elbow")], 0.3)
    assert np.allclose(batch.q_target[:, plan.dof("shoulder_yaw")], 0.4)
    rest = [plan.dof(name) for name in ("shoulder_pitch", "knuckle")]
    assert np.array_equal(batch.q_target[:, rest], before[:, rest])
    follower = next(iter(plan.followers))
    for wrong, kind in (
        ({"joints": [follower]}, ls.UsageError),
        ({"joints": ["elbow", "elbow"]}, ls.UsageError),
        ({"joints": "elbow"}, TypeError),
        ({"alpha": 0.0}, ls.UsageError),
        ({"center": 1.0}, ls.UsageError),
        ({"scale": [1.0]}, ls.UsageError),
    ):
        count = len(wrong["joints"]) if isinstance(wrong.get("joints"), list) else 4
        with pytest.raises(kind):
            batch.act(np.zeros((9, count)), **wrong)


def test_the_drive_of_a_follower_is_an_action():
    model = gripper_model()
    follower = next(iter(ls.compile(model).followers))
    model.joints["knuckle"].drive = ls.Drive()
    model.joints[follower].drive = ls.Drive(kp=8, kd=0.3)
    plan = ls.compile(model)
    assert follower in plan.driven_dofs and "knuckle" not in plan.driven_dofs
    batch = plan.batch(2)
    batch.act(np.array([[0, 0, 0, -0.5], [0, 0, 0, 0.5]]) if plan.driven_dofs[3] == follower else np.zeros((2, 4)))
    batch.step(2000)
    at = plan.dof(follower)
    assert np.allclose(batch.q[:, at], batch.q_target[:, at], atol=0.02) and np.ptp(batch.q[:, at]) > 0.1


def test_a_function_is_called_before_each_step(plan, batch):
    other, calls = plan.batch(9, threads=1, seed=7), []

    def push(i):
        calls.append(i)
        batch.effort[:, 0] = 0.1 * i - batch.qd[:, 0]

    batch.step(4, before=push)
    for i in range(4):
        other.effort[:, 0] = 0.1 * i - other.qd[:, 0]
        other.step()
    assert calls == [0, 1, 2, 3] and np.array_equal(batch.q, other.q) and np.array_equal(batch.qd, other.qd)

    def fail(i):
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        batch.step(4, before=fail)
    batch.step()
    assert np.all(batch.steps == 5)
    with pytest.raises(TypeError):
        batch.step(1, before=3)


def test_read_packs_quantities_side_by_side(plan, batch):
    batch.q_target[:, :4] = 0.3
    batch.step(20)
    queries = ("q", ls.Query("qd", ["elbow"], 0.5), ls.Query("site_pose", ["tip"]), "coupling_error", "kinetic_energy")
    seen = batch.read(*queries)
    assert seen.shape == (9, 9 + 1 + 7 + 5 + 1) and seen.flags.c_contiguous and seen.dtype == np.float32
    assert np.array_equal(seen[:, :9], batch.q)
    assert np.array_equal(seen[:, 9], batch.qd[:, plan.dof("elbow")] * np.float32(0.5))
    assert np.array_equal(seen[:, 10:13], batch.read(ls.Query("site_position", ["tip"])))
    assert np.allclose(np.linalg.norm(seen[:, 13:17], axis=1), 1, atol=1e-6)
    out = np.zeros_like(seen)
    assert batch.read(*queries, out=out) is out and np.array_equal(out, seen)
    for wrong, kind in ((np.zeros((9, 3), np.float32), ls.UsageError), (np.zeros((9, 23)), TypeError)):
        with pytest.raises(kind):
            batch.read(*queries, out=wrong)
    with pytest.raises(ls.UsageError):
        batch.read("speed")
    assert batch.read(ls.Query("q", [])).shape == (9, 0)
    for wrong, kind in (
        (lambda: batch.read(["q", "qd"]), TypeError),
        (lambda: batch.read(ls.Query("kinetic_energy", ["elbow"])), ls.UsageError),
        (lambda: batch.read(ls.Query("root_pose", ["base"])), ls.UsageError),
        (lambda: batch.read("q", out=batch.q), ls.UsageError),
        (lambda: batch.act(np.zeros((9, 4)), low=-1.0, high=1.0), TypeError),
    ):
        with pytest.raises(kind):
            wrong()
    batch.q_target[:, :4] = [0.1, 0.2, 0.3, 0.4]
    batch.act(batch.q_target[:, 3::-1], low=[-1] * 4, high=[1] * 4)  # of its own memory
    assert np.allclose(batch.q_target[:, :4], [0.4, 0.3, 0.2, 0.1])
    jacobian = batch.site_jacobian("tip")
    assert jacobian.shape == (9, 6, 9)
    # the site's velocity is the Jacobian times qd
    velocity = np.einsum("nij,nj->ni", jacobian, batch.qd)
    assert np.allclose(velocity, batch.read(ls.Query("site_velocity", ["tip"])), atol=1e-5)


def test_saved_environments_go_on_with_the_same_bits(plan):
    a = plan.batch(9, seed=7, threads=1)
    a.randomize("gear_ratio", "scale", 0.9, 1.1)
    a.reset_random(speed=0.5)
    a.q[4] = np.nan
    a.step(10)
    blob = a.save()
    b, c = plan.batch(9, threads=2), plan.batch(20, threads=1)
    b.restore(blob)
    c.restore(blob, into=[17, 3], rows=[2, 4])
    for batch in (a, b, c):
        batch.step(50)
    assert np.array_equal(a.q, b.q, equal_nan=True) and np.array_equal(a.fault, b.fault) and a.fault[4] != 0
    assert np.array_equal(a.q[2], c.q[17]) and c.fault[3] == a.fault[4]
    a.reset_random([2])
    b.reset_random([2])
    assert np.array_equal(a.q[2], b.q[2])
    with pytest.raises(TypeError):
        b.restore(blob, into=[0, 1], rows=[True, False])
    with pytest.raises(ls.UsageError):
        b.restore(blob, into=[0, 1], rows=[])
    damaged = bytearray(blob)
    damaged[len(blob) // 2] ^= 1
    for wrong in (bytes(damaged), blob[:-1], blob + b"x", b""):
        with pytest.raises(ls.UsageError):
            b.restore(wrong)


def test_check_names_impossible_values(batch):
    assert batch.check() == []
    batch.parameter("mass")[3, 1] = -1
    problems = batch.check()
    assert [p[0] for p in problems] == [3] and problems[0][1] == "mass"
    assert batch.check([0, 1]) == []


def test_the_example_of_the_readme(monkeypatch):
    root = pathlib.Path(__file__).parents[2]
    program = re.search(r"```python\n(.*?)```", (root / "README.md").read_text(), re.DOTALL).group(1)
    assert len(program.splitlines()) <= 16
    monkeypatch.chdir(root)
    names = {}
    exec(program, names)
    batch = names["batch"]
    assert batch.num_envs == 4096 and not batch.fault.any() and batch.episode.min() >= 5
    assert np.abs(batch.coupling_error()).max() < 1e-6


def test_late_drives_and_motors_differ_between_environments():
    model = gripper_model()
    drive = ls.Drive(kp=8.0, kd=0.3, delay=3, lag=0.01, stall_effort=4.0, no_load_speed=9.0)
    model.joints["knuckle"].drive, model.joints["knuckle"].effort_limit = drive, 3.0
    plan = ls.compile(model, vary=["drive_delay", "drive_lag", "motor_curve"])
    assert plan.model.joints["knuckle"].drive == drive
    batch, held, row = plan.batch(4), plan.batch(4), plan.dof("knuckle")
    batch.parameter("drive_delay")[:, row] = [0, 1, 2, 3]
    batch.q_target[:, row] = 0.3
    for step in range(4):
        batch.step(), held.step()
        moved = batch.qd[:, row] != held.qd[:, row]
        assert moved.tolist() == [step >= delay for delay in range(4)]
    batch.parameter("drive_delay")[1, row] = 0.5
    batch.step()
    assert batch.fault[1] != 0 and "whole number of steps" in batch.explain_fault(1)
    model.joints["knuckle"].drive.delay = -1
    with pytest.raises(ls.Error, match="delay"):
        ls.compile(model)
