# What the learning examples write: curves, and policies for other simulators. SPDX-License-Identifier: Apache-2.0
import argparse
import json
import pathlib
import subprocess
import time

import numpy as np
import torch


def arguments(text, minutes, envs, test, what):
    """The options of a learning example."""
    parser = argparse.ArgumentParser(description=text)
    parser.add_argument("--minutes", type=float, default=minutes, help="of processor time, for each seed")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--envs", type=int, default=envs, help=what)
    parser.add_argument("--test", type=int, default=test, help=f"new environments{what.removeprefix('environments')}")
    parser.add_argument("--iterations", type=int, help="end after so many at most")
    parser.add_argument("--mujoco", metavar="MODULE", help="folder of @mujoco/mujoco: compare with it, by node")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("build"), help="folder of what is written")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)
    return options


def learn_and_tell(name, options, train, test, told, compare, write_page):
    """Teaches an agent by each seed, tests it, keeps its policy, and writes the page. told(result) is a line of it."""
    curves, results, policies = [], [], []
    for seed in options.seeds:
        print(f"seed {seed}", flush=True)
        agent, curve = train(seed, options.minutes, options.envs, iterations=options.iterations)
        curves.append(curve)
        results.append(test(agent, seed, options.test))
        print(f"new environments: {told(results[-1])}", flush=True)
        policies.append(options.out / f"{name}-{seed}.json")
        save_policy(agent, policies[-1])
    compared = compare(options.mujoco, policies) if options.mujoco else ""
    write_page(options.out, options.minutes, options.envs, curves, results, compared)


def save_policy(agent, path):
    """For mujoco_policy.mjs: weights and biases of the policy's mean, layer by layer."""
    layers = [layer for layer in agent.actor if isinstance(layer, torch.nn.Linear)]
    path.write_text(json.dumps({"layers": [{"weight": layer.weight.tolist(), "bias": layer.bias.tolist()}
                                           for layer in layers]}))


def random_rate(env, count=200):
    """Control steps a second of processor time with random actions."""
    random = np.random.default_rng(0)
    actions = random.uniform(-1, 1, (count, *env.action_space.shape)).astype(np.float32)
    env.reset()
    begin = time.process_time()
    for own in actions:
        env.step(own)
    return count * env.num_envs / (time.process_time() - begin)


def in_mujoco(program, module, policy):
    """What this program beside here prints about a policy's file: a dict for each line."""
    done = subprocess.run(["node", "--no-liftoff", pathlib.Path(__file__).parent / program, module, policy],
                          capture_output=True, text=True, check=True)
    return [json.loads(line) for line in done.stdout.splitlines()]


def draw_curves(path, curves, names, what, scale=1.0):
    """curves: by seed [rows, 1 + names]; minutes of processor time come first."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6, 3.2), layout="constrained")
    for i, name in enumerate(names):
        for k, curve in enumerate(curves):
            axes.plot(curve[:, 0], scale * curve[:, 1 + i], color=f"C{i}", label=None if k else name)
    axes.set(xlabel="minutes of processor time", ylabel=what, xlim=(0, None))
    axes.legend(frameon=False)
    axes.grid(alpha=0.3)
    figure.savefig(path)
    plt.close(figure)
