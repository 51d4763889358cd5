#!/usr/bin/env python3
# Proximal policy optimisation teaches a randomised gripper to reach. SPDX-License-Identifier: Apache-2.0
"""Needs torch. The dense form of PPO (Schulman et al. 2017) in one file. Ends by time count as ends, as the goal is new
then."""

import argparse
import time

import numpy as np
from reach import ACTIONS, CONTROL_STEPS, OBSERVATIONS, Reach

try:
    import torch
except ImportError as missing:
    raise SystemExit("train_ppo.py needs torch (python3-torch); train_es.py needs numpy alone") from missing


class Agent(torch.nn.Module):
    def __init__(self):
        super().__init__()
        layer = torch.nn.Linear
        self.actor = torch.nn.Sequential(layer(OBSERVATIONS, 64), torch.nn.Tanh(), layer(64, ACTIONS))
        self.critic = torch.nn.Sequential(layer(OBSERVATIONS, 64), torch.nn.Tanh(), layer(64, 1))
        self.spread = torch.nn.Parameter(torch.full((ACTIONS,), -0.7))

    def forward(self, seen):
        return torch.distributions.Normal(self.actor(seen), self.spread.exp()), self.critic(seen).squeeze(-1)


def advantages(rewards, values, ends, last, discount=0.97, smoothing=0.95):
    """Generalised advantage estimation over [steps, environments]."""
    result, running = torch.zeros_like(rewards), torch.zeros_like(last)
    for step in reversed(range(len(rewards))):
        going_on = 1.0 - ends[step]
        error = rewards[step] + discount * going_on * last - values[step]
        running = error + discount * smoothing * going_on * running
        result[step], last = running, values[step]
    return result


def update(agent, optimizer, seen, actions, chances, gains, returns):
    for _ in range(4):
        for part in torch.randperm(len(seen)).chunk(4):
            policy, values = agent(seen[part])
            ratio = (policy.log_prob(actions[part]).sum(-1) - chances[part]).exp()
            gain = (gains[part] - gains[part].mean()) / (gains[part].std() + 1e-8)
            surrogate = torch.minimum(ratio * gain, ratio.clamp(0.8, 1.2) * gain).mean()
            loss = (values - returns[part]).square().mean() - surrogate - 1e-3 * policy.entropy().sum(-1).mean()
            optimizer.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(agent.parameters(), 0.5)
            optimizer.step()


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--iterations", type=int, default=80)
    parser.add_argument("--envs", type=int, default=1024)
    options = parser.parse_args()
    torch.manual_seed(1)
    torch.set_num_threads(1)
    env, agent = Reach(options.envs, seed=1, autoreset_mode="SameStep"), Agent()
    optimizer = torch.optim.Adam(agent.parameters(), lr=1e-3)
    seen, length = torch.from_numpy(env.reset()[0]), CONTROL_STEPS // 2
    begin, spent = time.perf_counter(), {"policy": 0.0, "learn": 0.0}
    for iteration in range(options.iterations + 1):
        rows, errors = {k: [] for k in ("seen", "actions", "chances", "values", "rewards", "ends")}, []
        for _ in range(length):
            start = time.perf_counter()
            with torch.no_grad():
                policy, values = agent(seen)
                actions = policy.sample()
                chances = policy.log_prob(actions).sum(-1)
            spent["policy"] += time.perf_counter() - start
            after, rewards, terminated, truncated, info = env.step(actions.numpy())
            if truncated.any():
                final = info["final_obs_batch"][truncated]
                errors.append(np.linalg.norm(final[:, -3:], axis=1) / 20)
            numbers = (seen, actions, chances, values, torch.from_numpy(10.0 * rewards),
                       torch.from_numpy(terminated | truncated).float())
            for row, number in zip(rows.values(), numbers):
                row.append(number)
            seen = torch.from_numpy(after)
        start = time.perf_counter()
        batch = {k: torch.stack(v) for k, v in rows.items()}
        with torch.no_grad():
            gains = advantages(batch["rewards"], batch["values"], batch["ends"], agent(seen)[1])
        flat = [batch[k].flatten(0, 1) for k in ("seen", "actions", "chances")]
        update(agent, optimizer, *flat, gains.flatten(), (gains + batch["values"]).flatten())
        spent["learn"] += time.perf_counter() - start
        if errors and iteration % 10 == 1:  # episodes end in every second one
            median = 1e3 * np.median(np.concatenate(errors))
            print(f"iteration {iteration:3}   {time.perf_counter() - begin:5.1f} s   median error {median:6.1f} mm", flush=True)
    total = time.perf_counter() - begin
    spent.update(env.seconds)
    print(f"{total:.0f} s: " + ", ".join(f"{part} {100 * seconds / total:.0f} %" for part, seconds in spent.items()))


if __name__ == "__main__":
    main()
