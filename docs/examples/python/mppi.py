# Sampling-based control: the fingertip of an arm follows goals that jump. SPDX-License-Identifier: Apache-2.0
"""MPPI (Williams et al. 2017): each control step tries 256 noisy sequences of controls by one rollout, and takes their
mean, weighted by what they cost. The arm's gripper closes by mimic joints. Needs numpy, and matplotlib for --picture.

    python3 mppi.py                      # the distance to the goal, once a second
    python3 mppi.py --picture mppi.svg   # and its curve
"""

import argparse
import pathlib

import numpy as np

import lockstep as ls

URDF = pathlib.Path(__file__).parents[3] / "tests" / "models" / "gripper.urdf"
GAINS = {"shoulder_yaw": (60, 6), "shoulder_pitch": (120, 12), "elbow": (60, 6), "knuckle": (8, 0.3)}
ROLLOUTS, HORIZON, SUBSTEPS, NOISE, TEMPERATURE = 256, 20, 8, 0.1, 0.005


def plan():
    model = ls.from_urdf(URDF)
    for joint, (kp, kd) in GAINS.items():
        model.joints[joint].drive = ls.Drive(kp=kp, kd=kd)
    model.sites.append(ls.Site("tip", "left_tip", ls.pose((0.0, 0.0, 0.045))))
    return ls.compile(model, integrator="euler")


def control(compiled, seconds, seed=0, report=print):
    """Moves the tip to a goal that jumps every two seconds. Returns the distances, m."""
    random = np.random.default_rng(seed)
    robot, search = compiled.batch(1), compiled.batch(ROLLOUTS)
    tip = ls.Query("site_position", ["tip"])
    places = compiled.batch(16, seed=seed)
    places.reset_random(spread=0.5)
    goals = places.read(tip)
    mean = np.zeros((HORIZON, len(compiled.driven_dofs)), np.float32)
    records = np.empty((ROLLOUTS, HORIZON, 3), np.float32)
    interval, distances = SUBSTEPS * compiled.dt, []
    for i in range(int(seconds / interval)):
        goal = goals[int(i * interval / 2) % len(goals)]
        noise = NOISE * random.standard_normal((ROLLOUTS, *mean.shape)).astype(np.float32)
        controls = np.clip(mean + noise, -1, 1).astype(np.float32)
        _, faults = search.rollout(robot.save(), controls, record=tip, substeps=SUBSTEPS, out=records)
        cost = np.linalg.norm(records - goal, axis=2).mean(axis=1) + 1e-3 * (noise ** 2).mean(axis=(1, 2))
        cost[faults != 0] = np.inf
        weights = np.exp(-(cost - cost.min()) / TEMPERATURE)
        mean = np.einsum("n,ntu->tu", weights / weights.sum(), controls)
        robot.act(mean[:1])
        robot.step(SUBSTEPS)
        mean = np.concatenate([mean[1:], mean[-1:]])
        distances.append(float(np.linalg.norm(robot.read(tip)[0] - goal)))
        if (i + 1) % int(1 / interval) == 0:
            report(f"{(i + 1) * interval:4.1f} s  distance {1e3 * distances[-1]:6.1f} mm")
    return np.array(distances)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=8.0)
    parser.add_argument("--picture", metavar="FILE")
    options = parser.parse_args()
    compiled = plan()
    distances = control(compiled, options.seconds)
    if options.picture:
        import matplotlib

        matplotlib.use("Agg")
        import matplotlib.pyplot as plt

        plt.plot(SUBSTEPS * compiled.dt * np.arange(1, len(distances) + 1), 1e3 * distances)
        plt.xlabel("s")
        plt.ylabel("distance, mm")
        plt.savefig(options.picture)


if __name__ == "__main__":
    main()
