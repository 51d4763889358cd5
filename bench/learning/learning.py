#!/usr/bin/env python3
# Steps per second of a learning loop, beside the bare step and MuJoCo. SPDX-License-Identifier: Apache-2.0
"""Random actions, new every 8 steps, so that limits act; resets of a hundredth of the environments; observations and
rewards. Reports the p10 of repeats of CPU time on one thread. With --mujoco FOLDER (of @mujoco/mujoco from npm) MuJoCo's
WebAssembly build steps the same robots; native builds are about 1.33 times as fast, which is an estimate."""

import argparse
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as xml

import numpy as np

import lockstep as ls
from lockstep.vector import VectorEnv
from mjcf import mjcf

GRIPPER = pathlib.Path(__file__).parents[2] / "tests" / "models" / "gripper.urdf"
SUBSTEPS, REPEATS = 8, 40


def robot(path):
    """A servo on every joint that nothing else moves: stiff enough to reach its limit of effort. Joints without a range get
    one of 3 rad or m to either side, so that actions have one."""
    model = ls.from_urdf(path)
    followers = {coupling.joint for coupling in model.couplings}
    for joint in model.joints:
        if joint.kind == "fixed" or joint.name in followers:
            continue
        if not math.isfinite(joint.upper - joint.lower):
            joint.kind = "revolute" if joint.kind == "continuous" else joint.kind
            joint.lower, joint.upper = -3.0, 3.0
        span = joint.upper - joint.lower
        if span <= 0:
            continue
        effort = joint.effort_limit if 0 < joint.effort_limit < math.inf else 10.0
        joint.drive.kp = 4 * effort / span
        joint.drive.kd = 0.05 * joint.drive.kp
    return model


def fastest(action, steps):
    """ns of CPU time for each of `steps` environment steps: p10 of the repeats."""
    spent = []
    for _ in range(REPEATS):
        start = time.process_time()
        action()
        spent.append(time.process_time() - start)
    return 1e9 * float(np.quantile(spent, 0.1)) / steps


def loop(plan, num_envs, threads=1):
    env = VectorEnv(plan, num_envs, observe=("q", "qd"), limit=100, decimation=SUBSTEPS, threads=threads,
                    reward=lambda env: -np.square(env.batch.rows.q[:4]).sum(axis=0), autoreset_mode="SameStep")
    env.reset(seed=1)
    env.elapsed[:] = np.arange(num_envs) % 100  # resets spread over the steps
    random = np.random.default_rng(0)
    actions = random.uniform(-1, 1, (16, num_envs, len(plan.driven_dofs))).astype(np.float32)
    step = iter(range(1 << 30))
    return lambda: env.step(actions[next(step) % 16])


def bare(plan, num_envs, acting):
    batch = plan.batch(num_envs, threads=1, seed=1)
    batch.reset_random()
    random = np.random.default_rng(0)
    actions = random.uniform(-1, 1, (16, num_envs, len(plan.driven_dofs))).astype(np.float32)
    step = iter(range(1 << 30))

    def once():
        if acting:
            batch.act(actions[next(step) % 16])
        batch.step(SUBSTEPS)

    return once


def scaling(plan, picture):
    """Wall-clock speed of the Python loop over environments and threads."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6, 3.4), layout="constrained")
    counts = [16, 64, 256, 1024, 4096, 16384]
    for threads in (1, 2):
        speeds = []
        for count in counts:
            step = loop(plan, count, threads)
            spent = []
            for _ in range(REPEATS):
                start = time.perf_counter()
                for _ in range(max(1, 1024 // count)):
                    step()
                spent.append((time.perf_counter() - start) / max(1, 1024 // count))
            speeds.append(1e-6 * count * SUBSTEPS / float(np.quantile(spent, 0.1)))
            print(f"  {threads} threads {count:6} environments {speeds[-1]:8.2f}", flush=True)
        axes.loglog(counts, speeds, marker="o", label=f"{threads} thread{'s' if threads > 1 else ''}")
    axes.set(xlabel="environments", ylabel="million environment-steps a second",
             title=f"{plan.model.name}: learning loop in Python, {plan.integrator}")
    axes.grid(True, which="both", alpha=0.3)
    axes.legend()
    figure.savefig(picture, dpi=110)


def mujoco(module, model, plan, integrator):
    driven = plan.driven_dofs
    low, high = plan.limits[[plan.dof(name) for name in driven]].T
    targets = np.random.default_rng(0).uniform(low, high, (64, len(driven)))
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "model.xml"
        text = mjcf(model, plan.dt, integrator)
        file.write_text(text)
        order = [joint.get("name") for joint in xml.fromstring(text).find("worldbody").iter("joint")]
        place = {name: i for i, name in enumerate(order)}
        couplings = [[place[c.joint], place[c.terms[0][0]], c.terms[0][1], c.offset] for c in model.couplings]
        pathlib.Path(f"{file}.couplings.json").write_text(json.dumps(couplings))
        rows = pathlib.Path(folder) / "targets.json"
        rows.write_text(json.dumps(targets.tolist()))
        script = pathlib.Path(__file__).with_name("mujoco.mjs")
        done = subprocess.run(["node", "--no-liftoff", script, module, file, rows, "40000"], capture_output=True, text=True)
    if done.returncode:
        sys.exit(done.stdout + done.stderr)
    return json.loads(done.stdout.splitlines()[-1])


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robots", nargs="*", type=pathlib.Path, default=[GRIPPER], help="URDF files")
    parser.add_argument("--envs", type=int, default=4096)
    parser.add_argument("--mujoco", help="folder of @mujoco/mujoco")
    parser.add_argument("--loop", help="the program learning_loop, for the same loop in C++")
    parser.add_argument("--scaling", help="picture of the speed over environments and threads, for the first robot")
    options = parser.parse_args()
    if options.scaling:
        scaling(ls.compile(robot(options.robots[0]), integrator="euler"), options.scaling)
        return
    for path in options.robots:
        model = robot(path)
        print(f"{model.name}: million environment steps a second on one core")
        for integrator in ("leapfrog", "euler"):
            plan = ls.compile(model, integrator=integrator, vary=["mass", "gear_ratio"])
            steps = options.envs * SUBSTEPS
            for name, action in (("bare step, targets held", bare(plan, options.envs, False)),
                                 ("step, random actions", bare(plan, options.envs, True)),
                                 ("learning loop in Python", loop(plan, options.envs))):
                print(f"  {integrator:9} {name:26} {1e3 / fastest(action, steps):8.2f}", flush=True)
            if options.loop:
                ran = subprocess.run([options.loop, path, str(options.envs), integrator], capture_output=True, text=True)
                print(f"  {integrator:9} {'learning loop in C++':26} {ran.stdout.strip():>8}", flush=True)
        if options.mujoco:
            for integrator in ("implicitfast", "discrete"):
                ran = mujoco(options.mujoco, model, plan, integrator)
                print(f"  MuJoCo    {integrator:26} {1.33e-6 / ran['seconds']:8.4f}   |C| up to {ran['error']:.1e} rad"
                      f"{', diverged and was reset' if ran['reset'] else ''}")


if __name__ == "__main__":
    main()
