# What a plan records, read from Python. SPDX-License-Identifier: Apache-2.0
import pickle

import numpy as np
import pytest
from conftest import gripper_model

import lockstep as ls
from lockstep.vector import VectorEnv

EFFORTS = ("drive_effort", "drive_effort_peak", "drive_effort_mean")
ACCELERATIONS = ("joint_acceleration", "link_acceleration", "site_acceleration", "joint_wrench")


def test_records_are_kept_where_the_plan_declares_them():
    model = gripper_model()
    bare = ls.compile(model).batch(2)
    for names, option in ((EFFORTS, "record_efforts"), (ACCELERATIONS, "record_accelerations"),
                          (("contact_time", "contact_first_touch"), "record_contacts")):
        for name in names:
            with pytest.raises(ls.UsageError, match=option):
                bare.read(name)
    plan = ls.compile(model, record_efforts=True, record_accelerations=True, record_contacts=True)
    assert all(plan.settings[name] for name in ("record_efforts", "record_accelerations", "record_contacts"))
    batch = plan.batch(3, threads=1)
    rows = [batch.read(name).shape[1] for name in EFFORTS + ACCELERATIONS]
    assert rows == [plan.nv] * 4 + [6 * len(model.links), 6 * len(model.sites), 6 * plan.nv]


def effort(env):
    return np.square(env.batch.read("drive_effort_mean")).sum(axis=1)


def test_a_servo_applies_what_it_says_in_rewards_too():
    model = gripper_model()
    plan = ls.compile(model, integrator="euler", record_efforts=True, record_accelerations=True)
    env = VectorEnv(plan, 4, limit=20, decimation=5, reward={"effort": (-1.0, effort)},
                    observe={"policy": {"effort": "drive_effort", "qdd": "joint_acceleration"}})
    env.reset(seed=1)
    actions = np.random.default_rng(2).uniform(-1, 1, env.action_space.shape).astype(np.float32)
    seen, paid, *_ = env.step(actions)
    batch, yaw = env.batch, plan.dof("shoulder_yaw")
    before = batch.qd[:, yaw].copy(), batch.q[:, yaw].copy()
    batch.step()
    servo = 60 * (batch.q_target[:, yaw] - before[1] - plan.dt * batch.qd[:, yaw]) - 6 * batch.qd[:, yaw]
    most = model.joints["shoulder_yaw"].effort_limit
    assert (np.abs(servo) > most).any() and (np.abs(servo) < most).any()
    applied = batch.read("drive_effort")[:, yaw]
    assert np.allclose(applied, np.clip(servo, -most, most), rtol=1e-3, atol=1e-3)  # implicit, as euler has it
    assert np.allclose(batch.read("joint_acceleration")[:, yaw], (batch.qd[:, yaw] - before[0]) / plan.dt, atol=1e-2)
    assert (paid < 0).all() and seen.shape == (4, 2 * plan.nv)
    again = pickle.loads(pickle.dumps(env))
    assert np.array_equal(again.batch.read("drive_effort_peak"), env.batch.read("drive_effort_peak"))
