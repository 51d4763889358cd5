#!/usr/bin/env python3
# Proximal policy optimisation teaches a randomised gripper to reach. SPDX-License-Identifier: Apache-2.0
"""Needs torch. The learner is ppo.py. Ends by time count as ends, as the goal is new then."""

import argparse
import time

import numpy as np
from ppo import Agent, learn, torch
from reach import CONTROL_STEPS, Reach


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--iterations", type=int, default=80)
    parser.add_argument("--envs", type=int, default=1024)
    options = parser.parse_args()
    torch.manual_seed(1)
    torch.set_num_threads(1)
    env = Reach(options.envs, seed=1, autoreset_mode="SameStep")
    begin, spent = time.perf_counter(), {}
    learning = learn(env, Agent(env), CONTROL_STEPS // 2, discount=0.97, reward_scale=10.0)
    for iteration, (infos, seconds) in zip(range(options.iterations + 1), learning):
        for part in seconds:
            spent[part] = spent.get(part, 0.0) + seconds[part]
        ended = [info for info in infos if "final_obs_batch" in info]
        if ended and iteration % 10 == 1:  # episodes end in every second one
            final = np.concatenate([info["final_obs_batch"][info["_final_obs"]] for info in ended])
            median = 1e3 * np.median(np.linalg.norm(final[:, -3:], axis=1) / 20)
            now = time.perf_counter() - begin
            print(f"iteration {iteration:3}   {now:5.1f} s   median error {median:6.1f} mm", flush=True)
    total = sum(spent.values())
    print(f"{total:.0f} s of processor time: "
          + ", ".join(f"{part} {100 * seconds / total:.0f} %" for part, seconds in spent.items()))


if __name__ == "__main__":
    main()
