# A gripper with five mimic joints grasps a box, lifts it and shakes it. SPDX-License-Identifier: Apache-2.0
"""64 arms grasp boxes of different mass and friction. Prints how far each box has slipped in the hand.

    python3 grasp.py                       # the numbers
    python3 grasp.py --picture grasp.svg   # and what one arm does (matplotlib)
    python3 grasp.py --targets grasp.csv   # only the targets, for `lockstep view` (docs/viewing.md)
"""

import argparse
import pathlib

import numpy as np

import lockstep as ls

URDF = pathlib.Path(__file__).parents[3] / "tests" / "models" / "arm_gripper.urdf"
GAINS = {"shoulder_yaw": (2000, 80), "shoulder_pitch": (4000, 160), "upper_roll": (2000, 60), "elbow": (3000, 100),
         "forearm_roll": (1000, 30), "wrist_pitch": (800, 20), "wrist_roll": (400, 8), "knuckle": (30, 1)}
# The seven joints with the palm 12 cm above the box, around it, and 20 cm above the ground.
ABOVE = np.array([0.0, 0.7066, 0.0, 1.5182, 0.0, 0.9218, 0.0])
AROUND = np.array([0.0, 1.0458, 0.0, 1.4403, 0.0, 0.7379, 0.0])
LIFTED = np.array([0.0, 0.5751, 0.0, 1.5287, 0.0, 0.9791, 0.0])
CLOSED = 0.5  # rad, of the knuckle; the box stops it at 0.32
RATE, SECONDS = 240, 8.0


def scene(mass=0.2, friction=0.9):
    model = ls.from_urdf(URDF, colliders=True)
    for (name, (kp, kd)), angle in zip(GAINS.items(), [*ABOVE, 0.0]):
        joint = model.joints[name]
        joint.drive = ls.Drive(kp=kp, kd=kd, position_target=float(angle))
        joint.position = float(angle)
    box = model.links["box"].inertia
    box.about_center = tuple(tuple(entry * mass / box.mass for entry in row) for row in box.about_center)
    box.mass = mass
    for collider in model.colliders:
        collider.friction = friction
    model.colliders.append(ls.Collider("ground", "", ls.Shape.half_space(), friction=friction))
    pairs = [("left_tip", "box"), ("right_tip", "box"), ("palm", "box"), ("ground", "box"), ("ground", "left_tip"),
             ("ground", "right_tip")]
    model.contacts = [ls.Contact(*pair) for pair in pairs]
    return model


def ramp(t, start, end):
    s = min(1.0, max(0.0, (t - start) / (end - start)))
    return s * s * (3.0 - 2.0 * s)


def targets(t):
    """Of the arm and of the knuckle."""
    arm = ABOVE + (AROUND - ABOVE) * ramp(t, 0.2, 1.0) + (LIFTED - AROUND) * ramp(t, 2.0, 3.0)
    shake = ramp(t, 3.5, 4.0)
    arm[0] += 0.25 * shake * np.sin(2 * np.pi * (t - 3.5))
    arm[1] += 0.05 * shake * np.sin(4 * np.pi * (t - 3.5))
    arm[6] += 0.30 * shake * np.sin(2.6 * np.pi * (t - 3.5))
    return arm, CLOSED * ramp(t, 1.2, 1.6)


def write_targets(path):
    """As a file for the command: a row for each step."""
    rows = []
    for i in range(int(SECONDS * RATE)):
        arm, knuckle = targets((i + 1) / RATE)
        rows.append([i / RATE, *arm, knuckle])
    np.savetxt(path, rows, fmt="%.6g", delimiter=",", header=",".join(["time", *GAINS]), comments="")


def rotation(wxyz):
    w, x, y, z = wxyz
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def in_palm(batch):
    """Where each box is in the palm's frame, m."""
    seen = batch.read("root_pose", ls.Query("link_pose", ["palm"])).astype(float)
    return np.array([rotation(row[10:14]).T @ (row[:3] - row[7:10]) for row in seen])


def run(model, num_envs, watch=None, dtype="f4"):
    """Slip in the hand after the lift: the largest distance of each box from where it was at 3 s, m."""
    plan = ls.compile(model, dt=1.0 / RATE)
    batch = plan.batch(num_envs, dtype=dtype)
    arm, knuckle = [plan.dof(name) for name in list(GAINS)[:7]], plan.dof("knuckle")
    held, slip = None, np.zeros(num_envs)
    for i in range(int(SECONDS * RATE)):
        t = (i + 1) / RATE
        batch.q_target[:, arm], batch.q_target[:, knuckle] = targets(t)
        batch.step()
        if t >= 3.0 and i % 8 == 0:
            now = in_palm(batch)
            held = now if held is None else held
            slip = np.maximum(slip, np.linalg.norm(now - held, axis=1))
        if watch:
            watch(t, batch)
    return slip, batch


def faces(size, place, turn):
    x, y, z = np.asarray(size) / 2
    corners = np.array([(i, j, k) for i in (-x, x) for j in (-y, y) for k in (-z, z)]) @ turn.T + place
    return [corners[list(face)] for face in ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4),
                                             (1, 3, 7, 5))]


def draw(path):
    """The arm at five times: boxes of the hand and of what it holds, lines between the joints."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    shown = {0.1: "above", 1.1: "around", 1.9: "closed", 3.2: "lifted", 5.8: "shaken"}
    model, frames = scene(), {}

    def keep(t, batch):
        for time in shown:
            if abs(t - time) < 0.5 / RATE:
                frames[time] = batch.read("link_pose")[0].reshape(-1, 7).astype(float)

    run(model, 1, keep)
    figure = plt.figure(figsize=(12.5, 3))
    for place, (time, title) in enumerate(shown.items()):
        axes = figure.add_subplot(1, 5, place + 1, projection="3d", computed_zorder=False)
        poses = {link.name: frames[time][i] for i, link in enumerate(model.links)}
        line = np.array([poses[name][:3] for name in ("base", "turret", "shoulder", "upper_arm", "elbow_link", "forearm",
                                                      "wrist_link", "flange", "palm")])
        axes.plot(*line.T, color="0.45", linewidth=6, solid_capstyle="round", zorder=1)
        for side in ("left", "right"):
            finger = np.array([poses[name][:3] for name in ("palm", f"{side}_knuckle", f"{side}_tip")])
            axes.plot(*finger[1:].T, color="0.3", linewidth=4, zorder=2)
        for collider in model.colliders[:-1]:
            pose = poses[collider.link]
            turn = rotation(pose[3:])
            offset = np.array(collider.pose)[:3, 3]
            color = "tab:orange" if collider.link == "box" else "tab:blue"
            axes.add_collection3d(Poly3DCollection(faces(collider.shape.size, pose[:3] + turn @ offset, turn),
                                                   facecolor=color, edgecolor="k", linewidth=0.4, zorder=3))
        ground = [(0.2, -0.2, 0), (0.6, -0.2, 0), (0.6, 0.2, 0), (0.2, 0.2, 0)]
        axes.add_collection3d(Poly3DCollection([ground], facecolor="0.93", edgecolor="0.7", zorder=0))
        axes.set(xlim=(0.25, 0.55), ylim=(-0.15, 0.15), zlim=(0, 0.3), title=f"{title}, {time:.1f} s")
        axes.set_box_aspect((1, 1, 1), zoom=1.25)
        axes.view_init(elev=14, azim=-28)
        axes.set_axis_off()
    figure.subplots_adjust(left=0, right=1, bottom=0, top=0.9, wspace=0)
    figure.savefig(path)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--picture", metavar="FILE")
    parser.add_argument("--targets", metavar="FILE")
    options = parser.parse_args()
    if options.targets:
        write_targets(options.targets)
        return
    for mass, friction in ((0.05, 0.5), (0.2, 0.9), (1.0, 0.9), (2.0, 1.2)):
        slip, batch = run(scene(mass, friction), 64)
        held = batch.root_pose[:, 2].min() > 0.1 and not batch.fault.any()
        print(f"{mass:4.2f} kg, friction {friction:.1f}: {'held' if held else 'lost'}, slip {1e6 * slip.max():7.1f} um, "
              f"largest coupling error {abs(batch.coupling_error()).max():.0e} rad")
    if options.picture:
        draw(options.picture)


if __name__ == "__main__":
    main()
