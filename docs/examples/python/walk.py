#!/usr/bin/env python3
# A quadruped learns to walk at a commanded speed. SPDX-License-Identifier: Apache-2.0
"""Twelve servos follow commands of 0 to 0.8 m/s, with noise, pushes, masses and frictions of their own. Needs torch.

    python3 walk.py --seeds 3            # learns, tests, and writes agents, picture and page to the folder walk
    python3 walk.py --model go1.xml      # another robot with twelve servos, round feet and a keyframe
"""

import argparse
import pathlib

import numpy as np

import lockstep as ls
from lockstep.draws import OWN, uniform
from lockstep.events import Event
from lockstep.observations import Group, Term, Uniform
from lockstep.vector import VectorEnv
from ppo import Agent, learn, torch

MODEL = pathlib.Path(__file__).parent / "models" / "quadruped.xml"
DT, SUBSTEPS = 0.005, 4
CONTROL = DT * SUBSTEPS  # s
EPISODE = 1000  # control steps
SCALE = 0.5  # rad of an action of 1
PERIOD, LIFT = 0.5, 0.06  # of the gait, s; of a foot in the air, m
FASTEST = 0.8  # m/s


def scene(path, floor):
    """The model, its trunk and its feet, on a floor of this shape that these may touch, with a site in each foot."""
    model = ls.from_file(path, colliders=True)
    model = ls.from_file(path, colliders=True, keyframe=model.poses[0].name)
    if not any(collider.name == "floor" for collider in model.colliders):
        model.colliders.append(ls.Collider("floor", "", floor, friction=0.7))
    model.colliders["floor"].shape = floor
    trunk = next(root.link for root in model.roots if root.floating)
    ends = [model.colliders[name] for name in model.end_colliders()]
    feet = list({end.link: end for end in ends if end.shape.kind == "sphere"}.values())
    touching = [collider for collider in model.colliders if collider.link == trunk] + feet
    model.contacts = [ls.Contact("floor", collider.name) for collider in touching]
    model.sites.extend(ls.Site(f"sole {foot.name}", foot.link, foot.pose) for foot in feet)
    return model, trunk, feet


class Walk(VectorEnv):
    """floor: a shape. scan: points of the ground around the trunk that are seen. events, vary: beside its own."""

    def __init__(self, num_envs, path=MODEL, commands=(0.0, FASTEST), floor=ls.Shape.half_space(), scan=(), events={},
                 vary=(), **options):
        model, trunk, feet = scene(path, floor)
        plan = ls.compile(model, dt=DT, integrator="euler", vary=["mass", "contact_friction", *vary])
        start = plan.batch(1)
        self.soles = [f"sole {foot.name}" for foot in feet]
        x, y, _ = start.read(ls.Query("site_position", self.soles)).reshape(-1, 3).T - start.root_pose[0, :3, None]
        self.late = np.where(x * y > 0, 0.0, 0.5)  # share of the period: diagonal feet go together, as in a trot
        self.ground = np.array([foot.shape.size[0] for foot in feet], np.float32)  # height of the sites on the floor, m
        self.home = start.q[0].copy()
        drives = [model.joints[name].drive for name in plan.driven_dofs]
        self.kp, self.kd = np.array([(drive.kp, drive.kd) for drive in drives], np.float32).T
        self.commands, self.command = commands, np.zeros(num_envs, np.float32)
        self.actions = self.last_actions = np.zeros((num_envs, len(drives)), np.float32)
        self.elapsed = np.zeros(num_envs, np.int64)
        gravity, touches = ls.Query("link_gravity", [trunk]), ls.Query("link_contacts", [foot.link for foot in feet])
        self.queries = ["root_twist", gravity, ls.Query("link_contacts", [trunk]), touches,
                        ls.Query("site_position", self.soles)]
        terms = {"gravity": (gravity, 0.05, 1), "twist": ("root_twist", 0.1, 1), "q": (joints, 0.02, 1),
                 "qd": ("qd", 1.0, 0.1), "actions": (lambda env: env.actions, 0, 1),
                 "command": (lambda env: env.command, 0, 1), "clock": (clock, 0, 1)}  # what, noise, scale
        noisy = {name: Term(what, scale, noise=Uniform(-noise, noise)) for name, (what, noise, scale) in terms.items()}
        clean = {name: Term(what, scale) for name, (what, _, scale) in terms.items()}
        if scan:  # infinite beyond the edge of the ground
            around = ls.Query("height_scan", [trunk], points=scan)
            noisy["scan"] = Term(around, clip=(-1, 1), noise=Uniform(-0.02, 0.02))
            clean["scan"] = Term(around, clip=(-1, 1))
        super().__init__(
            plan, num_envs, decimation=SUBSTEPS, actions={"scale": SCALE},
            start=ls.Start(model.poses[0].name, position=0.1, velocity=0.5,
                           roots=ls.RootNoise(yaw=3.14, angular_velocity=0.3, linear_velocity=0.3)),
            observe={"policy": Group(noisy), "critic": Group({**clean, "touches": touches})},
            reward={"speed": (1.0, tracks), "turn": (0.4, straight), "gait": (0.5, in_step), "lift": (0.3, lifts),
                    "bounce": (-1.0, lambda env: env.twist[:, 5] ** 2),
                    "roll": (-0.01, lambda env: (env.twist[:, :2] ** 2).sum(1)),
                    "tilt": (-1.0, lambda env: (env.gravity[:, :2] ** 2).sum(1)),
                    "effort": (-2e-4, lambda env: (effort(env) ** 2).sum(1)),
                    "jerk": (-0.01, lambda env: ((env.actions - env.last_actions) ** 2).sum(1)),
                    "posture": (-0.1, lambda env: (joints(env) ** 2).sum(1))},
            terminate={"trunk": lambda env: env.trunk_touches, "tilt": lambda env: env.gravity[:, 2] > -0.5},
            events={"bodies": Event(bodies, "randomize"), "command": Event(command, "reset"),
                    "commands": Event(command, "interval", every=(4.0, 8.0)),
                    "push": Event(push, "interval", every=(5.0, 10.0)), **events},
            **options)

    def advance(self, actions):
        """What rewards and ends need is read once after each control step."""
        self.last_actions, self.actions = self.actions, np.clip(actions, -1, 1)
        super().advance(self.actions)
        seen, feet = self.batch.read(*self.queries), 10 + len(self.soles)
        self.twist, self.gravity, self.trunk_touches = seen[:, :6], seen[:, 6:9], seen[:, 9] > 0
        self.touches, self.heights = seen[:, 10:feet] > 0, seen[:, feet + 2 :: 3] - self.ground
        self.forward = self.twist[:, 3]  # m/s, along the trunk

    def after_reset(self, which):
        self.actions[which] = 0


# --- what is seen, paid, and happens ---------------------------------------------------------


def joints(env):
    """[num_envs, 12] rad from the pose of the keyframe"""
    return env.batch.q - env.home


def phase(env):
    """[num_envs] share of the gait's period, 0 to 1"""
    return env.elapsed * (CONTROL / PERIOD) % 1.0


def clock(env):
    angle = 2 * np.pi * phase(env)
    return np.stack([np.sin(angle), np.cos(angle)], 1)


def swings(env):
    """[num_envs, 4]: which feet should be in the air"""
    return (phase(env)[:, None] + env.late) % 1.0 < 0.5


def tracks(env):
    return np.exp(-((env.forward - env.command) ** 2 + env.twist[:, 4] ** 2) / 0.1)


def straight(env):
    return np.exp(-env.twist[:, 2] ** 2 / 0.1)


def in_step(env):
    return (env.touches != swings(env)).mean(1)


def lifts(env):
    return (np.clip(env.heights / LIFT, 0, 1) * swings(env)).sum(1) / 2


def effort(env):
    """[num_envs, 12] N m that the servos ask for"""
    batch = env.batch
    return env.kp * (batch.q_target - batch.q) - env.kd * batch.qd


def bodies(env, which):
    env.batch.randomize("mass", "scale", 0.9, 1.1, which=which)
    env.batch.randomize("contact_friction", "scale", 0.6, 1.4, shared=True, which=which)


def command(env, which):
    low, high = env.commands
    env.command[which] = (low + (high - low) * uniform(env.batch, np.empty((1, env.num_envs)), OWN)[0])[which]


def push(env, which):
    """Up to 0.5 m/s along the trunk's axes."""
    kick = uniform(env.batch, np.empty((2, env.num_envs)), OWN + 1) - 0.5
    env.batch.rows.root_twist[3:5, which] += kick[:, which]


# --- learning --------------------------------------------------------------------------------


def train(seed, minutes, path=MODEL, envs=512, length=24, iterations=None, report=print):
    """An agent after so many minutes of processor time; the curve: [iterations, 4] minutes, million control steps, mean
    of |speed - command| (m/s), falls of an environment in a minute; and seconds by part."""
    torch.manual_seed(seed)
    env = Walk(envs, path, seed=seed, limit=EPISODE, autoreset_mode="SameStep", threads=1)
    agent = Agent(env, (64, 64))
    spent, curve = {"policy": 0.0, "step": 0.0, "learn": 0.0}, []
    learning = learn(env, agent, length, 0.99, reward_scale=0.1, goes_on=True, entropy=3e-3, wanted_change=0.01)
    for iteration, (infos, seconds) in enumerate(learning):
        spent = {part: spent[part] + seconds[part] for part in spent}
        ends = [info["final_info"]["reason"] for info in infos if "final_info" in info]
        falls = sum(np.isin(reason, ["trunk", "tilt", "fault"]).sum() for reason in ends)
        curve.append((sum(spent.values()) / 60, (iteration + 1) * envs * length / 1e6,
                      np.abs(env.forward - env.command).mean(), falls / (envs * length * CONTROL / 60)))
        if iteration % 10 == 0:
            report("seed %d: %5.1f min, %5.2f million steps, speed error %5.3f m/s, %5.1f falls a minute"
                   % (seed, *curve[-1]))
        if curve[-1][0] >= minutes or iteration + 1 == iterations:
            return agent, np.array(curve), spent


def main():
    import walk_page  # which needs this file

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--model", type=pathlib.Path, default=MODEL, help="MJCF file")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=2.0, help="of processor time for each seed")
    parser.add_argument("--iterations", type=int, help="end learning earlier")
    parser.add_argument("--envs", type=int, default=512)
    parser.add_argument("--tested", type=int, default=1024, help="environments of the test")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("walk"), help="folder for what is written")
    parser.add_argument("--mujoco", help="folder of @mujoco/mujoco from npm: node lets the first agent walk there, too")
    options = parser.parse_args()
    torch.set_num_threads(1)
    options.out.mkdir(parents=True, exist_ok=True)
    runs = {}
    for seed in range(1, options.seeds + 1):
        agent, curve, spent = train(seed, options.minutes, options.model, options.envs, iterations=options.iterations)
        result = walk_page.test(agent, 10_000 + seed, options.model, options.tested)
        print(f"seed {seed}: {100 * result['near'].mean():.1f} % succeed, {100 * result['fell'].mean():.1f} % fall")
        walk_page.export(agent, options.model, options.out / f"agent{seed}.json")
        runs[seed] = agent, curve, spent, result
    mujoco = walk_page.in_mujoco(options.out / "agent1.json", options.mujoco) if options.mujoco else None
    walk_page.write(options.out, options.model, runs, walk_page.rate(options.model, options.tested), mujoco)


if __name__ == "__main__":
    main()
