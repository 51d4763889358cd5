# The learning examples run, and their numbers do not depend on threads. SPDX-License-Identifier: Apache-2.0
import json
import pathlib
import re
import subprocess
import sys

import numpy as np
import pytest

EXAMPLES = pathlib.Path(__file__).parents[2] / "docs" / "examples" / "python"


def run(script, *options):
    done = subprocess.run([sys.executable, EXAMPLES / script, *map(str, options)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def medians(threads):
    printed = run("train_es.py", "--generations", 10, "--threads", threads)
    return [float(number) for number in re.findall(r"median error +([0-9.]+) mm", printed)]


def test_it_learns_the_same_with_one_thread_and_two():
    one = medians(1)
    assert one == medians(2)
    assert one[0] > 250 and one[-1] < 0.5 * one[0]


def test_policy_gradients_reach():
    pytest.importorskip("torch")
    printed = run("train_ppo.py", "--iterations", 11, "--envs", 128)
    first, last = (float(number) for number in re.findall(r"median error +([0-9.]+) mm", printed))
    assert last < 0.9 * first


def test_the_walker_learns_is_tested_and_writes_its_page(tmp_path):
    pytest.importorskip("torch")
    pytest.importorskip("matplotlib")
    printed = run("walk.py", "--iterations", 2, "--envs", 32, "--tested", 16, "--out", tmp_path)
    assert "seed 1" in printed and "succeed" in printed
    agent = json.loads((tmp_path / "agent1.json").read_text())
    assert [np.shape(layer["weight"]) for layer in agent["layers"]] == [(64, 48), (64, 64), (12, 64)]
    assert np.abs(agent["layers"][-1]["bias"]).max() > 0
    page = (tmp_path / "walk.md").read_text()
    assert "![Curves of learning, and the feet of a walk](walk.png)" in page and "nan" not in page
    assert (tmp_path / "walk.png").read_bytes().startswith(b"\x89PNG")


@pytest.fixture
def walker(monkeypatch):
    pytest.importorskip("torch")
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import walk

    return walk


def test_the_walker_sees_what_it_should(walker):
    env = walker.Walk(8, seed=3, threads=1)
    seen, _ = env.reset()
    for step in range(5):
        seen, *_ = env.step(np.full((8, 12), 0.1 * step, np.float32))
    noise = np.repeat([0.05, 0.1, 0.02, 0.1, 0, 0, 0], [3, 6, 12, 12, 12, 1, 2])
    clean, rows = seen["critic"][:, :48], env.batch.rows
    difference = np.abs(seen["policy"] - clean)
    assert (difference <= noise + 1e-6).all() and (difference[:, noise > 0].max(0) > 0.2 * noise[noise > 0]).all()
    x, y, z, w, a, b, c = rows.root_pose
    down = [2 * (w * b - a * c), -2 * (b * c + w * a), 2 * (a * a + b * b) - 1]
    np.testing.assert_allclose(clean[:, :3].T, down, atol=1e-5)
    np.testing.assert_array_equal(clean[:, 3:9].T, rows.root_twist)
    np.testing.assert_allclose(clean[:, 9:21], env.batch.q - env.home, atol=1e-6)
    np.testing.assert_allclose(clean[:, 21:33], 0.1 * env.batch.qd, rtol=1e-5)
    np.testing.assert_allclose(clean[:, 33:45], 0.4)
    assert (np.ptp(env.command) > 0.1) and (clean[:, 45] == env.command).all()
    np.testing.assert_allclose(clean[:, 46], np.sin(2 * np.pi * 5 * 0.02 / 0.5), atol=1e-6)
    np.testing.assert_allclose(env.batch.q_target, np.tile(env.home + 0.5 * 0.4, (8, 1)), atol=1e-6)


def test_a_walker_on_its_back_has_fallen(walker):
    env = walker.Walk(4, seed=3, threads=1)
    env.reset()
    env.batch.root_pose[1, 3:] = 0, 1, 0, 0
    env.batch.root_pose[2, 2], env.batch.q[2] = 0.05, [0.0, 1.8, -0.3] * 4  # on the trunk, the feet above the floor
    _, rewards, terminated, _, info = env.step(np.zeros((4, 12), np.float32))
    assert terminated.tolist() == [False, True, True, False]
    assert info["reason"][2] == "trunk" and info["reason"][1] in ("trunk", "tilt")
    assert np.isfinite(rewards).all()
