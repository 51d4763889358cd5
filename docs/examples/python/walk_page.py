# Tests a walker that has learned, and writes its page. SPDX-License-Identifier: Apache-2.0
"""What walk.py does after learning: new environments, MuJoCo, the picture and the page."""

import json
import pathlib
import subprocess
import textwrap
import time

import numpy as np
from ppo import torch
from walk import CONTROL, DT, EPISODE, PERIOD, SCALE, SUBSTEPS, Walk, effort

COMMAND, NEAR = 0.5, 0.1  # m/s
SETTLED = 100  # control steps of a test that its means leave out


def mean_action(agent, seen):
    with torch.no_grad():
        return agent.actor(torch.from_numpy(seen)).numpy()


def test(agent, seed, path, envs=1024):
    """New environments with noise, pushes, masses and frictions for an episode; the policy's mean acts. By environment:
    whether it fell; whether it did not, at a mean speed near the command; and means: speed along the trunk (m/s), power
    that drives give (W), share of the time that a foot is in the air, the highest foot (m), and the deviation of the
    trunk's height (m)."""
    env = Walk(envs, path, (COMMAND, COMMAND), seed=seed, first_id=1 << 24, limit=EPISODE + 1,
               autoreset_mode="SameStep", threads=1)
    seen, fell, sums, trunk = env.reset()[0], np.zeros(envs, bool), np.zeros((4, envs)), []
    for step in range(EPISODE):
        seen, _, terminated, _, _ = env.step(mean_action(agent, seen["policy"]))
        fell |= terminated
        if step >= SETTLED:
            power = np.maximum(effort(env) * env.batch.qd, 0).sum(1)
            sums += env.forward, power, (~env.touches).mean(1), env.heights.max(1)
            trunk.append(env.batch.root_pose[:, 2].copy())
    speed, power, air, lift = sums / len(trunk)
    return {"fell": fell, "near": ~fell & (np.abs(speed - COMMAND) < NEAR), "speed": speed, "power": power, "air": air,
            "lift": lift, "bob": np.std(trunk, 0)}


def record(agent, path, steps=200):
    """One environment that sees no noise: time (s), [steps], and heights of the soles (m), [steps, feet]."""
    env = Walk(1, path, (COMMAND, COMMAND), seed=99, autoreset_mode="SameStep", threads=1)
    seen, heights = env.reset()[0], []
    for _ in range(steps):
        clean = np.ascontiguousarray(seen["critic"][:, : seen["policy"].shape[1]])
        seen = env.step(mean_action(agent, clean))[0]
        heights.append(env.heights[0].copy())
    return CONTROL * np.arange(steps), np.array(heights), env.soles


def export(agent, path, file):
    """What walk_mujoco.mjs needs, as JSON."""
    layers = [layer for layer in agent.actor if isinstance(layer, torch.nn.Linear)]
    file.write_text(json.dumps({
        "xml": pathlib.Path(path).read_text(), "dt": DT, "substeps": SUBSTEPS, "episode": EPISODE, "settled": SETTLED,
        "period": PERIOD, "scale": SCALE, "home": Walk(1, path).home.tolist(), "command": COMMAND, "near": NEAR,
        "layers": [{"weight": layer.weight.tolist(), "bias": layer.bias.tolist()} for layer in layers]}))


def in_mujoco(agent_file, module, starts=64):
    """What walk_mujoco.mjs prints."""
    script = pathlib.Path(__file__).parent / "walk_mujoco.mjs"
    done = subprocess.run(["node", "--no-liftoff", script, module, agent_file, str(starts)], stdout=subprocess.PIPE,
                          text=True, check=True)
    return json.loads(done.stdout)


def rate(path, envs, steps=50):
    """Control steps a second of processor time with random actions: of the environment, of Batch.step() alone."""
    env, random, seconds = Walk(envs, path, autoreset_mode="SameStep", threads=1), np.random.default_rng(1), [0.0, 0.0]
    env.reset()
    for i in range(-20, steps):
        actions = random.uniform(-1, 1, env.action_space.shape).astype(np.float32)
        begin = time.process_time()
        env.step(actions)
        middle = time.process_time()
        env.batch.step(SUBSTEPS)  # by the same targets
        if i >= 0:
            seconds[0] += middle - begin
            seconds[1] += time.process_time() - middle
    return [steps * envs / spent for spent in seconds]


def draw(curves, walk, file):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (errors, falls, gait) = plt.subplots(1, 3, figsize=(12, 3.4), layout="constrained")
    for seed, curve in curves.items():
        errors.plot(curve[:, 0], curve[:, 2], label=f"seed {seed}")
        falls.plot(curve[:, 0], curve[:, 3])
    minutes = "processor time, min"
    errors.set(xlabel=minutes, ylabel="mean |speed - command|, m/s", title="Speed while learning", ylim=(0, None))
    errors.legend()
    falls.set(xlabel=minutes, ylabel="of an environment in a minute", title="Falls while learning", ylim=(0, None))
    times, heights, soles = walk
    for foot, name in enumerate(soles):
        gait.plot(times[-75:], 100 * heights[-75:, foot] + 10 * foot, label=name.removeprefix("sole "))
    gait.set(xlabel="time, s", ylabel="height of the soles, cm; 10 cm apart", title=f"A walk at {COMMAND} m/s",
             ylim=(-2, 10 * len(soles) + 10))
    gait.legend(loc="upper center", ncols=len(soles), fontsize="small", handlelength=1.0, columnspacing=1.0)
    for axes in (errors, falls, gait):
        axes.grid(True, alpha=0.3)
    figure.savefig(file, dpi=110)


def row(seed, run):
    _, curve, _, result = run
    walked = ~result["fell"] if not result["fell"].all() else slice(None)
    speed, power, air, lift, bob = (result[name][walked].mean() for name in ("speed", "power", "air", "lift", "bob"))
    return (f"| {seed} | {curve[-1, 0]:.1f} | {curve[-1, 1]:.1f} | {100 * result['near'].mean():.1f} % | "
            f"{100 * result['fell'].mean():.1f} % | {speed:.3f} | {power:.0f} | {100 * air:.0f} % | {100 * lift:.1f} | "
            f"{1000 * bob:.0f} |")


def write(folder, path, runs, rates, mujoco=None):
    """The page and its picture. runs: {seed: (agent, curve, seconds by part, result of test())}."""
    first, *_, result = next(iter(runs.values()))
    draw({seed: run[1] for seed, run in runs.items()}, record(first, path), folder / "walk.png")
    spent = sum(np.array(list(run[2].values())) for run in runs.values())
    policy, step, learning = 100 * spent / spent.sum()
    peer = mujoco and f"""
        MuJoCo (the WebAssembly build of npm, one environment at a time) makes {mujoco['random_steps_per_s']:,} with
        random actions on the same file. A native build makes about 1.33 times as many, which is an estimate. There the
        policy of seed 1 walks from {mujoco['starts']} starts with the same kinds of noise, pushes, masses and
        frictions: {100 * mujoco['success']:.0f} % succeed, {100 * mujoco['fell']:.0f} % fall, at
        {mujoco['speed']:.3f} m/s in the mean, {mujoco['error']:.3f} m/s from the command (`walk_mujoco.mjs`)."""
    parts = ["# A quadruped learns to walk", f"""
        `walk.py` wrote this page about `{pathlib.Path(path).name}`. A trunk on four legs with twelve servos is told how
        fast to go forward, 0 to 0.8 m/s. The policy sees its twist, gravity, joints, last actions and a clock of two
        steps of a trot in {PERIOD} s, with noise. Masses differ by 10 %, friction by 40 %, starts by 0.1 rad, any yaw,
        0.5 rad/s and 0.3 m/s. Every 5 to 10 s a push changes the velocity by up to 0.5 m/s along two axes of the trunk.
        PPO (`ppo.py`) teaches networks with two layers of 64, in f32 by `euler` at {1 / DT:.0f} Hz, with
        {1 / CONTROL:.0f} actions a second.""", f"""
        The test: {len(result['fell']):,} new environments with all of that, the command {COMMAND} m/s,
        {EPISODE * CONTROL:.0f} s, no exploration. An environment succeeds if it does not fall and its mean speed after
        {SETTLED * CONTROL:.0f} s is within {NEAR} m/s of the command. Speed, power that the drives give, share of the
        time that a foot is in the air, height of the highest foot and deviation of the trunk's height are means of
        those that do not fall.""",
        "\n".join(["| seed | processor time, min | million steps | succeed | fall | speed, m/s | power, W "
                   "| in the air | highest foot, cm | trunk, mm |", "|---" * 10 + "|",
                   *(row(*run) for run in runs.items())]), f"""
        Of the processor time of learning the policy takes {policy:.0f} %, the environment {step:.0f} %, PPO
        {learning:.0f} %.""", "![Curves of learning, and the feet of a walk](walk.png)", f"""
        With random actions one thread makes {rates[0]:,.0f} control steps (of {SUBSTEPS} steps) in a second of
        processor time with observations, rewards and resets, {rates[1]:,.0f} in `Batch.step()` alone. {peer or ''}"""]
    fill = lambda part: part if part[0] in "|!" else textwrap.fill(" ".join(part.split()), 120, break_on_hyphens=False)
    (folder / "walk.md").write_text("\n\n".join(map(fill, parts)) + "\n")
