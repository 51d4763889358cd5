# SPDX-License-Identifier: Apache-2.0
"""Pictures by a real Chromium. Tests that need it are skipped without it, and without the viewer in the build."""
import copy

import numpy as np
import pytest
from conftest import gripper_model

import lockstep as ls
from lockstep.chromium import Chromium, find_chromium
from lockstep.rendering import Renderer
from lockstep.vector import VectorEnv


def coloured_model():
    """Colliders are drawn in strong colours, unlike inertias."""
    model = gripper_model()
    for link in ("base", "upper_arm", "palm"):
        model.colliders.append(ls.Collider(link, link, ls.Shape("box", (0.1, 0.1, 0.2))))
    return model


@pytest.fixture(scope="module")
def plan():
    return ls.compile(coloured_model())


@pytest.fixture
def chromium(plan):
    try:
        find_chromium()
        ls.Recording(plan.batch(1, threads=1)).save("/dev/null")
    except ls.UsageError as error:
        pytest.skip(str(error))


def coloured(frame):
    """The share of pixels in the strong colours of links."""
    return ((frame.max(axis=2).astype(int) - frame.min(axis=2)) > 60).mean()


def differing(one, other):
    return (np.abs(one.astype(int) - other).max(axis=2) > 24).mean()


def test_pictures_show_the_environments_as_they_are(plan, chromium):
    batch = plan.batch(3, threads=1)
    batch.q[:, plan.dof("shoulder_pitch")] = [0.0, 0.0, 1.0]
    with Renderer(batch, [2, 0], size=(320, 240)) as renderer:
        frames = renderer.frames()
        assert [(frame.shape, frame.dtype) for frame in frames] == [((240, 320, 3), np.uint8)] * 2
        assert all(0.01 < coloured(frame) < 0.5 for frame in frames)
        assert differing(*frames) > 0.01
        batch.q[0] = batch.q[2]
        alike, bent = renderer.frames()
        np.testing.assert_array_equal(alike, frames[0])
        np.testing.assert_array_equal(bent, frames[0])
        # The horizon is above: the picture is not upside down.
        grid = np.abs(np.diff(frames[1].astype(int).sum(axis=2), axis=1)) > 20
        assert grid[:20].mean() < 0.5 * grid[-20:].mean()


def test_the_view_follows_what_falls(chromium):
    model = coloured_model()
    model.roots[0].floating = True
    batch = ls.compile(model).batch(1, threads=1)
    with Renderer(batch, size=(160, 120)) as renderer:
        start = coloured(renderer.frames()[0])
        batch.step(480)  # 20 m below
        assert coloured(renderer.frames()[0]) > 0.5 * start > 0.004


def test_an_environment_renders(plan, chromium):
    env = VectorEnv(plan, 3, threads=1, render_mode="rgb_array", render_environments=[1], render_size=(160, 120))
    assert env.metadata["render_modes"] == ["rgb_array"]
    assert env.metadata["render_fps"] == pytest.approx(1 / (4 * plan.dt))
    env.reset(seed=1)
    frames = env.render()
    assert isinstance(frames, tuple) and [frame.shape for frame in frames] == [(120, 160, 3)]
    assert copy.deepcopy(env)._renderer is None
    env.close()
    assert VectorEnv(plan, 2, threads=1).render() is None
    assert VectorEnv(plan, 2, threads=1, render_mode="rgb_array").render_environments == [0, 1]  # as RecordVideo wants


def test_gymnasium_records_videos(plan, chromium, tmp_path):
    pytest.importorskip("gymnasium")
    pytest.importorskip("moviepy")
    from gymnasium.wrappers.vector import RecordVideo

    env = VectorEnv(plan, 2, threads=1, limit=4, render_mode="rgb_array", render_size=(160, 120))
    env = RecordVideo(env, str(tmp_path), video_length=6, step_trigger=lambda step: step == 0)
    env.reset(seed=1)
    for _ in range(8):
        env.step(env.action_space.sample())
    env.close()
    (video,) = tmp_path.glob("*.mp4")
    assert video.stat().st_size > 1000


def test_without_chromium_there_is_a_remedy(monkeypatch, tmp_path):
    monkeypatch.delenv("CHROME", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ls.UsageError, match="not on the PATH; install it .Debian: chromium."):
        find_chromium()
    monkeypatch.setenv("CHROME", "/no/such/chrome")
    with pytest.raises(ls.UsageError, match="CHROME names none: '/no/such/chrome'"):
        find_chromium()


def test_a_chromium_that_ends_is_an_error(monkeypatch):
    monkeypatch.setenv("CHROME", "true")
    with pytest.raises(ls.UsageError, match="it has ended"):
        Chromium()


def test_a_script_that_throws_is_an_error(chromium):
    browser = Chromium()
    assert browser.run("'x'.repeat(3)") == "xxx"
    with pytest.raises(ls.UsageError, match="out of order"):
        browser.run("(() => { throw new Error('out of order') })()")
    assert browser.run("2 + 3") == 5
    browser.close()
    with pytest.raises(ls.UsageError, match="it was closed"):
        browser.run("1")


@pytest.mark.parametrize("options, said", [
    (dict(render_mode="human"), "neither None nor 'rgb_array'"),
    (dict(render_environments=[7]), "give different ones from 0 to 2"),
    (dict(render_mode="rgb_array", num_envs=65), "give the numbers of at most 64"),
])
def test_options_that_cannot_be_are_refused(plan, options, said):
    with pytest.raises(ValueError, match=said):
        VectorEnv(plan, **{"num_envs": 3, "threads": 1, **options})


@pytest.mark.parametrize("size", [(8, 100), (100, 5000)])
def test_sizes_are_bounded(plan, size):
    with pytest.raises(ls.UsageError, match="16 to 4096"):
        Renderer(plan.batch(1, threads=1), size=size)
