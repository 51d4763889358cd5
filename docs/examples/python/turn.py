# A hand with tendons learns to turn a cube in its palm. SPDX-License-Identifier: Apache-2.0
"""Needs torch, and matplotlib for the curve. Twelve servos move four fingers: one spreads each, one bends its base, one
pulls the tendon that bends the two outer joints. What the cube weighs and how it slips is different in every
environment and every episode.

    python3 turn.py                    # three seeds; writes turn.md, turn.svg and the policies to build/
    python3 turn.py --seeds 1 --minutes 1 --out /tmp
"""

import pathlib

import numpy as np

import torch
from outcome import arguments, draw_curves, in_mujoco, learn_and_tell, random_rate
from ppo import Agent, learn

import lockstep as ls
from lockstep.observations import Group, Term
from lockstep.vector import VectorEnv

MODEL = pathlib.Path(__file__).parent / "models" / "hand.xml"
CONTROL_STEPS, DECIMATION, DT = 250, 8, 0.005  # 10 s


def plan():
    return ls.compile(ls.from_mjcf(MODEL, colliders=True), dt=DT, integrator="euler", contact_settings="learning",
                      vary=["mass", "contact_friction"])


class Turn(VectorEnv):
    """Actions change the servos' targets by up to 5 % of their ranges. Reward: how far the cube has turned about the
    vertical, rad. An episode ends when the cube tilts or leaves the palm."""

    def __init__(self, num_envs, **options):
        self.angle = np.zeros(num_envs, np.float32)  # of the cube about the vertical
        self.turned = np.zeros(num_envs, np.float32)  # in this control step, rad
        self.cube = np.zeros((num_envs, 7), np.float32)
        links = [f"{finger}_{i}-cube" for finger in ("index", "middle", "ring", "thumb") for i in (1, 2, 3)]
        compiled = plan()
        see = Group({"q": ls.Query("q", compiled.independent_dofs, 2.0),
                     "qd": ls.Query("qd", compiled.independent_dofs, 0.1),
                     "target": ls.Query("q_target", compiled.driven_dofs, 2.0),
                     "place": lambda env: 30 * (env.cube[:, :3] - [-0.005, 0, 0.04]), "side": Turn.side,
                     "speed": Term("root_twist", clip=(-5, 5), scale=0.3),
                     "touch": Term(ls.Query("contact_normal_force", links), clip=(0, 20), scale=0.1)})
        near = ls.RootNoise(position=(0.003, 0.003, 0.0), yaw=0.3)
        super().__init__(compiled, num_envs, observe={"policy": see}, limit=CONTROL_STEPS, decimation=DECIMATION,
                         action_kind="position_change", start=ls.Start("open", position=0.03, roots=near),
                         reward={"turn": (1.0, lambda env: env.turned), "act": (-1e-5, lambda env: env.effort),
                                 "drop": (-1.0, Turn.dropped)},
                         terminate={"dropped": Turn.dropped}, **options)

    def randomize(self, which):
        self.batch.randomize("mass", "absolute", 0.05, 0.2, distribution="log_uniform", which=which, rows=["cube"])
        self.batch.randomize("contact_friction", "absolute", 0.5, 1.0, which=which, shared=True)

    def after_reset(self, which):
        self.look()
        self.turned[which] = 0

    def look(self):
        self.cube = self.batch.read("root_pose")
        self.angle = 2 * np.arctan2(self.cube[:, 6], self.cube[:, 3])

    def side(self):
        """A cube looks the same after a quarter turn. And its axis that was vertical."""
        x, y = self.cube[:, 4:6].T
        return np.column_stack([np.cos(4 * self.angle), np.sin(4 * self.angle), self.upright(), 2 * x, 2 * y])

    def upright(self):
        return 1 - 2 * (self.cube[:, 4] ** 2 + self.cube[:, 5] ** 2)

    def advance(self, actions):
        self.effort = np.square(actions).sum(axis=1)
        before = self.angle
        super().advance(np.clip(actions, -1, 1))
        self.look()
        self.turned = np.remainder(self.angle - before + np.pi, 2 * np.pi) - np.pi

    def dropped(self):
        return (np.abs(self.cube[:, :3] - [-0.005, 0, 0.05]) > [0.04, 0.04, 0.03]).any(axis=1) | (self.upright() < 0.8)


def train(seed, minutes, envs=256, length=25, iterations=None, report=print):
    """An agent after so many minutes of processor time, and its curve: minutes, speed of the cube about the vertical in
    rad/s, share of the episodes in which it was dropped."""
    torch.manual_seed(seed)
    env, now, curve, logs = Turn(envs, seed=seed, threads=1, autoreset_mode="SameStep"), 0.0, [], []
    agent = Agent(env, (64, 64))
    for iteration, (infos, seconds) in enumerate(learn(env, agent, length, 0.97, reward_scale=50.0, goes_on=True)):
        if iteration == 0:
            env.elapsed[:] = np.arange(envs) * env.limit // envs  # so that an update sees all of an episode
        now += sum(seconds.values()) / 60
        logs += [info["log"] for info in infos if "log" in info]
        ends = now >= minutes or iteration + 1 == iterations
        if logs and (iteration % 10 == 9 or ends):
            turned, steps, dropped = (np.mean([log[name] for log in logs])
                                      for name in ("reward/turn", "episode/length", "end/dropped"))
            curve.append((now, turned / (steps * DECIMATION * DT), dropped))
            report(f"{now:5.2f} min   {curve[-1][1]:6.3f} rad/s   dropped in {100 * dropped:5.1f} % of the episodes")
            logs = []
        if ends:
            return agent, np.array(curve).reshape(-1, 3)


def test(agent, seed, envs=1024):
    """One episode of new environments; the policy's mean acts. [envs] how far the cube was turned, rad, its largest
    tilt, rad, and whether it was dropped."""
    env = Turn(envs, seed=seed, first_id=1 << 24, threads=1)
    seen, _ = env.reset()
    turned, tilt, dropped = np.zeros(envs), np.zeros(envs), np.zeros(envs, bool)
    for _ in range(CONTROL_STEPS):
        with torch.no_grad():
            seen, _, terminated, _, _ = env.step(agent.actor(torch.from_numpy(seen)).numpy())
        dropped |= terminated
        turned += np.where(dropped, 0.0, env.turned)
        tilt = np.where(dropped, tilt, np.maximum(tilt, np.arccos(np.clip(env.upright(), -1, 1))))
    return turned, tilt, dropped


def compare(module, policies):
    """The paragraph about MuJoCo: how the policies fare there, and rates with random actions."""
    fares = [in_mujoco("turn_mujoco.mjs", module, policy)[0] for policy in policies]
    return COMPARED.format(
        speeds=", ".join(f"{fare['rad_per_s']:.3f} rad/s" for fare in fares),
        drops=", ".join(f"{100 * fare['dropped']:.0f} %" for fare in fares),
        rate=random_rate(Turn(256, threads=1, autoreset_mode="SameStep")),
        peer=np.median([fare["control_steps_per_s"] for fare in fares]))


def write_page(out, minutes, envs, curves, results, compared=""):
    draw_curves(out / "turn.svg", curves, ["cube"], "rad/s about the vertical")
    seconds = CONTROL_STEPS * DECIMATION * DT
    rows = [f"| {100 * dropped.mean():.1f} % | {turned.mean() / seconds:.3f} rad/s | "
            f"{', '.join(f'{np.degrees(q):.0f}°' for q in np.percentile(turned, (5, 50, 95)))} | "
            f"{np.degrees(np.median(tilt)):.0f}° |" for turned, tilt, dropped in results]
    speeds = [turned.mean() / seconds for turned, _, _ in results]
    (out / "turn.md").write_text(PAGE.format(seeds=len(curves), minutes=minutes, envs=envs, each=len(results[0][0]),
                                             median=np.median(speeds), rows="\n".join(rows)) + compared)


def told(result):
    turned, _, dropped = result
    return f"turned by {np.degrees(turned.mean()):.0f} degrees, dropped {100 * dropped.mean():.1f} %"


def main():
    options = arguments(__doc__, 3.0, 256, 1024, "environments")
    learn_and_tell("turn", options, train, test, told, compare, write_page)


PAGE = """# A hand turns a cube

[turn.py](turn.py) wrote this page; it needs torch and matplotlib. A hand of four fingers ([hand.xml](models/hand.xml))
holds a cube of 50 mm in its palm. Twelve servos move sixteen joints: one spreads a finger, one bends its base, and one
pulls the tendon that bends the two outer joints. The cube weighs 50 to 200 g and has a friction of 0.5 to 1.0. An
episode lasts 10 s, or ends when the cube tilts by more than 37° or leaves the palm.

PPO ([ppo.py](ppo.py)) is paid for the angle by which the cube turns about the vertical, and a drop costs as much as a
radian. Seeds: {seeds}; each had {minutes:g} minutes of processor time on one thread, with {envs} environments. In {each}
new environments the policy's mean acts. There the cube turns at {median:.3f} rad/s, the median of the seeds:

| dropped | speed | turned in 10 s: 5 %, median, 95 % | largest tilt, median |
|---|---|---|---|
{rows}

![Speed of the cube over processor time](turn.svg)

The curve has episodes of learning, with the policy's noise.
"""
COMPARED = """
## In MuJoCo

In MuJoCo's WebAssembly build ([turn_mujoco.mjs](turn_mujoco.mjs)) the same policies turn the cube at {speeds}, and drop
it in {drops} of 10 episodes each. With random actions it makes {peer:,.0f} control steps of 8 steps of 5 ms a second of
processor time, lockstep {rate:,.0f} with 256 environments, one thread, and the observations and rewards in numpy. A
native build of MuJoCo makes about 1.33 times as many, which is an estimate.
"""

if __name__ == "__main__":
    main()
