#!/usr/bin/env python3
# Evolution strategies teach a randomised gripper to reach. SPDX-License-Identifier: Apache-2.0
"""Needs numpy alone (and matplotlib for the picture). 64 pairs of mirrored policies are tried in 32 environments each;
the mean policy then moves along their ranks (Salimans et al. 2017). Run it with OMP_NUM_THREADS=1: the environments use
the cores."""

import argparse
import time

import numpy as np
from reach import ACTIONS, CONTROL_STEPS, OBSERVATIONS, Reach

HIDDEN, PAIRS, SHARED = 32, 64, 32
SHAPES = [(OBSERVATIONS, HIDDEN), (1, HIDDEN), (HIDDEN, ACTIONS), (1, ACTIONS)]
SIZE = sum(a * b for a, b in SHAPES)


def policy(weights, seen):
    """Actions [m, k, 4] of m policies, weights [m, SIZE], for observations [m, k, 18]."""
    layers, at = [], 0
    for shape in SHAPES:
        size = shape[0] * shape[1]
        layers.append(weights[:, at : at + size].reshape(-1, *shape))
        at += size
    hidden = np.tanh(seen @ layers[0] + layers[1])
    return np.tanh(hidden @ layers[2] + layers[3])


def episode(env, weights, clock):
    """Distances from the goal, [control steps, environments]."""
    seen, distances = env.reset()[0], []
    for _ in range(CONTROL_STEPS):
        start = time.perf_counter()
        actions = policy(weights, seen.reshape(len(weights), -1, OBSERVATIONS)).reshape(-1, ACTIONS)
        clock["policy"] += time.perf_counter() - start
        seen = env.step(actions)[0]
        distances.append(env.distance())
    return np.array(distances)


def train(generations, threads, seed=1):
    random = np.random.default_rng(seed)
    clock = {"policy": 0.0, "learn": 0.0}
    env = Reach(2 * PAIRS * SHARED, threads=threads, seed=seed, autoreset_mode="Disabled")
    env.batch.env_id[:] = np.tile(np.arange(SHARED), 2 * PAIRS)  # all policies are tried in the same 32 environments
    held_out = Reach(4096, threads=threads, seed=seed + 1, autoreset_mode="Disabled")
    weights = random.normal(size=SIZE).astype(np.float32) * 0.05
    moment, square = np.zeros(SIZE, np.float32), np.zeros(SIZE, np.float32)
    curve = []
    begin = time.perf_counter()
    for generation in range(generations + 1):
        if generation % 5 == 0 or generation == generations:
            median = 1e3 * float(np.median(episode(held_out, weights[None], clock)[-1]))
            curve.append((generation, time.perf_counter() - begin, median))
            print(f"generation {generation:3}   {curve[-1][1]:5.1f} s   median error {median:6.1f} mm", flush=True)
        if generation == generations:
            break
        fade = 0.2 ** (generation / generations)
        sigma, rate = 0.1 * fade, 0.1 * fade
        noise = random.normal(size=(PAIRS, SIZE)).astype(np.float32)
        tried = weights + sigma * np.concatenate([noise, -noise])
        distances = episode(env, tried, clock)
        start = time.perf_counter()
        late = np.log(distances[CONTROL_STEPS // 2 :] + 0.01)  # near the goal every millimetre counts
        score = -late.mean(axis=0).reshape(2 * PAIRS, SHARED).mean(axis=1)
        ranks = np.argsort(np.argsort(score)) / (2 * PAIRS - 1) - 0.5
        slope = (ranks[:PAIRS] - ranks[PAIRS:]) @ noise / (2 * PAIRS * sigma)
        moment = 0.9 * moment + 0.1 * slope  # Adam
        square = 0.99 * square + 0.01 * slope**2
        scale = 1 - 0.9 ** (generation + 1), 1 - 0.99 ** (generation + 1)
        weights = weights + rate * (moment / scale[0]) / (np.sqrt(square / scale[1]) + 1e-8)
        weights = weights.astype(np.float32)
        clock["learn"] += time.perf_counter() - start
    total = time.perf_counter() - begin
    clock.update({part: env.seconds[part] + held_out.seconds[part] for part in env.seconds})
    return curve, clock, total


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--generations", type=int, default=50)
    parser.add_argument("--threads", type=int, default=0, help="0: all cores")
    parser.add_argument("--plot", help="picture of the error over time")
    options = parser.parse_args()
    curve, clock, total = train(options.generations, options.threads)
    shares = ", ".join(f"{part} {100 * seconds / total:.0f} %" for part, seconds in clock.items())
    print(f"{total:.0f} s: {shares}, rest {100 * (1 - sum(clock.values()) / total):.0f} %")
    if options.plot:
        import matplotlib

        matplotlib.use("Agg")
        import matplotlib.pyplot as plt

        _, seconds, errors = zip(*curve)
        figure, axes = plt.subplots(figsize=(6, 3.2), layout="constrained")
        axes.semilogy(seconds, errors, marker="o")
        axes.set(xlabel="wall-clock time, s", ylabel="fingertip error, mm (median)",
                 title="Evolution strategies on 4096 randomised grippers")
        axes.grid(True, which="both", alpha=0.3)
        figure.savefig(options.plot, dpi=110)


if __name__ == "__main__":
    main()
