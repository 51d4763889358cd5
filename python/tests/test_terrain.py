# Ground by heights: what lockstep.terrain makes, levels that environments stand on, and scans. SPDX-License-Identifier:
# Apache-2.0
import numpy as np
import pytest

import lockstep as ls
from lockstep.observations import Term
from lockstep.terrain import Patch, curriculum
from lockstep.vector import VectorEnv

PATCH = Patch(edge=4.0, cell=0.1, flat=1.0)


def ball(ground, vary=(), **settings):
    model = ls.Model(
        links=[ls.Link("ball", ls.Inertia(0.5, (0, 0, 0), np.diag([2e-4] * 3)))],
        roots=[ls.Root("ball", floating=True, pose=ls.pose((0.0, 0.0, 0.2)))],
        colliders=[
            ls.Collider("ball", "ball", ls.Shape.sphere(0.05)),
            ls.Collider("ground", "", ground),
        ],
        contacts=[ls.Contact("ground", "ball")],
    )
    return ls.compile(model, dt=0.004, vary=list(vary), **settings)


def test_patches_have_what_they_are_asked_for():
    middle = PATCH.count // 2
    stairs = PATCH.stairs(0.1, 0.3)
    along = stairs[middle, middle:]
    assert np.all(along[:6] == 0)  # the level square
    steps = np.diff(along)[np.diff(along) != 0]
    np.testing.assert_allclose(steps, -0.1)
    assert np.all(np.diff(np.flatnonzero(np.diff(along))) == 3)  # cells from step to step
    slope = PATCH.slope(0.2)
    np.testing.assert_allclose(slope[middle, 0], -0.2 * 1.5)
    waves = PATCH.waves(0.2, 1.0)
    assert waves[middle, middle] == 0 and 0.19 < np.ptp(waves) <= 0.2 + 1e-12
    rough = PATCH.rough(0.1, np.random.default_rng(1))
    assert np.all(rough[middle - 4 : middle + 5, middle - 4 : middle + 5] == 0) and 0.09 < np.ptp(rough) <= 0.1
    gaps = PATCH.gaps(0.3, 0.8)
    assert set(np.unique(gaps)) == {-1.0, 0.0} and np.all(gaps[middle, middle : middle + 6] == 0)
    assert not PATCH.level().any()
    with pytest.raises(ValueError, match="two cells"):
        PATCH.stairs(0.1, 0.1)


def test_environments_stand_on_their_own_levels():
    ground = curriculum(PATCH, 3, [lambda d: PATCH.level() + 0.3 * d, lambda d: -PATCH.stairs(0.2 * d, 0.5)])
    plan = ball(ground.shape(), ["collider_place"])
    batch = plan.batch(6)
    level, kind = np.repeat([0, 1, 2], 2), np.tile([0, 1], 3)
    at = plan.parameter_rows("collider_place").index("ground x")
    batch.parameter("collider_place")[:, at : at + 4] = ground.place(level, kind)
    scan = ls.Query("height_scan", ["ball"], points=[(0.0, 0.0), (0.9, 0.0), (100.0, 0.0)])
    before = batch.read(scan)
    np.testing.assert_allclose(before[:, 0], 0.2, atol=1e-6)  # each begins 0.2 m above its own middle
    np.testing.assert_allclose(before[kind == 1, 1], 0.2 + 0.2 * np.array([0.0, 0.5, 1.0]) * -1, atol=1e-6)
    assert np.all(np.isinf(before[:, 2]))
    batch.step(500)
    np.testing.assert_allclose(batch.root_pose[:, 2], 0.05, atol=1e-3)
    np.testing.assert_allclose(batch.read(scan)[:, 0], 0.05, atol=1e-3)


def test_scans_see_fields_half_spaces_and_boxes_in_the_yaw_of_the_link():
    heights = np.fromfunction(lambda j, i: 0.01 * i + 0.02 * j, (11, 21))
    plan = ball(ls.Shape.height_field(heights, 2.0, 1.0))
    model = plan.model
    model.colliders.append(ls.Collider("step", "", ls.Shape.box(0.2, 0.2, 1.0), ls.pose((0.0, 0.4, 0.0))))
    model.colliders.append(ls.Collider("far", "", ls.Shape.half_space(), ls.pose((0.0, 0.0, -0.5))))
    model.contacts.extend([ls.Contact("step", "ball"), ls.Contact("far", "ball")])
    batch = ls.compile(model, dt=0.004).batch(3, dtype="f8")
    yaw = np.array([0.0, np.pi / 2, 0.7])
    lean = 0.4
    batch.root_pose[:] = 0
    batch.root_pose[:, 2] = 1.0
    # Yaw, then a lean about the link's own y: the scan keeps to the yaw.
    batch.root_pose[:, 3:] = np.stack(
        [np.cos(yaw / 2) * np.cos(lean / 2), -np.sin(yaw / 2) * np.sin(lean / 2),
         np.cos(yaw / 2) * np.sin(lean / 2), np.sin(yaw / 2) * np.cos(lean / 2)], axis=1)
    points = [(0.3, 0.1), (-0.25, 0.0), (0.4, 0.0), (5.0, 5.0)]
    seen = batch.read(ls.Query("height_scan", ["ball"], points=points))
    for e, angle in enumerate(yaw):
        for k, (x, y) in enumerate(points):
            px, py = np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y
            ground = -0.5
            if abs(px) < 1 and abs(py) < 0.5:
                ground = 0.1 * (px + 1) + 0.2 * (py + 0.5)
            if abs(px) < 0.1 and abs(py - 0.4) < 0.1:
                ground = 0.5
            assert seen[e, k] == pytest.approx(1.0 - ground, abs=1e-9), (e, k)


def test_scans_that_cannot_be_are_refused():
    plan = ball(ls.Shape.height_field(np.zeros((3, 3)), 2.0, 2.0))
    batch = plan.batch(1)
    for query, words in [
        (ls.Query("height_scan", ["ball"]), "no points"),
        (ls.Query("height_scan", ["ball"], points=[(0.0, np.nan)]), "not finite"),
        (ls.Query("q", points=[(0.0, 0.0)]), "does not take"),
    ]:
        with pytest.raises(ls.UsageError, match=words):
            batch.read(query)
    leaning = plan.model
    c, s = np.cos(0.2), np.sin(0.2)
    leaning.colliders["ground"].pose = ((c, 0, s, 0), (0, 1, 0, 0), (-s, 0, c, 0), (0, 0, 0, 1))
    with pytest.raises(ls.UsageError, match="leans"):
        ls.compile(leaning, dt=0.004).batch(1).read(ls.Query("height_scan", ["ball"], points=[(0, 0)]))


def test_heights_that_cannot_be_are_refused():
    for heights, words in [(np.zeros((1, 5)), "1 x 5"), (np.full((3, 3), np.inf), "not finite")]:
        with pytest.raises(ls.ModelError, match=words):
            ball(ls.Shape.height_field(heights, 1.0, 1.0))
    with pytest.raises(ls.ModelError, match="link that moves"):
        model = ball(ls.Shape.half_space()).model
        model.colliders["ball"].shape = ls.Shape.height_field(np.zeros((2, 2)), 1.0, 1.0)
        ls.compile(model, dt=0.004)


def test_models_keep_their_heights():
    shape = ls.Shape.height_field(np.arange(6.0).reshape(2, 3), 1.0, 2.0)
    model = ball(shape).model
    assert model.colliders["ground"].shape == shape
    again = ls.from_mjcf_text(ls.export_mjcf(model).text, colliders=True)
    np.testing.assert_allclose(again.colliders["ground"].shape.heights, shape.heights)


def test_edges_that_are_no_whole_number_of_cells_are_refused():
    for edge, cell in [(1.0, 0.3), (1.0, 0.2), (0.1, 0.1)]:
        with pytest.raises(ValueError, match="even whole number"):
            Patch(edge=edge, cell=cell)


def test_two_scans_of_a_link_are_two_observations():
    plan = ball(ls.Shape.height_field(np.zeros((5, 5)), 4.0, 4.0))
    small, large = (ls.Query("height_scan", ["ball"], points=[(0.1 * i, 0.0) for i in range(n)]) for n in (2, 5))
    env = VectorEnv(plan, 3, observe={"policy": {"scan": Term(small)}, "critic": {"scan": Term(large)}})
    seen, _ = env.reset(seed=1)
    assert seen["policy"].shape == (3, 2) and seen["critic"].shape == (3, 5)
