# The task of both learning examples. SPDX-License-Identifier: Apache-2.0
"""A gripper on an arm moves its left fingertip to a goal. Four joints are commanded; five follow by mimic couplings.
Gear ratios, offsets, gains and masses are different in every environment and every episode."""

import pathlib
import time

import numpy as np

import lockstep as ls
from lockstep.vector import VectorEnv

URDF = pathlib.Path(__file__).parents[3] / "tests" / "models" / "gripper.urdf"
CONTROL_STEPS = 50  # in an episode, each of 4 steps of 1/240 s
OBSERVATIONS, ACTIONS = 18, 4


def plan():
    model = ls.from_urdf(URDF)
    gains = {"shoulder_yaw": (60, 6), "shoulder_pitch": (120, 12), "elbow": (60, 6), "knuckle": (8, 0.3)}
    for joint, (kp, kd) in gains.items():
        model.joints[joint].drive = ls.Drive(kp=kp, kd=kd)
    model.sites.append(ls.Site("tip", "left_tip", ls.pose((0.0, 0.0, 0.045))))
    # Where limits act, as they do in learning, euler is several times as fast as leapfrog, and accurate enough.
    return ls.compile(model, integrator="euler", vary=["gear_ratio", "offset", "drive_gains", "mass"])


class Reach(VectorEnv):
    """Actions change the targets by up to 5 % of a joint's range. Observations: position, velocity and target of the driven
    joints, the tip, and 20 times the way from the tip to the goal. Reward: minus that way's length, m. `seconds` says
    where the time went."""

    def __init__(self, num_envs, **options):
        compiled = plan()
        self.queries = [
            ls.Query("q", compiled.driven_dofs),
            ls.Query("qd", compiled.driven_dofs, 0.2),
            ls.Query("q_target", compiled.driven_dofs),
            ls.Query("site_position", ["tip"]),
        ]
        self.seen = np.zeros((num_envs, OBSERVATIONS), np.float32)
        self.known = np.zeros((num_envs, OBSERVATIONS - 3), np.float32)
        self.goal = np.zeros((num_envs, 3), np.float32)
        self.seconds = {"step": 0.0, "observe": 0.0, "reset": 0.0}
        super().__init__(compiled, num_envs, limit=CONTROL_STEPS, action_kind="position_change", spread=0.5, **options)

    def randomize(self, which):
        start = time.perf_counter()
        batch = self.batch
        batch.randomize("gear_ratio", "scale", 0.95, 1.05, which=which)
        batch.randomize("offset", "add", -0.01, 0.01, which=which)
        batch.randomize("drive_gains", "scale", 0.8, 1.25, distribution="log_uniform", which=which)
        batch.randomize("mass", "scale", 0.8, 1.2, which=which)
        batch.reset_random(which, spread=0.5)  # the goal is where the tip is now
        self.goal[which] = batch.read(self.queries[-1])[which]
        self.seconds["reset"] += time.perf_counter() - start

    def advance(self, actions):
        start = time.perf_counter()
        super().advance(actions)
        self.seconds["step"] += time.perf_counter() - start

    def observe(self):
        start = time.perf_counter()
        self.seen[:, :-3] = self.batch.read(*self.queries, out=self.known)
        self.seen[:, -3:] = 20 * (self.goal - self.known[:, -3:])
        self.seconds["observe"] += time.perf_counter() - start
        return self.seen

    def distance(self):
        """[num_envs] m"""
        return np.linalg.norm(self.goal - self.known[:, -3:], axis=1)

    def reward(self):
        return -self.distance()
