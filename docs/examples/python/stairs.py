#!/usr/bin/env python3
# The quadruped of walk.py learns to walk over stairs. SPDX-License-Identifier: Apache-2.0
"""Six levels of stairs, up and down, on one height field. An environment that walks far enough goes to the next level,
one that does not goes back. It sees the heights around its trunk. Needs torch.

    python3 stairs.py --minutes 10       # learns, tests each level, and prints how far they walk
"""

import argparse
import math

import numpy as np
from ppo import Agent, learn, torch
from walk import CONTROL, Walk

import lockstep as ls
from lockstep.events import Event
from lockstep.terrain import Patch, curriculum

LEVELS, RISE, TREAD = 6, 0.08, 0.36  # m, a rise of the last level
PATCH = Patch(edge=10.0, cell=0.0625, flat=1.4)
SCAN = [(0.15 * i, 0.1 * j) for i in range(-1, 5) for j in (-1, 0, 1)]  # m, ahead and to the left of the trunk
EPISODE = 500  # control steps
FAST = 0.5  # m/s


class Stairs(Walk):
    """levels: [num_envs] to begin at; None: all at the first, and they move between levels by what they walk."""

    def __init__(self, num_envs, levels=None, **options):
        self.stays, self.level = levels is not None, np.zeros(num_envs, int) if levels is None else np.array(levels)
        self.kind = np.arange(num_envs) % 2
        self.terrain = curriculum(PATCH, LEVELS, [lambda d: PATCH.stairs(0.01 + (RISE - 0.01) * d, TREAD),
                                                  lambda d: -PATCH.stairs(0.01 + (RISE - 0.01) * d, TREAD)])
        self.below = ls.Query("height_scan", ["trunk"], points=[(0.0, 0.0)])
        super().__init__(num_envs, commands=(0.2, FAST), floor=self.terrain.shape(), scan=SCAN, limit=EPISODE,
                         events={"levels": Event(move, "randomize")}, vary=["collider_place"], **options)

    def advance(self, actions):
        super().advance(actions)
        trunk = self.batch.read(self.below)  # feet are as high as above the ground below the trunk
        self.heights -= self.batch.root_pose[:, 2:3] - trunk

    def way(self):
        """[num_envs] m from the middle of the patch"""
        return np.hypot(*self.batch.root_pose[:, :2].T)


def move(env, which):
    """Before an episode begins: to the next level where the last one went far enough."""
    way, wanted = env.way(), env.command * (EPISODE * CONTROL)
    ended = which & (env.batch.episode > 0)
    if not env.stays:
        env.level += ended & (way > 0.7 * wanted)
        env.level -= ended & (way < 0.4 * wanted)
        # Who has walked down all levels begins anywhere, so that none is forgotten.
        done = env.level >= LEVELS
        env.level[done] = np.arange(done.sum()) % LEVELS
        np.maximum(env.level, 0, out=env.level)
    at = env.plan.parameter_rows("collider_place").index("floor x")
    env.batch.parameter("collider_place")[which, at : at + 4] = env.terrain.place(env.level, env.kind)[which]


def train(seed, minutes, envs=512, length=24, report=print):
    """An agent after so many minutes of processor time."""
    torch.manual_seed(seed)
    env = Stairs(envs, seed=seed, autoreset_mode="SameStep", threads=1)
    agent, spent = Agent(env, (128, 64)), 0.0
    learning = learn(env, agent, length, 0.99, reward_scale=0.1, goes_on=True, entropy=3e-3, wanted_change=0.01)
    for iteration, (_, seconds) in enumerate(learning):
        spent += sum(seconds.values()) / 60
        if iteration % 10 == 0:
            report(f"{spent:5.1f} min, {(iteration + 1) * envs * length / 1e6:5.2f} million steps, "
                   f"mean level {env.level.mean() + 1:.2f} of {LEVELS}")
        if spent >= minutes:
            return agent


def test(agent, seed, envs=128):
    """New environments at each level, an episode; the policy's mean acts. [levels]: share that does not fall, and mean
    way over that of the command."""
    levels = np.repeat(np.arange(LEVELS), envs)
    env = Stairs(len(levels), levels, seed=seed, first_id=1 << 24, autoreset_mode="NextStep", threads=1)
    seen, fell = env.reset()[0], np.zeros(len(levels), bool)
    way = np.zeros(len(levels))
    for _ in range(EPISODE - 1):
        with torch.no_grad():
            actions = agent.actor(torch.from_numpy(seen["policy"])).numpy()
        seen, _, terminated, _, _ = env.step(actions)
        fell |= terminated
        way = np.where(fell, way, env.way())
    share = way / (env.command * EPISODE * CONTROL)
    return [(1 - fell[levels == level].mean(), share[levels == level].mean()) for level in range(LEVELS)]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=10.0, help="of processor time")
    parser.add_argument("--envs", type=int, default=512)
    options = parser.parse_args()
    torch.set_num_threads(1)
    agent = train(options.seed, options.minutes, options.envs)
    for level, (stands, share) in enumerate(test(agent, 10_000 + options.seed)):
        rise = 0.01 + (RISE - 0.01) * level / (LEVELS - 1)
        print(f"level {level + 1}, steps of {1000 * rise:.0f} mm: {100 * stands:.0f} % do not fall, "
              f"they walk {100 * share:.0f} % of the way")


if __name__ == "__main__":
    main()
