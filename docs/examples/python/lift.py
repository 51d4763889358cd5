# An arm with a mimic gripper learns to lift cubes of three sizes. SPDX-License-Identifier: Apache-2.0
"""Needs torch, and matplotlib for the curve. The hand points down; inverse kinematics makes joint targets of its place.
A reach brings it around the cube. The policy learns what to add to the reach's steps, and how to move the gripper's one
driven joint, which three joints follow. Cubes have a size of their own in each environment; what they weigh, how they
slip and where they lie is different in every episode.

    python3 lift.py                    # three seeds; writes lift.md, lift.svg and the policies to build/
    python3 lift.py --seeds 1 --minutes 1 --out /tmp
"""

import pathlib

import numpy as np

import torch
from outcome import arguments, draw_curves, in_mujoco, learn_and_tell, random_rate
from ppo import Agent, learn

import lockstep as ls
from lockstep.vector import Box, VectorEnv

MODEL = pathlib.Path(__file__).parent / "models" / "arm.xml"
SIZES = (0.03, 0.04, 0.05)  # m
NAMES = [f"{1000 * size:.0f} mm" for size in SIZES]
ARM = ["yaw", "shoulder", "elbow", "bend", "roll"]
CONTROL_STEPS, DECIMATION, DT = 100, 8, 0.005  # 4 s
STEP = np.array([0.02, 0.02, 0.02, 0.2], np.float32)  # of an action of 1, m and rad; the reach has half
HEIGHT, HOLD = 0.1, 25  # m above the floor, for the last second
LOW, HIGH = np.array([0.28, -0.18, 0.03], np.float32), np.array([0.5, 0.18, 0.25], np.float32)  # of the hand, m


class Lift(VectorEnv):
    """Actions: what is added to the reach's steps of the hand, up to 2 cm along x, y and z and 0.2 rad about z; and how
    far the gripper is closed. Reward: to be near, to grip with both pads, to lift, to move little. `success` is 1 in
    the last step of an episode in which the cube was held for its last second. sizes: [num_envs] of the cubes, m."""

    def __init__(self, sizes, **options):
        self.size, num_envs = np.asarray(sizes, np.float32), len(sizes)
        self.won = np.full(num_envs, -1)  # whether the episode was a success, once it has ended
        self.outcomes = []  # of episodes: sizes, and whether they were a success
        self.hand = np.zeros((num_envs, 4), np.float32)  # where it shall be: x, y, z and the angle about z
        self.pose = np.zeros((num_envs, 7), np.float32)
        self.held = np.zeros(num_envs, np.int64)  # control steps
        compiled = ls.compile(ls.from_mjcf(MODEL, colliders=True), dt=DT, integrator="euler",
                              contact_settings="learning", vary=["mass", "inertia", "contact_friction", "collider_size"])
        self.arm = [compiled.dof(name) for name in ARM]
        self.kinematics = compiled.batch(num_envs, threads=1)
        self.queries = [ls.Query("site_position", ["grip"]), ls.Query("root_pose"), ls.Query("root_twist"),
                        ls.Query("q", ["knuckle"]),
                        ls.Query("contact_normal_force", ["left_pad-cube", "right_pad-cube"])]
        self.split(np.zeros((num_envs, 19), np.float32))
        start = ls.Start("ready", position=0.03, roots=ls.RootNoise(position=(0.1, 0.15, 0.0), yaw=np.pi))
        super().__init__(compiled, num_envs, start=start, limit=CONTROL_STEPS, decimation=DECIMATION, **options)
        self.single_action_space = Box(-1.0, 1.0, (5,), np.float32)
        self.action_space = Box(-1.0, 1.0, (num_envs, 5), np.float32)

    def randomize(self, which):
        pairs = [name for name in self.plan.contact_names if name.endswith("cube")]
        self.batch.randomize("mass", "absolute", 0.03, 0.3, distribution="log_uniform", which=which, rows=["cube"])
        self.batch.randomize("contact_friction", "absolute", 0.5, 1.0, which=which, rows=pairs, shared=True)
        mass = self.cube_rows("mass", "", 1)
        self.cube_rows("collider_size", " x", 3)[which] = self.size[which, None]
        self.cube_rows("inertia", " ixx", 3)[which] = (mass[:, 0] * self.size ** 2 / 6)[which, None]

    def cube_rows(self, field, first, count):
        """[num_envs, count] of a parameter"""
        at = self.plan.parameter_rows(field).index("cube" + first)
        return self.batch.parameter(field)[:, at : at + count]

    def after_reset(self, which):
        ended = which & (self.won >= 0)
        self.outcomes.append((self.size[ended], self.won[ended]))
        self.won[which] = -1
        self.batch.root_pose[which, 2] = self.size[which] / 2
        self.look()
        self.hand[which, :3] = self.at[which]
        self.hand[which, 3] = self.angle()[which]
        self.held[which] = 0

    def look(self):
        self.split(self.batch.read(*self.queries))

    def split(self, numbers):
        self.at, pose, self.twist, self.knuckle, self.force = np.split(numbers, (3, 10, 16, 17), axis=1)
        self.cube, self.turn = pose[:, :3], 2 * np.arctan2(pose[:, 6], pose[:, 3])
        self.bottom = self.cube[:, 2] - self.size / 2

    def angle(self):
        """[num_envs] of the hand about the vertical, rad"""
        return self.batch.q[:, self.arm[0]] - self.batch.q[:, self.arm[-1]]

    def in_hand(self):
        """[num_envs, 3]: the cube's place along the axes of the hand, m"""
        (x, y, z), c, s = (self.cube - self.at).T, np.cos(self.angle()), np.sin(self.angle())
        return np.column_stack([c * x + s * y, c * y - s * x, z])

    def reach(self):
        """[num_envs, 4]: the way to above the cube, from there to around it, and the nearest turn to its sides"""
        way = np.column_stack([self.cube, self.turn]) - self.hand
        way[:, 2] += 0.08 * (np.abs(way[:, :2]).max(axis=1) > 0.015)
        way[:, 3] = np.remainder(way[:, 3] + np.pi / 4, np.pi / 2) - np.pi / 4
        return way

    def advance(self, actions):
        actions = np.clip(actions, -1, 1)
        self.effort = np.square(actions[:, :4]).sum(axis=1)
        self.hand += np.clip(self.reach(), -STEP / 2, STEP / 2) + STEP * actions[:, :4]
        np.clip(self.hand[:, :3], LOW, HIGH, out=self.hand[:, :3])
        self.pose[:, :3] = self.hand[:, :3]
        self.pose[:, 4], self.pose[:, 5] = -np.sin(self.hand[:, 3] / 2), np.cos(self.hand[:, 3] / 2)
        self.kinematics.q[:] = self.batch.q_target
        self.kinematics.inverse_kinematics("grip", self.pose, iterations=2)
        self.batch.q_target[:, self.arm] = self.kinematics.q[:, self.arm]
        self.batch.act(actions[:, 4:], joints=["knuckle"])
        self.batch.step(self.decimation)
        self.look()
        self.held = np.where(self.bottom > HEIGHT, self.held + 1, 0)

    def observe(self):
        turn = 4 * (self.turn - self.hand[:, 3])  # a cube looks the same after a quarter turn
        return np.column_stack([
            10 * (self.cube - self.at), 20 * (self.hand[:, :3] - self.at), np.cos(turn), np.sin(turn),
            5 * self.at[:, 2], 5 * self.bottom, self.twist, 2 * self.knuckle, np.minimum(self.force / 20, 1),
            20 * self.size])

    def reward(self):
        near = 1 - np.tanh(8 * np.linalg.norm(self.cube - self.at, axis=1))
        grip = np.clip(self.force / 10, 0, 1).min(axis=1)
        self.won = ((self.held >= HOLD) & (self.elapsed >= self.limit)).astype(int)
        return {"near": 0.1 * near, "grip": 0.1 * grip, "lift": np.clip(self.bottom / 0.15, 0, 1) * (grip > 0),
                "effort": -0.005 * self.effort, "success": 1.0 * self.won}

    def terminate(self):
        out = np.abs(self.cube[:, :2] - [0.4, 0.0]) > [0.25, 0.3]
        return {"lost": out.any(axis=1)}


class Staggered(Lift):
    """Episodes begin at different times, so that updates see all of one. `num_envs` cubes of each size."""

    def __init__(self, num_envs, **options):
        super().__init__(np.repeat(SIZES, num_envs), threads=1, autoreset_mode="SameStep", **options)

    def reset(self, **options):
        seen = super().reset(**options)
        self.elapsed[:] = np.arange(self.num_envs) * self.limit // self.num_envs
        return seen


def train(seed, minutes, envs=64, length=25, iterations=None, report=print):
    """An agent after so many minutes of processor time, and its curve: minutes, then the success of each size."""
    torch.manual_seed(seed)
    env, now, curve, rewards = Staggered(envs, seed=seed), 0.0, [], []
    agent = Agent(env, (64, 64))
    for iteration, (infos, seconds) in enumerate(learn(env, agent, length, 0.97, goes_on=True)):
        now += sum(seconds.values()) / 60
        rewards += [info["log"]["reward/total"] for info in infos if "log" in info]
        ends = now >= minutes or iteration + 1 == iterations
        if iteration % 4 == 3 or ends:
            sizes, won = (np.concatenate(column) for column in zip(*env.outcomes))
            success = [won[np.isclose(sizes, size)].mean() if np.isclose(sizes, size).any() else 0.0 for size in SIZES]
            reward = np.mean(rewards or [0.0])
            curve.append((now, *success))
            rewards = []
            env.outcomes.clear()
            report(f"{now:5.2f} min   reward {reward:6.2f}   success: " +
                   ", ".join(f"{name} {100 * share:3.0f} %" for name, share in zip(NAMES, success)))
        if ends:
            return agent, np.array(curve)


def test(agent, seed, envs=1024):
    """One episode of new environments; the policy's mean acts. By size: [envs] whether the cube was held, how far it
    slipped in the hand in the last second, m, and the force of the pads then, N."""
    results = []
    for size in SIZES:
        env = Lift(np.full(envs, size), seed=seed, first_id=1 << 24, threads=1)
        seen, lost = env.reset()[0], np.zeros(envs, bool)
        for step in range(CONTROL_STEPS):
            with torch.no_grad():
                seen, _, terminated, _, _ = env.step(agent.actor(torch.from_numpy(seen)).numpy())
            lost |= terminated
            if step == CONTROL_STEPS - HOLD:
                before = env.in_hand()
        slip = np.linalg.norm(env.in_hand() - before, axis=1)
        results.append((~lost & (env.held >= HOLD), slip, env.force.mean(axis=1)))
    return results


def compare(module, policies):
    """The paragraph about MuJoCo: held cubes by size and policy, and rates with random actions."""
    fares = [in_mujoco("lift_mujoco.mjs", module, policy) for policy in policies]
    rates = [random_rate(Lift(np.full(256, size), threads=1, autoreset_mode="SameStep")) for size in SIZES]
    rows = []
    for i, name in enumerate(NAMES):
        held = ", ".join(f"{100 * fare[i]['held']:.0f} %" for fare in fares)
        peer = np.median([fare[i]["control_steps_per_s"] for fare in fares])
        rows.append(f"| {name} | {held} | {rates[i]:,.0f} | {peer:,.0f} |")
    return COMPARED + "\n".join(rows) + "\n"


def write_page(out, minutes, envs, curves, results, compared=""):
    draw_curves(out / "lift.svg", curves, NAMES, "held, %", 100)
    held = [np.mean([own for own, _, _ in result]) for result in results]
    rows = []
    for i, name in enumerate(NAMES):
        own, slip, force = (np.concatenate([result[i][k] for result in results]) for k in range(3))
        shares = ", ".join(f"{100 * result[i][0].mean():.1f} %" for result in results)
        middle, most = np.percentile(1e3 * slip[own], (50, 99)) if own.any() else (np.nan, np.nan)
        rows.append(f"| {name} | {shares} | {middle:.2f}, {most:.2f} mm | {np.median(force):.0f} N |")
    (out / "lift.md").write_text(PAGE.format(
        seeds=len(curves), minutes=minutes, envs=envs, each=len(results[0][0][0]), median=100 * np.median(held),
        held=", ".join(f"{100 * share:.1f} %" for share in held), rows="\n".join(rows)) + compared)


def told(result):
    return ", ".join(f"{name} {100 * held.mean():.1f} %" for name, (held, _, _) in zip(NAMES, result))


def main():
    options = arguments(__doc__, 1.0, 64, 1024, "environments of each size")
    learn_and_tell("lift", options, train, test, told, compare, write_page)


PAGE = """# An arm lifts cubes

[lift.py](lift.py) wrote this page; it needs torch and matplotlib. An arm of five servos with a gripper of one servo
and three mimic joints ([arm.xml](models/arm.xml)) stands over a cube of 30, 40 or 50 mm. The cube lies anywhere in 20
by 30 cm, turned by any angle. It weighs 30 to 300 g and has a friction of 0.5 to 1.0. An episode lasts 4 s. It is a
success if the cube's bottom is more than 0.1 m above the floor for all of the last second.

The hand follows a reach by inverse kinematics: to above the cube, then to around it, turned to its sides. PPO
([ppo.py](ppo.py)) learns what is added to each step of the hand, up to twice the reach's own, and how far the gripper
is open. So the reach finds the cube; to close, to lift, to hold and not to lose it is learned.

{seeds} seeds, {minutes:g} minutes of processor time each on one thread, with {envs} environments of each size. In
{each} new environments of each size the policy's mean acts. Held, by seed: {held}; the median is {median:.1f} %.

![Share of episodes in which the cube was held, over processor time](lift.svg)

The curve has episodes of learning, with the policy's noise.

| cube | held, by seed | moved in the hand in the last second: median, 99 % | force of a pad, median |
|---|---|---|---|
{rows}
"""
COMPARED = """
## In MuJoCo

The same policies in MuJoCo's WebAssembly build ([lift_mujoco.mjs](lift_mujoco.mjs)), 25 episodes each; contacts and
couplings are soft there. Control steps of 8 steps of 5 ms a second of processor time, with random actions, one thread;
a native build of MuJoCo makes about 1.33 times as many, which is an estimate. lockstep has 256 environments, and its
figure has the observations and rewards in numpy.

| cube | held in MuJoCo, by seed | control steps a second: lockstep | MuJoCo |
|---|---|---|---|
"""

if __name__ == "__main__":
    main()
