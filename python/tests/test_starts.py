# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

import lockstep as ls
from lockstep.vector import VectorEnv

TEXT = """<mujoco><option timestep="0.005"/><worldbody>
  <body name="trunk" pos="0 0 1"><freejoint/><geom size="0.1"/>
    <body name="leg" pos="0.1 0 0"><joint name="hip" range="-60 60" axis="0 1 0"/><geom size="0.05" pos="0 0 -0.2"/></body>
  </body></worldbody>
  <actuator><position joint="hip" kp="20"/></actuator>
  <keyframe><key name="home" qpos="0 0 0.5 1 0 0 0 0.25"/></keyframe></mujoco>"""


def plan():
    model = ls.from_mjcf_text(TEXT)
    model.poses.append(ls.NamedPose("high", {"hip": -0.5}, root_poses={"trunk": ls.pose((0, 0, 2))}))
    return ls.compile(model, dt=model.time_step)


def test_poses_of_files_and_of_code_are_starts():
    compiled = plan()
    assert compiled.poses == ["home", "high"] and compiled.dt == 0.005
    assert compiled.model.poses["high"].positions == {"hip": -0.5}
    batch = compiled.batch(4, threads=1, dtype="f8")
    assert batch.reset_to("home", [1]) == []
    assert batch.q[1, 0] == batch.q_target[1, 0] == 0.25 and batch.q[0, 0] == 0
    assert batch.root_pose[1, 2] == 0.5 and batch.root_pose[0, 2] == 1
    batch.reset_to(1)
    assert (batch.q_target == -0.5).all() and (batch.root_pose[:, 2] == 2).all()
    batch.reset_to()
    assert (batch.q == 0).all()


def test_noise_is_about_the_pose_and_the_same_for_any_batch():
    start = ls.Start("home", position=0.1, velocity=0.2, roots={"trunk": ls.RootNoise((0.5, 0.5, 0), yaw=3.0)})
    compiled = plan()
    many = compiled.batch(500, threads=1, dtype="f8", seed=3)
    one = compiled.batch(1, threads=1, dtype="f8", seed=3, first_id=77)
    many.reset_to(start)
    one.reset_to(start, [0])
    assert (many.q[77] == one.q[0]).all() and (many.root_pose[77] == one.root_pose[0]).all()
    assert abs(many.q - 0.25).max() <= 0.1 + 1e-12 and many.q.std() > 0.05
    assert (many.root_pose[:, 2] == 0.5).all() and many.root_pose[:, 0].std() > 0.25
    many.reset_random(spread=0)
    assert (many.q == 0).all(), "the model's own start"


def test_a_vector_environment_starts_in_a_pose_and_lets_a_function_go_on():
    seen = []

    def after_reset(env, which):
        seen.append((which.copy(), env.batch.q[which, 0].copy()))
        env.batch.qd[which] = 1.5

    env = VectorEnv(plan(), 3, start="home", after_reset=after_reset, limit=2, autoreset_mode="SameStep", threads=1)
    observations, _ = env.reset(seed=1)
    assert (seen[0][1] == 0.25).all() and (observations[:, 1] == 1.5).all()
    for _ in range(2):
        observations = env.step(np.zeros((3, 1)))[0]
    assert len(seen) == 2 and seen[1][0].all() and (observations[:, 0] == 0.25).all()
    with pytest.raises(ValueError, match="both"):
        VectorEnv(plan(), 3, start="home", spread=0.5)
    with pytest.raises(ls.UsageError, match="pose 'sit'"):
        VectorEnv(plan(), 3, start="sit").reset()


def test_one_state_is_copied_to_many():
    batch = plan().batch(5, threads=1, seed=2)
    batch.reset_random(speed=1.0)
    batch.q_target[3] = 0.5
    batch.copy_state(3, [0, 4])
    before = batch.q.copy()
    assert (before[0] == before[3]).all() and (before[4] == before[3]).all() and (before[1] != before[3]).all()
    assert batch.env_id.tolist() == [0, 1, 2, 3, 4]
    batch.step(20)
    assert (batch.q[0] == batch.q[3]).all() and (batch.root_pose[4] == batch.root_pose[3]).all()
    with pytest.raises(ls.UsageError):
        batch.copy_state(5)


def test_what_is_no_start_is_refused():
    batch = plan().batch(2, threads=1)
    for wrong in ("sit", 2, ls.Start("home", spread=2), ls.Start("home", position=-1),
                  ls.Start(roots={"leg": ls.RootNoise()}), ls.Start(roots=ls.RootNoise(yaw=4))):
        with pytest.raises(ls.UsageError):
            batch.reset_to(wrong)
    for wrong in (1.5, None, ls.Start(roots={"trunk": ls.RootNoise((1, 2))}), ls.Start(roots=3)):
        with pytest.raises(TypeError):
            batch.reset_to(wrong)
    model = ls.from_mjcf_text(TEXT)
    for pose in (ls.NamedPose("home"), ls.NamedPose("a", {"knee": 1}), ls.NamedPose("a", {"hip": float("nan")}),
                 ls.NamedPose("a", root_poses={"leg": ls.pose()}), ls.NamedPose("a", root_poses={"trunk": np.zeros((4, 4))})):
        changed = model.copy()
        changed.poses.append(pose)
        with pytest.raises(ls.ModelError, match="pose"):
            ls.compile(changed)
