# SPDX-License-Identifier: Apache-2.0
import base64
import copy
import json
import pickle
import re

import numpy as np
import pytest
from conftest import gripper_model

import lockstep as ls
from lockstep._lockstep import _Motion
from lockstep.vector import VectorEnv


@pytest.fixture(scope="module")
def plan():
    return ls.compile(gripper_model())


def motion_of(recording, path):
    """The motion in the page that is saved: its JSON, times and, by environment, [samples, links, 7] poses."""
    try:
        recording.save(path)
    except ls.UsageError as error:
        if error.element == "viewer":
            pytest.skip("the package was built without the viewer")
        raise
    found = re.search(r'<script id="motion" type="application/json">(.*?)</script>', path.read_text())
    motion = json.loads(found[1])
    numbers = np.frombuffer(base64.b64decode(motion["numbers"]), np.float32)
    samples, links = motion["samples"], len(motion["links"])
    times, rest = numbers[:samples], numbers[samples:].reshape(len(motion["environments"]), -1)
    return motion, times, rest[:, :samples * links * 7].reshape(-1, samples, links, 7)


def test_frames_are_what_the_batch_reads(plan, tmp_path):
    batch = plan.batch(5, threads=1, seed=3)
    batch.reset_random()
    recording = ls.Recording(batch, [3, 0])
    expected, positions = [batch.read("link_pose")], [batch.q.copy()]
    for _ in range(6):
        batch.step(4)
        recording.add()
        expected.append(batch.read("link_pose"))
        positions.append(batch.q.copy())
    motion, times, poses = motion_of(recording, tmp_path / "page.html")
    assert len(recording) == motion["samples"] == 7
    assert [one["label"] for one in motion["environments"]] == ["environment 3", "environment 0"]
    np.testing.assert_allclose(times, np.arange(7) * 4 * plan.dt, rtol=1e-6)
    drawn = [plan.link(link["name"]) for link in motion["links"]]
    for track, environment in enumerate((3, 0)):
        for sample in range(7):
            links = expected[sample][environment].reshape(-1, 7)[drawn]
            np.testing.assert_array_equal(poses[track, sample], links)
    assert np.abs(np.diff(poses, axis=1)).max() > 1e-3


def test_double_precision_is_recorded_too(plan, tmp_path):
    batch = plan.batch(2, threads=1, dtype="f8")
    motion, times, poses = motion_of(ls.Recording(batch), tmp_path / "page.html")
    assert "float64" in motion["about"] and times.tolist() == [0.0]
    np.testing.assert_allclose(poses[0, 0, 0], batch.read("link_pose")[0, :7], atol=1e-6)


def test_time_goes_on_over_resets(plan, tmp_path):
    batch = plan.batch(3, threads=1)
    recording = ls.Recording(batch, [0, 2])
    for steps, which in ((4, None), (2, [0]), (6, [0, 2]), (3, [1])):
        batch.step(steps)
        batch.reset([] if which is None else which)
        recording.add()
    # Environment 2 tells of the second two steps; of the six nobody does.
    _, times, _ = motion_of(recording, tmp_path / "page.html")
    np.testing.assert_allclose(times / plan.dt, [0, 4, 6, 8, 11], rtol=1e-5)


@pytest.mark.parametrize("environments", [[], [3], [-1], [1, 1]])
def test_environments_must_be_some_of_the_batch(plan, environments):
    with pytest.raises(ls.UsageError, match="give different ones from 0 to 2") as refused:
        ls.Recording(plan.batch(3, threads=1), environments)
    assert refused.value.code == "usage.environment"


def test_a_page_that_is_too_large_is_refused(plan):
    motion = _Motion.of(plan, [0, 1])
    motion.require_room(10**4)
    with pytest.raises(ls.UsageError, match="too large for a browser"):
        motion.require_room(10**7)


def test_an_environment_records_its_control_steps(plan, tmp_path):
    env = VectorEnv(plan, 4, limit=5, autoreset_mode="SameStep", threads=1)
    env.reset(seed=1)
    still = np.zeros(env.action_space.shape, np.float32)
    with env.record([1, 2]) as recording:
        for _ in range(12):
            env.step(still)
    env.step(still)  # after the end of the recording
    motion, times, poses = motion_of(recording, tmp_path / "page.html")
    assert motion["samples"] == 13 and len(poses) == 2
    np.testing.assert_allclose(np.diff(times), 4 * plan.dt, rtol=1e-4)


def test_a_full_recording_stops_a_step_before_it_begins(plan):
    env = VectorEnv(plan, 2, threads=1)
    env.reset(seed=1)
    before = env.batch.q.copy()
    with env.record() as recording:
        recording.require_room = lambda: recording._motion.require_room(10**8)
        with pytest.raises(ls.UsageError, match="too large"):
            env.step(np.ones(env.action_space.shape, np.float32))
    np.testing.assert_array_equal(env.batch.q, before)
    assert env.elapsed.tolist() == [0, 0] and len(recording) == 1


def test_recordings_stay_with_their_environment(plan):
    env = VectorEnv(plan, 2, threads=1)
    env.reset(seed=1)
    still = np.zeros(env.action_space.shape, np.float32)
    with env.record() as recording:
        for other in (copy.deepcopy(env), pickle.loads(pickle.dumps(env))):
            other.step(still)
        assert len(recording) == 1
        env.step(still)
    assert len(recording) == 2
