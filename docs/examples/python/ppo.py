# Proximal policy optimisation for vector environments. SPDX-License-Identifier: Apache-2.0
"""The dense form of PPO (Schulman et al. 2017), which both learning examples with torch use: `learn` steps a VectorEnv
with autoreset_mode="SameStep" and updates an Agent. A group of observations named "critic" is for the value alone."""

import time

import numpy as np

try:
    import torch
except ImportError as missing:
    raise SystemExit("this example needs torch (python3-torch); train_es.py needs numpy alone") from missing


def groups(seen):
    """What the policy and the value see, as tensors."""
    policy = seen["policy"] if isinstance(seen, dict) else seen
    return torch.from_numpy(policy), torch.from_numpy(seen["critic"] if isinstance(seen, dict) else seen)


class Agent(torch.nn.Module):
    """Networks for the policy's mean and for the value; the standard deviation does not depend on what is seen."""

    def __init__(self, env, hidden=(64,), deviation=0.5):
        super().__init__()
        space = env.single_observation_space
        policy, critic = (space["policy"], space["critic"]) if len(env.group_names) > 1 else (space, space)
        actions = env.single_action_space.shape[0]
        self.actor = self.network(policy.shape[0], hidden, actions)
        self.critic = self.network(critic.shape[0], hidden, 1)
        self.actor[-1].weight.data *= 0.1  # the first actions are near 0
        self.log_deviation = torch.nn.Parameter(torch.full((actions,), float(np.log(deviation))))

    @staticmethod
    def network(inputs, hidden, outputs):
        layers = []
        for size in hidden:
            layers += [torch.nn.Linear(inputs, size), torch.nn.Tanh()]
            inputs = size
        return torch.nn.Sequential(*layers, torch.nn.Linear(inputs, outputs))

    def policy(self, seen):
        return torch.distributions.Normal(self.actor(seen), self.log_deviation.exp(), validate_args=False)

    def value(self, seen):
        return self.critic(seen).squeeze(-1)


def advantages(rewards, values, ends, last, discount, smoothing=0.95):
    """Generalised advantage estimation over [steps, environments]."""
    result, running = torch.zeros_like(rewards), torch.zeros_like(last)
    for step in reversed(range(len(rewards))):
        going_on = 1.0 - ends[step]
        error = rewards[step] + discount * going_on * last - values[step]
        running = error + discount * smoothing * going_on * running
        result[step], last = running, values[step]
    return result


def update(agent, optimizer, data, entropy, wanted_change):
    """Four passes over the data in four parts. With wanted_change the rate is adapted until the policy changes by about
    this Kullback-Leibler divergence."""
    rate = optimizer.param_groups[0]
    for _ in range(4):
        for part in torch.randperm(len(data["actions"])).chunk(4):
            now = {name: numbers[part] for name, numbers in data.items()}
            policy, values = agent.policy(now["seen"]), agent.value(now["watched"])
            change = policy.log_prob(now["actions"]).sum(-1) - now["chances"]
            ratio = change.exp()
            if wanted_change:
                divergence = float((ratio - 1 - change).mean().detach())
                if divergence > 2 * wanted_change:
                    rate["lr"] = max(rate["lr"] / 1.5, 1e-5)
                elif divergence < 0.5 * wanted_change:
                    rate["lr"] = min(rate["lr"] * 1.5, 2e-3)
            gain = (now["gains"] - now["gains"].mean()) / (now["gains"].std() + 1e-8)
            surrogate = torch.minimum(ratio * gain, ratio.clamp(0.8, 1.2) * gain).mean()
            value_loss = (values - now["returns"]).square().mean()
            loss = value_loss - surrogate - entropy * policy.entropy().sum(-1).mean()
            optimizer.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(agent.parameters(), 0.5)
            optimizer.step()


def learn(env, agent, length, discount, *, reward_scale=1.0, goes_on=False, entropy=1e-3, wanted_change=None):
    """Yields the infos of `length` control steps and the seconds of processor time for policy, step and learning, after
    each iteration, without end. goes_on: an end by time is worth what the value says of its last observations."""
    optimizer = torch.optim.Adam(agent.parameters(), lr=1e-3)
    seen, watched = groups(env.reset()[0])
    while True:
        rows = {name: [] for name in ("seen", "watched", "actions", "chances", "values", "rewards", "ends")}
        infos, seconds = [], {"policy": 0.0, "step": 0.0, "learn": 0.0}
        for _ in range(length):
            begin = time.process_time()
            with torch.no_grad():
                policy, values = agent.policy(seen), agent.value(watched)
                actions = policy.sample()
                chances = policy.log_prob(actions).sum(-1)
            acted = time.process_time()
            after, rewards, terminated, truncated, info = env.step(actions.numpy())
            stepped = time.process_time()
            rewards = torch.from_numpy(reward_scale * rewards)
            if goes_on and truncated.any():
                with torch.no_grad():
                    last = agent.value(groups(info["final_obs_batch"])[1])
                rewards += discount * last * torch.from_numpy(truncated & ~terminated)
            ends = torch.from_numpy(terminated | truncated).float()
            for row, numbers in zip(rows.values(), (seen, watched, actions, chances, values, rewards, ends)):
                row.append(numbers)
            infos.append(info)
            seen, watched = groups(after)
            seconds["policy"] += acted - begin
            seconds["step"] += stepped - acted
        begin = time.process_time()
        data = {name: torch.stack(row) for name, row in rows.items()}
        with torch.no_grad():
            data["gains"] = advantages(data["rewards"], data["values"], data["ends"], agent.value(watched), discount)
        data["returns"] = data["gains"] + data["values"]
        data = {name: numbers.flatten(0, 1) for name, numbers in data.items()}
        update(agent, optimizer, data, entropy, wanted_change)
        seconds["learn"] = time.process_time() - begin
        yield infos, seconds
