# Closed loops from Python. SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest

import lockstep as ls


def four_bar() -> ls.Model:
    """A parallelogram: a crank of 0.2 m, a coupler of 0.4 m and a rocker as long as the crank, which the loop holds."""
    rod = ls.Inertia(0.5, (0.1, 0, 0), ((1e-4, 0, 0), (0, 2e-3, 0), (0, 0, 2e-3)))
    names = ("crank", "coupler", "rocker")
    axis = (0, -1, 0)
    return ls.Model(
        "four_bar",
        links=[ls.Link("ground")] + [ls.Link(name, rod) for name in names],
        joints=[
            ls.Joint("crank", "revolute", "ground", "crank", axis=axis, position=1.0, damping=0.01),
            ls.Joint("coupler", "revolute", "crank", "coupler", ls.pose((0.2, 0, 0)), axis, position=-1.0),
            ls.Joint("rocker", "revolute", "ground", "rocker", ls.pose((0.4, 0, 0)), axis, position=1.0),
        ],
        loops=[
            ls.Loop("pin", "point", "coupler", "rocker", ls.pose((0.4, 0, 0)), ls.pose((0.2, 0, 0))),
        ],
    )


def test_a_loop_stays_closed_and_is_read_back():
    plan = ls.compile(four_bar(), dt=1 / 240)
    assert plan.loops == [("pin", 3, 1)] and len(plan.loop_dependent) == 2
    batch = plan.batch(5)
    batch.effort[:, 0] = np.linspace(-0.5, 0.5, 5)
    batch.step(240)
    assert not batch.fault.any() and np.ptp(batch.q[:, 0]) > 0.1
    assert batch.loop_error().shape == (5, 2) and batch.loop_error().max() < 1e-4
    force = batch.read(ls.Query("loop_force", ["pin"]))
    assert force.shape == (5, 6) and np.abs(force[:, [0, 2]]).max() > 0.01
    np.testing.assert_allclose(force[:, [1, 3, 4, 5]], 0.0, atol=1e-6)  # a point in the plane


def test_a_switch_opens_a_loop_and_project_closes_it():
    batch = ls.compile(four_bar(), dt=1 / 240, vary=["loop_switch"]).batch(2)
    batch.parameter("loop_switch")[1] = 0.0
    batch.step(60)
    assert batch.loop_error()[0, 0] < 1e-4 and batch.loop_error()[1, 0] > 0.05
    batch.parameter("loop_switch")[1] = 1.0
    assert batch.project() == []
    assert batch.loop_error().max() < 1e-5


def test_a_model_keeps_its_loops():
    model = four_bar()
    again = ls.compile(model).model
    assert again.loops["pin"] == model.loops["pin"]
    model.loops["pin"].kind = "ball"
    with pytest.raises(ls.ModelError, match="pin"):
        ls.compile(model)
    model.loops["pin"].kind = "point"
    model.loops["pin"].first_pose = ls.pose((0.4, 0.1, 0))  # out of the plane
    with pytest.raises(ls.ModelError, match="does not close"):
        ls.compile(model)
    assert math.isinf(model.loops["pin"].force_limit)
