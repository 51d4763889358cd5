# Contacts over mass ratio, friction, step, number of points and violence. SPDX-License-Identifier: Apache-2.0
"""Writes one line of JSON for each point to stdout, progress to stderr.

    PYTHONPATH=build/release/python python3 bench/contacts/sweeps.py > bench/contacts/results/sweeps.jsonl

stack      largest speed (m/s, rad/s) from 2 s to 6 s of three blocks, the top one `mass` times as heavy
grasp      slip (m) in the hand from 3 s to 8 s of the box of docs/examples/python/grasp.py
tower      ns an environment-step of a tower of `blocks` blocks at rest: 4 contact points a block
top        ns an environment-step of the stack at rest, the top one `mass` times as heavy
blows      ns an environment-step in the first second of a tower of 3 that starts with random speeds of size `speed`;
           each environment has its own
"""
import itertools
import json
import pathlib
import sys
import time

import numpy as np

import lockstep as ls

sys.path.insert(0, str(pathlib.Path(__file__).parents[2] / "docs" / "examples" / "python"))
import grasp  # noqa: E402

RATES = (60, 120, 240, 480, 960)
MASSES = tuple(float(m) for m in np.logspace(0, 5, 11))


def tower(blocks, drop=0.001):
    model = ls.Model()
    inertia = ls.Inertia(1.0, (0, 0, 0), np.diag([1 / 600] * 3))
    for i in range(blocks):
        name = f"block{i + 1}"
        model.links.append(ls.Link(name, inertia))
        place = (0.004 * np.sin(2.4 * i), 0.004 * np.cos(2.4 * i), 0.05 + (0.1 + drop) * i)
        model.roots.append(ls.Root(name, floating=True, pose=ls.pose(place)))
        model.colliders.append(ls.Collider(name, name, ls.Shape.box(0.1, 0.1, 0.1), friction=0.6))
    model.colliders.append(ls.Collider("floor", "", ls.Shape.half_space(), friction=0.6))
    names = ["floor", *(f"block{i + 1}" for i in range(blocks))]
    model.contacts = [ls.Contact(a, b) for a, b in itertools.pairwise(names)]
    return model


def emit(**numbers):
    print(json.dumps({k: float(f"{v:.3g}") if isinstance(v, float) else v for k, v in numbers.items()}), flush=True)


def stack(dtype):
    """One environment for each mass."""
    for rate in RATES:
        plan = ls.compile(tower(3), dt=1 / rate, vary=["mass"])
        batch = plan.batch(len(MASSES), dtype=dtype)
        batch.parameter("mass")[:, 2] = MASSES
        fastest = np.zeros(len(MASSES))
        for i in range(6 * rate):
            batch.step()
            if i >= 2 * rate:
                fastest = np.maximum(fastest, np.nan_to_num(np.abs(batch.root_twist), nan=1e9).max(axis=1))
        for mass, speed, fault in zip(MASSES, fastest, batch.fault):
            emit(sweep="stack", dtype=dtype, rate=rate, mass=mass, speed=float(speed), fault=int(fault))
        print(f"stack {dtype} {rate} Hz", file=sys.stderr)


def grasps():
    masses, frictions = np.logspace(-2, 0.7, 10), np.linspace(0.1, 1.2, 12)
    model = grasp.scene()
    box = [link.name for link in model.links].index("box")
    for rate in RATES:
        plan = ls.compile(model, dt=1 / rate, vary=["mass", "contact_friction"])
        batch = plan.batch(len(masses) + len(frictions))
        batch.parameter("mass")[:len(masses), box] = masses
        batch.parameter("contact_friction")[len(masses):] = frictions[:, None]
        arm, knuckle = [plan.dof(name) for name in list(grasp.GAINS)[:7]], plan.dof("knuckle")
        held, slip = None, np.zeros(len(masses) + len(frictions))
        for i in range(int(grasp.SECONDS * rate)):
            t = (i + 1) / rate
            batch.q_target[:, arm], batch.q_target[:, knuckle] = grasp.targets(t)
            batch.step()
            if t < 3.0 or i % max(1, rate // 30):
                continue
            now = grasp.in_palm(batch)
            held = now if held is None else held
            slip = np.maximum(slip, np.linalg.norm(now - held, axis=1))
        for k, fault in enumerate(batch.fault):
            own = {"mass": masses[k]} if k < len(masses) else {"friction": frictions[k - len(masses)]}
            emit(sweep="grasp", rate=rate, slip=float(slip[k]), fault=int(fault),
                 **{name: float(number) for name, number in own.items()})
        print(f"grasp {rate} Hz", file=sys.stderr)


def cost(batch, steps):
    """Processor time, ns an environment-step: the least and the median of stretches."""
    times = []
    for _ in range(15):
        begin = time.process_time_ns()
        batch.step(steps // 15)
        times.append((time.process_time_ns() - begin) / (steps // 15) / batch.num_envs)
    return {"least": float(min(times)), "median": float(np.median(times))}


def costs():
    for blocks in range(1, 9):
        batch = ls.compile(tower(blocks)).batch(256, threads=1)
        batch.step(480)
        emit(sweep="tower", blocks=blocks, **cost(batch, 240))
    for mass in MASSES:
        batch = ls.compile(tower(3), vary=["mass"]).batch(256, threads=1)
        batch.parameter("mass")[:, 2] = mass
        batch.step(480)
        emit(sweep="top", mass=mass, **cost(batch, 240))
    for speed in np.logspace(-2, 1, 7):
        batch = ls.compile(tower(3)).batch(256, threads=1)
        batch.root_twist[:] = np.random.default_rng(1).normal(0, speed, batch.root_twist.shape)
        emit(sweep="blows", speed=float(speed), **cost(batch, 240),
             unfinished=float(batch.read("unfinished_contacts").sum() / 240 / 256))
    print("costs", file=sys.stderr)


if __name__ == "__main__":
    for precision in ("f4", "f8"):
        stack(precision)
    grasps()
    costs()
