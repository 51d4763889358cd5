# Contacts from Python. SPDX-License-Identifier: Apache-2.0
import pathlib
import pickle
import re
import subprocess
import sys

import numpy as np
import pytest
from conftest import MODELS

import lockstep as ls

EXAMPLE = pathlib.Path(__file__).parents[2] / "docs" / "examples" / "python" / "grasp.py"


def block(friction=0.5, tilt=0.0):
    inertia = ls.Inertia(2.0, (0, 0, 0), np.diag([0.01, 0.01, 0.01]))
    return ls.Model(
        links=[ls.Link("block", inertia)],
        colliders=[ls.Collider("block", "block", ls.Shape.box(0.1, 0.1, 0.1), friction=friction),
                   ls.Collider("floor", "", ls.Shape.half_space(), friction=friction)],
        contacts=[ls.Contact("floor", "block")],
        roots=[ls.Root("block", floating=True, pose=ls.pose((0, 0, 0.05)))],
        gravity=(10 * np.sin(tilt), 0, -10 * np.cos(tilt)),
    )


def test_forces_balance_the_weight():
    plan = ls.compile(block(tilt=0.3))
    assert plan.contact_names == ["floor-block"] and plan.contact("floor-block") == 0
    batch = plan.batch(5, dtype="f8", threads=1)
    batch.step(200)
    force = batch.read("contact_force")
    assert force.shape == (5, 3)
    assert np.allclose(force, [-20 * np.sin(0.3), 0, 20 * np.cos(0.3)], atol=1e-6)
    assert np.allclose(batch.read(ls.Query("contact_normal_force", ["floor-block"])), 20 * np.cos(0.3), atol=1e-6)
    assert -1e-5 < batch.read("contact_gap").min() < 0 and batch.read("contact_slip").max() < 1e-9
    batch.root_twist[1, 5] += 1e-3  # a push
    batch.forget_contacts([2])
    batch.reset([3])
    bears = [True, True, False, False, True]
    assert np.array_equal(batch.read("contact_normal_force")[:, 0] > 1, bears)
    with pytest.raises(ls.UsageError):
        batch.forget_contacts([5])
    batch.step(200)
    points = batch.read("contact_point").reshape(5, 4, 11)
    assert np.allclose(points[..., 3:6], [0, 0, 1])  # from the floor to the block
    assert np.allclose(points[..., 6:9].sum(axis=1), force)
    assert np.allclose(np.abs(points[..., :2]), 0.05, atol=1e-3) and batch.read("unfinished_contacts").max() == 0


def test_hulls_cylinders_and_ellipsoids_rest():
    corners = [(x, y, z) for x in (-0.05, 0.05) for y in (-0.05, 0.05) for z in (-0.05, 0.05)]
    for shape in (ls.Shape.hull(np.array(corners)), ls.Shape.hull(corners), ls.Shape.cylinder(0.03, 0.1),
                  ls.Shape.ellipsoid(0.06, 0.06, 0.05)):
        model = block()
        model.colliders["block"].shape = shape
        plan = ls.compile(model)
        assert np.allclose(plan.model.colliders["block"].shape.points, shape.points)
        batch = plan.batch(3, dtype="f8", threads=1)
        batch.step(200)
        assert np.allclose(batch.read("contact_force"), [0, 0, 20], atol=1e-5)
    with pytest.raises(TypeError, match="points"):
        model.colliders["block"].shape = ls.Shape.hull([(0, 0), (1, 0)])
        ls.compile(model)


def test_a_batch_says_what_its_solves_cost():
    batch = ls.compile(block()).batch(3, threads=1)
    batch.step(100)
    counts = batch.read("solve_counts")
    assert counts.shape == (3, 11) and (counts[:, :4] == [100, 100, 400, 400]).all()
    assert (counts[:, 6] >= counts[:, 4]).all() and (counts[:, 9] >= counts[:, 6]).all()  # rounds, solves; tile
    assert "1 pairs declared, 1.0 near; 4.0 points could act, 4.0 pressed" in batch.describe()


def test_the_order_of_a_pair_turns_its_normal():
    model = block()
    model.contacts = [ls.Contact("block", "floor")]
    batch = ls.compile(model).batch(1, dtype="f8", threads=1)
    batch.step(200)
    assert np.allclose(batch.read("contact_force"), [0, 0, -20], atol=1e-6)  # on the floor
    assert np.allclose(batch.read("contact_point").reshape(4, 11)[:, 3:6], [0, 0, -1])


def test_a_reset_forgets_forces():
    batch = ls.compile(block()).batch(3, threads=1)
    batch.step(100)
    batch.reset([1])
    assert (batch.read("contact_normal_force")[:, 0] > 1).tolist() == [True, False, True]


def test_models_keep_their_colliders():
    model = block(friction=0.7)
    model.contacts[0].friction = 0.2
    model.contacts[0].softness = ls.Spring(1e5, 1e2)
    plan = pickle.loads(pickle.dumps(ls.compile(model)))
    assert plan.model.colliders["block"] == model.colliders["block"] and plan.model.contacts == model.contacts
    assert plan.hash == ls.compile(model).hash != ls.compile(block(friction=0.7)).hash


def test_friction_against_turning_is_part_of_the_plan():
    model = block()
    plain = ls.compile(model).hash
    model.colliders["block"].torsional_friction = 0.01
    torsional = ls.compile(model).hash
    model.contacts[0].rolling_friction = 0.001
    assert len({plain, torsional, ls.compile(model).hash}) == 3
    assert ls.from_mjcf_text(ls.export_mjcf(model).text, colliders=True).contacts[0].rolling_friction == 0.001


def test_shapes_of_a_file_become_colliders():
    model = ls.from_urdf(MODELS / "arm_gripper.urdf", colliders=True)
    assert model.colliders.names == ["palm", "left_tip", "right_tip", "box"]
    assert {collider.group for collider in model.colliders} == {"robot"}
    assert not ls.from_urdf(MODELS / "arm_gripper.urdf").colliders
    model.contacts = [ls.Contact("robot", "robot")]
    plan = ls.compile(model)
    assert plan.contact_names == ["palm-left_tip", "palm-right_tip", "palm-box", "left_tip-right_tip", "left_tip-box",
                                  "right_tip-box"]


def test_ends_of_chains_may_touch_the_ground():
    model = ls.from_urdf(MODELS / "arm_gripper.urdf", colliders=True)
    assert model.end_colliders() == ["left_tip", "right_tip", "box"]
    model.colliders.append(ls.Collider("ground", "", ls.Shape.half_space()))
    model.contacts = [ls.Contact("ground", name) for name in model.end_colliders()]
    assert ls.compile(model).contact_names == ["ground-left_tip", "ground-right_tip", "ground-box"]
    model.colliders["palm"].link = "plam"
    with pytest.raises(ls.ModelError, match="plam"):
        model.end_colliders()


@pytest.mark.parametrize("change, element, rule", [
    (lambda m: m.contacts.append(ls.Contact("floor", "ball")), "floor-ball", "neither a collider nor a group"),
    (lambda m: m.contacts.append(ls.Contact("floor", "block")), "floor-block", "twice"),
    (lambda m: setattr(m.colliders["block"], "friction", -1.0), "block", "friction"),
    (lambda m: setattr(m.colliders["block"], "restitution", 1.5), "block", "restitution"),
    (lambda m: setattr(m.colliders["block"], "torsional_friction", -1.0), "block", "torsional friction"),
    (lambda m: setattr(m.contacts[0], "rolling_friction", -1.0), "floor-block", "rolling friction"),
    (lambda m: setattr(m.colliders["block"], "shape", ls.Shape.sphere(0.0)), "block", "not above 0"),
    (lambda m: setattr(m.colliders["block"], "shape", ls.Shape("cone")), "block", "unknown kind"),
    (lambda m: setattr(m.colliders["block"], "shape", ls.Shape.hull([(0, 0, 0), (1, 0, 0), (0, 1, 0)])), "block",
     "fewer than 4"),
    (lambda m: setattr(m.colliders["block"], "shape", ls.Shape.half_space()), "block", "half-space"),
    (lambda m: setattr(m.colliders["block"], "link", "blok"), "blok", ""),
    (lambda m: setattr(m.colliders["block"], "name", "floor"), "floor", "twice"),
])
def test_bad_colliders_are_refused(change, element, rule):
    model = block()
    change(model)
    with pytest.raises(ls.ModelError, match=rule) as caught:
        ls.compile(model)
    assert element in str(caught.value)


@pytest.mark.parametrize("settings, rule", [
    ({"method": "tgs"}, "tgs renews couplings"),
    ({"integrator": "extrapolated"}, "contacts may begin and end"),
    ({"contact_passes": 0}, "outside 1 to 100"),
    ({"contact_tolerance": 0.0}, "tolerance|outside"),
])
def test_settings_that_do_not_apply_are_refused(settings, rule):
    with pytest.raises(ls.SettingsError, match=rule):
        ls.compile(block(), **settings)


def test_contact_settings_have_names():
    numbers = ("contact_passes", "contact_rounds", "contact_tolerance")

    def solved(**settings):
        plan = ls.compile(block(), **settings)
        assert pickle.loads(pickle.dumps(plan)).hash == plan.hash
        return tuple(plan.settings[number] for number in numbers)

    assert solved() == solved(contact_settings="default") == (3, 30, 1e-4)
    assert solved(contact_settings="learning") == (2, 30, 1e-2)
    assert solved(contact_settings="accurate") == (10, 30, 1e-4)
    assert solved(contact_settings="learning", contact_passes=7) == (7, 30, 1e-2)
    assert solved(contact_settings="accurate", contact_rounds=9, contact_tolerance=1e-3) == (10, 9, 1e-3)
    with pytest.raises(ls.SettingsError, match="'quick'.*learning, default, accurate") as caught:
        ls.compile(block(), contact_settings="quick")
    assert caught.value.code == "settings.contacts"


def test_contacts_take_tables_and_compiled_code():
    plan = ls.compile(block())
    tables = plan.batch(1, engine="tables")
    assert tables.engine == "tables"
    chosen = plan.batch(1)
    if chosen.engine == "tables":
        pytest.skip("no machine code here")
    assert chosen.engine == "compiled"
    tables.step(100), chosen.step(100)
    np.testing.assert_allclose(chosen.root_pose, tables.root_pose, atol=1e-5)


def test_the_example_holds_its_boxes():
    done = subprocess.run([sys.executable, EXAMPLE], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    slips = [float(slip) for slip in re.findall(r"held, slip +([0-9.]+) um", done.stdout)]
    assert len(slips) == 4 and max(slips) < 150, done.stdout


def test_cubes_of_different_sizes_rest_at_half_their_edges():
    plan = ls.compile(block(), dt=0.004, vary=["collider_size", "contact_restitution"])
    batch = plan.batch(16)
    rows = [f"block {axis}" for axis in "xyz"]
    batch.randomize("collider_size", "scale", 0.5, 1.5, rows=rows, shared=True)
    batch.randomize("contact_restitution", "absolute", 0.0, 0.5)
    at = plan.parameter_rows("collider_size").index(rows[0])
    edges = batch.parameter("collider_size")[:, at : at + 3]
    assert np.ptp(edges[:, 0]) > 0.02 and np.all(edges == edges[:, :1])
    batch.root_pose[:, 2] = edges[:, 0]
    batch.step(1500)
    np.testing.assert_allclose(batch.root_pose[:, 2], edges[:, 0] / 2, atol=1e-4)
    assert not batch.fault.any()
