# Rollouts, linearization and inverse kinematics from Python. SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from conftest import MODELS

import lockstep as ls

GAINS = {"shoulder_yaw": (60, 6), "shoulder_pitch": (120, 12), "elbow": (60, 6), "knuckle": (8, 0.3)}


def arm(**settings):
    model = ls.from_urdf(MODELS / "gripper.urdf")
    for joint, (kp, kd) in GAINS.items():
        model.joints[joint].drive = ls.Drive(kp=kp, kd=kd)
    model.sites.append(ls.Site("tip", "left_tip", ls.pose((0.0, 0.0, 0.045))))
    return ls.compile(model, integrator="euler", **settings)


def test_a_rollout_is_acts_steps_and_readings():
    plan, tip = arm(), ls.Query("site_position", ["tip"])
    controls = np.random.default_rng(0).uniform(-1, 1, (5, 7, len(plan.driven_dofs))).astype(np.float32)
    batch, places = plan.batch(5, threads=1), np.empty((5, 7, 3), np.float32)
    for t in range(7):
        batch.act(controls[:, t])
        batch.step(3)
        places[:, t] = batch.read(tip)
    for size in (1, 2, 8):  # fewer environments than rollouts, and more
        search = plan.batch(size, threads=2)
        found, faults = search.rollout(plan.batch(1).save(), controls, record=tip, substeps=3)
        assert np.array_equal(found, places) and not faults.any()


def test_records_go_where_the_caller_wants_them():
    plan = arm()
    batch = plan.batch(4, threads=1)
    wide = np.full((4, 6, 20), -7, np.float32)
    out = wide[:, ::2, 5 : 5 + plan.nv]
    controls = np.zeros((4, 3, len(plan.driven_dofs)), np.float32)
    same, _ = batch.rollout(None, controls, record="q", out=out)
    assert same is out and (wide[:, 1::2] == -7).all() and (wide[:, :, :5] == -7).all()
    assert np.array_equal(out[:, -1], batch.q)
    constant = np.broadcast_to(controls[0], controls.shape)  # one sequence for all
    again, _ = plan.batch(4).rollout(None, constant, record="q")
    assert np.array_equal(again, out)


def test_bad_rollouts_change_nothing():
    plan = arm()
    batch = plan.batch(2, threads=1)
    before, controls = batch.save(), np.zeros((2, 3, len(plan.driven_dofs)), np.float32)
    for bad in (controls[:, :, 1:], controls[0], np.full_like(controls, np.nan), controls.astype(np.float64)[:1]):
        with pytest.raises((ls.UsageError, TypeError)):
            batch.rollout(None, bad)
    for options in ({"substeps": 0}, {"record": "nothing"}, {"out": np.zeros((2, 3, 1), np.float32)}, {"kind": "push"}):
        with pytest.raises((ls.UsageError, ValueError, TypeError)):
            batch.rollout(None, controls, **options)
    assert batch.save() == before


def test_a_pendulum_has_the_derivatives_of_paper():
    mass, length, dt = 2.0, 0.5, 0.01
    inertia = ls.Inertia(mass, (0, 0, -length), np.zeros((3, 3)))
    model = ls.Model(
        links=[ls.Link("base"), ls.Link("bob", inertia)],
        joints=[ls.Joint("hinge", "continuous", "base", "bob", axis=(0, 1, 0))],
        roots=[ls.Root("base")],
    )
    plan = ls.compile(model, dt=dt, integrator="euler")
    batch = plan.batch(2, dtype="f8", threads=1)
    batch.q[1] = 1.0
    found = batch.linearize(inputs="effort")
    for place, angle in enumerate((0.0, 1.0)):
        stiffness = -9.81 / length * np.cos(angle)
        assert np.allclose(found["A"][place], [[1 + dt * dt * stiffness, dt], [dt * stiffness, 1]], atol=1e-7)
        gain = dt / (mass * length**2)
        assert np.allclose(found["B"][place], [[dt * gain], [gain]], atol=1e-7)
    with pytest.raises(ls.UsageError):
        plan.batch(1).linearize()


def test_inverse_kinematics_reaches_what_can_be_reached():
    plan = arm()
    batch = plan.batch(8, dtype="f8", threads=1)
    batch.reset_random(spread=0.2)
    targets = batch.read(ls.Query("site_position", ["tip"]))
    batch.reset()
    left = batch.inverse_kinematics("tip", targets)
    assert left.shape == (8, 2) and left[:, 0].max() < 1e-5
    assert np.abs(batch.read(ls.Query("site_position", ["tip"])) - targets).max() < 1e-5
    assert np.abs(batch.read("coupling_error")).max() < 1e-9
    with pytest.raises(ls.UsageError):
        batch.inverse_kinematics("tip", targets[:, :2])


def test_matrices_of_the_coordinates():
    plan = arm(vary=["gear_ratio", "mass"])
    batch = plan.batch(6, dtype="f8", threads=1)
    batch.randomize("gear_ratio", "scale", 0.9, 1.1)
    batch.randomize("mass", "scale", 0.8, 1.2)
    batch.reset_random(spread=0.4, speed=1.0)
    n, columns = len(plan.open_coordinates), [plan.dof(name) for name in plan.open_coordinates]
    z = batch.qd[:, columns]
    mass, forces = batch.mass_matrix(), batch.bias_forces()
    assert mass.shape == (6, n, n) and forces.shape == (6, n) and plan.open_coordinates == plan.coordinates
    assert np.allclose(0.5 * np.einsum("ni,nij,nj->n", z, mass, z), batch.read("kinetic_energy")[:, 0], rtol=1e-10)
    for frame, query in (("tip", "site_velocity"), ("left_tip", "link_velocity")):
        which = {"site" if query == "site_velocity" else "link": frame}
        jacobian = batch.jacobian(**which)
        assert jacobian.shape == (6, 6, n)
        assert np.allclose(np.einsum("nij,nj->ni", jacobian, z), batch.read(ls.Query(query, [frame])), atol=1e-10)
    some = batch.mass_matrix([4, 1])
    assert np.array_equal(some, mass[[4, 1]])
    mask = np.arange(6) == 2
    assert np.array_equal(batch.bias_forces(mask), forces[2:3])
    batch.qd[:] = 0  # at rest they are the slope of the potential energy
    still, step = batch.bias_forces(), 1e-6
    for k, column in enumerate(columns):
        energies = []
        for side in (step, -2 * step, step):
            batch.q[:, column] += side
            batch.project()
            energies.append(batch.read("potential_energy")[:, 0])
        assert np.allclose((energies[0] - energies[1]) / (2 * step), still[:, k], atol=1e-6)
    for wrong in ({}, {"site": "tip", "link": "left_tip"}, {"site": "nothing"}, {"link": "nothing"}):
        with pytest.raises(ls.UsageError):
            batch.jacobian(**wrong)
