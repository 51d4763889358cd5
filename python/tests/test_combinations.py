# Environments with groups in scenes of the page of combinations. SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

import lockstep as ls
from lockstep.observations import Group, Normal, Term, Uniform
from lockstep.vector import VectorEnv

SIZES = {"l0": 0.4, "l1": 0.3, "l2": 0.2}


def arm():
    """Three hinges one behind the other."""
    model = ls.Model(links=[ls.Link("base")], roots=[ls.Root("base")])
    parent = "base"
    for number, (link, mass) in enumerate(SIZES.items()):
        model.links.append(ls.Link(link, ls.Inertia.box(mass, (0.3, 0.05, 0.05), (0.15, 0, 0))))
        model.joints.append(ls.Joint(f"q{number}", "revolute", parent, link, ls.pose((0.3 if number else 0, 0, 0)),
                                     axis=(0, 1, 0), damping=0.02, armature=0.01))
        parent = link
    return model


def hard(model, settings):
    model.couplings.append(ls.Coupling("q2", [("q0", -1.5)]))


def soft(model, settings):
    model.couplings.append(ls.Coupling("q2", [("q0", -1.5)], softness=ls.Spring(40, 0.5)))


def slipping(model, settings):
    model.couplings.append(ls.Coupling("q2", [("q0", -1.5)], force_limit=1.0))


def cam(model, settings):
    model.couplings.append(ls.Coupling("q2", [("q0", 1.0)], function=ls.Polynomial([0.0, 1.5, 0.2])))
    model.joints["q0"].lower, model.joints["q0"].upper = -1.0, 1.0


def limits(model, settings):
    for name in ("q0", "q1"):
        model.joints[name].lower, model.joints[name].upper = -1.0, 1.0


def servos(model, settings):
    for name in ("q0", "q1"):
        model.joints[name].drive, model.joints[name].effort_limit = ls.Drive(kp=20, kd=1), 3.0


def friction(model, settings):
    model.joints["q1"].friction = 0.1


def tendon(model, settings):
    model.joints.append(ls.Joint("tendon", "tendon", drive=ls.Drive(kp=20, kd=1), lower=-1.0, upper=1.0))
    model.couplings.append(ls.Coupling("tendon", [("q0", -1.0), ("q1", -0.5)]))


def contact(model, settings):
    model.colliders += [ls.Collider("ball", "l2", ls.Shape.sphere(0.05), ls.pose((0.3, 0, 0))),
                        ls.Collider("floor", "", ls.Shape.half_space(), ls.pose((0, 0, -0.4)))]
    model.contacts.append(ls.Contact("floor", "ball"))


def loop(model, settings):
    """A parallelogram over the first two joints."""
    model.joints["q0"].position = 1.0
    model.links.append(ls.Link("rod", ls.Inertia.box(0.2, (0.3, 0.05, 0.05), (0.15, 0, 0))))
    model.links.append(ls.Link("coupler", ls.Inertia.box(0.2, (0.3, 0.05, 0.05), (-0.1, 0, 0))))
    model.joints.append(ls.Joint("rod", "revolute", "base", "rod", ls.pose((-0.2, 0, 0)), axis=(0, 1, 0), position=1.0))
    model.joints.append(ls.Joint("coupler", "revolute", "rod", "coupler", ls.pose((0.3, 0, 0)), axis=(0, 1, 0),
                                 position=-1.0))
    model.loops.append(ls.Loop("loop", "point", "coupler", "l0", ls.pose((0.2, 0, 0)), ls.pose((0.3, 0, 0))))


def ratios(model, settings):
    settings.setdefault("vary", []).append("gear_ratio")


def masses(model, settings):
    settings.setdefault("vary", []).append("mass")


CELLS = [(), (hard,), (soft,), (slipping,), (cam,), (tendon,), (loop,), (contact,), (hard, limits, servos),
         (soft, limits, servos), (cam, limits, servos), (hard, friction), (hard, ratios), (hard, masses, limits),
         (tendon, servos), (loop, hard), (loop, tendon), (loop, hard, limits, servos), (loop, cam),
         (contact, hard, limits, servos), (contact, tendon), (contact, cam, limits), (contact, loop),
         (contact, loop, hard, masses)]


def name_of(cell):
    return "-".join(feature.__name__ for feature in cell) or "nothing"


class Task(VectorEnv):
    def __init__(self, plan, num_envs, **options):
        self.vary = plan.vary
        groups = {"policy": Group({"q": Term("q", noise=Uniform(-0.01, 0.01)), "qd": Term("qd", scale=0.1)}, history=2),
                  "critic": {"q": Term("q", noise=Normal(0.02)), "qd": "qd", "energy": "kinetic_energy"}}
        super().__init__(plan, num_envs, observe=groups, limit=11, seed=5, threads=1, decimation=4,
                         reward={"speed": (-0.1, lambda env: np.square(env.batch.qd).sum(1)),
                                 "place": (1.0, lambda env: env.batch.q[:, 0])},
                         terminate={"far": lambda env: env.batch.q[:, 1] > 2.5}, **options)

    def randomize(self, which):
        for field in self.vary:
            self.batch.randomize(field, "scale", 0.9, 1.1, which=which)


def run(plan, num_envs, options):
    env = Task(plan, num_envs, **options)
    actions = np.random.default_rng(2).uniform(-1, 1, (40, 64, env.single_action_space.shape[0])).astype(np.float32)
    told = [env.reset()[0]]
    for a in actions:
        seen, rewards, terminated, truncated, info = env.step(a[:num_envs])
        told.append({**seen, "reward": rewards, "ended": terminated | truncated})
        assert "_fault" not in info and "_fault" not in info.get("final_info", {})
    return env, told


@pytest.mark.parametrize("cell", CELLS, ids=name_of)
def test_environments_with_groups_run_beside_everything(cell):
    model, settings = arm(), {}
    for feature in cell:
        feature(model, settings)
    plan = ls.compile(model, **settings)
    if plan.driven_dofs:
        options = {"actions": {"scale": 0.8}}
    else:
        options = {"action_kind": "effort", "actions": {"scale": 1.0}}
    options["autoreset_mode"] = "SameStep"
    few, a = run(plan, 3, options)
    many, b = run(plan, 9, options)
    for one, other in zip(a, b):  # environments do not see how many there are
        for key in one:
            assert np.array_equal(one[key], other[key][:3]), key
            assert np.isfinite(other[key]).all(), key
    assert any(told["ended"].all() for told in b[1:])
    assert not (many.batch.q[0] == many.batch.q[1]).all()
    if {hard, cam, tendon} & set(cell):
        assert np.abs(many.batch.read("coupling_error")).max() < 1e-5
    if loop in cell:
        assert many.batch.read("loop_error").max() < 1e-3
