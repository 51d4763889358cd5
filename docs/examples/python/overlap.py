#!/usr/bin/env python3
# One half of the environments is stepped while the policy looks at the other half. SPDX-License-Identifier: Apache-2.0
"""python3 docs/examples/python/overlap.py --envs 4096

A policy that runs on one core leaves the others idle while it thinks. Two batches, with the ids of one, let a thread
step the first half while this thread computes actions for the second half, and then they change places. step() lets
other Python threads run, and two batches never share anything. Each half sees actions that are made of its newest
readings, so the motion is that of one batch, to the last bit; the end compares them. Needs numpy alone."""

import argparse
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from reach import plan as reach_plan

from lockstep.ranks import ids_of


class Policy:
    """A network of two hidden layers, its weights drawn once."""

    def __init__(self, inputs, outputs, hidden):
        draw = np.random.default_rng(1)
        sizes = [inputs, hidden, hidden, outputs]
        self.layers = [draw.normal(0, rows**-0.5, (rows, columns)).astype("f4")
                       for rows, columns in zip(sizes, sizes[1:])]

    def __call__(self, seen):
        for layer in self.layers:
            seen = np.tanh(seen @ layer)
        return seen


class Half:
    def __init__(self, plan, first_id, num_envs, threads):
        self.batch = plan.batch(num_envs, first_id=first_id, seed=3, threads=threads)
        self.batch.randomize("mass", "scale", 0.8, 1.2)
        self.batch.reset_random(spread=0.3)
        self.seen = self.batch.read("q", "qd")

    def act(self, policy):
        self.batch.act(policy(self.seen))

    def step(self):
        self.batch.step(4)
        self.seen = self.batch.read("q", "qd")


def in_turn(halves, policy, updates):
    for _ in range(updates):
        for half in halves:
            half.act(policy)
            half.step()


def overlapped(halves, policy, updates):
    first, second = halves
    with ThreadPoolExecutor(1) as stepper:
        first.act(policy)
        for update in range(updates):
            stepping = stepper.submit(first.step)
            second.act(policy)
            stepping.result()
            stepping = stepper.submit(second.step)
            if update + 1 < updates:
                first.act(policy)
            stepping.result()


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[1])
    parser.add_argument("--envs", type=int, default=4096)
    parser.add_argument("--updates", type=int, default=50)
    parser.add_argument("--hidden", type=int, default=128)
    parser.add_argument("--cores", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    plan = reach_plan()
    policy = Policy(2 * plan.nv, len(plan.driven_dofs), options.hidden)

    def made(parts, threads):
        return [Half(plan, *ids_of(part, parts, options.envs), threads) for part in range(parts)]

    # All cores step, and one of them thinks; or one thinks while the others step.
    ways = {"in turn": (in_turn, made(1, options.cores)),
            "overlapped": (overlapped, made(2, max(1, options.cores - 1)))}
    seconds = {name: [] for name in ways}
    for _ in range(options.rounds):
        for name, (run, halves) in ways.items():
            begin = time.perf_counter()
            run(halves, policy, options.updates)
            seconds[name].append(time.perf_counter() - begin)
    whole, parts = (np.concatenate([half.batch.q for half in halves]) for _, halves in ways.values())
    if not np.array_equal(whole, parts):
        raise SystemExit("the halves have moved in another way than the whole")
    median = {name: np.median(times) / options.updates * 1e3 for name, times in seconds.items()}
    told = ", ".join(f"{name} {time:.2f} ms" for name, time in median.items())
    print(f"{told} a control step of {options.envs} environments: "
          f"{median['in turn'] / median['overlapped']:.2f} times as fast; the same motion to the last bit")


if __name__ == "__main__":
    main()
