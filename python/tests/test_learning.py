# The learning examples with torch: their environments step, two iterations learn, pages are written.
# SPDX-License-Identifier: Apache-2.0
import json
import pathlib
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("matplotlib")

EXAMPLES = pathlib.Path(__file__).parents[2] / "docs" / "examples" / "python"


@pytest.fixture(autouse=True)
def examples_can_be_imported(monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLES))


@pytest.mark.parametrize("name", ["lift", "turn"])
def test_it_learns_and_writes_its_page(name, tmp_path):
    done = subprocess.run([sys.executable, EXAMPLES / f"{name}.py", "--iterations", "2", "--seeds", "1", "--envs", "4",
                           "--test", "4", "--out", tmp_path], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "{" not in (tmp_path / f"{name}.md").read_text()
    assert (tmp_path / f"{name}.svg").stat().st_size > 1000
    layers = json.loads((tmp_path / f"{name}-1.json").read_text())["layers"]
    assert len(layers) == 3 and len(layers[-1]["bias"]) == {"lift": 5, "turn": 12}[name]


def test_the_reach_alone_brings_the_open_hand_around_the_cube_and_does_not_lift_it():
    import lift

    env = lift.Lift(np.full(8, 0.04), seed=1, threads=1)
    env.reset()
    for _ in range(50):
        env.step(np.tile(np.float32([0, 0, 0, 0, -1]), (8, 1)))
    assert np.abs(env.cube - env.at)[:, :2].max() < 8e-3 and abs(env.bottom).max() < 1e-3
    assert not env.force.any() and not env.batch.fault.any()


def test_a_hand_that_closes_and_rises_holds_the_cube_of_each_size():
    import lift

    for size in lift.SIZES:
        env = lift.Lift(np.full(8, size), seed=1, threads=1)
        env.reset()
        for step in range(lift.CONTROL_STEPS - 1):
            shut, up = step > 20, step > 30
            env.step(np.tile(np.float32([0, 0, up, 0, 1 if shut else -1]), (8, 1)))
        assert (env.bottom > lift.HEIGHT).all()
        # What holds a cube up is friction of two pads: at most 2 mu N.
        weight = 9.81 * env.batch.parameter("mass")[:, env.plan.link("cube")]
        friction = env.batch.parameter("contact_friction")[:, env.plan.contact("left_pad-cube")]
        assert (2 * friction * env.force.min(axis=1) > weight).all()


def test_the_cube_is_paid_for_its_turn_about_the_vertical():
    import turn

    env = turn.Turn(4, seed=1, threads=1)
    env.reset()
    first = env.angle.copy()
    paid = np.zeros(4)
    for _ in range(20):
        env.batch.root_twist[:, 2] = [-4.0, 0.0, 2.0, 4.0]  # about the cube's own z, which is vertical
        env.step(np.zeros((4, 12), np.float32))
        paid += env.turned
    assert np.allclose(paid, np.remainder(env.angle - first + np.pi, 2 * np.pi) - np.pi, atol=1e-5)
    assert paid[0] < -0.01 and paid[3] > 0.01
