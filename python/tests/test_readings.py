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
    assert plan.settings["record_efforts"] and plan.settings["record_accelerations"] and plan.settings["record_contacts"]
    batch = plan.batch(3, threads=1)
    rows = [batch.read(name).shape[1] for name in EFFORTS + ACCELERATIONS]
    assert rows == [plan.nv] * 4 + [6 * len(plan.links), 6 * len(plan.sites), 6 * plan.nv]


def test_a_servo_applies_what_it_says_in_rewards_too():
    plan = ls.compile(gripper_model(), integrator="euler", record_efforts=True, record_accelerations=True)
    env = VectorEnv(plan, 4, limit=20, substeps=5, observe={"policy": {"effort": "drive_effort", "qdd": "joint_acceleration"}},
                    reward={"effort": (-1.0, lambda env: np.square(env.batch.read("drive_effort_mean")).sum(axis=1))})
    env.reset(seed=1)
    actions = np.random.default_rng(2).uniform(-1, 1, env.action_space.shape).astype(np.float32)
    seen, paid, *_ = env.step(actions)
    batch, yaw = env.batch, plan.dof("shoulder_yaw")
    before = batch.qd[:, yaw].copy(), batch.q[:, yaw].copy()
    batch.step()
    servo = 60 * (batch.q_target[:, yaw] - before[1] - plan.dt * batch.qd[:, yaw]) - 6 * batch.qd[:, yaw]
    assert np.allclose(batch.read("drive_effort")[:, yaw], servo, rtol=1e-3, atol=1e-3)  # implicit, as euler has it
    assert np.allclose(batch.read("joint_acceleration")[:, yaw], (batch.qd[:, yaw] - before[0]) / plan.dt, atol=1e-2)
    assert (paid < 0).all() and seen.shape == (4, 2 * plan.nv)
    again = pickle.loads(pickle.dumps(env))
    assert np.array_equal(again.batch.read("drive_effort_peak"), env.batch.read("drive_effort_peak"))
