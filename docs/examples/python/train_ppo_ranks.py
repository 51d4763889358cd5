#!/usr/bin/env python3
# PPO on several ranks of torch.distributed, each with environments of its own. SPDX-License-Identifier: Apache-2.0
"""mpirun -n 2 python3 train_ppo_ranks.py

mpirun, torchrun or srun starts the ranks; MASTER_ADDR and MASTER_PORT say where rank 0 is, if not here. The task of train_ppo.py. Each rank steps the environments whose ids it owns and learns from them; what the ranks share
are the gradients, whose mean all of them apply, by gloo. So their agents stay the same, which the end checks. Needs
torch."""

import argparse
import os

import numpy as np
from ppo import Agent, learn, torch
from reach import CONTROL_STEPS, Reach

from lockstep.ranks import ids_of, rank_of_launcher


class SharedGradients:
    """Takes the mean of the ranks' gradients where an optimizer has its own."""

    def __init__(self, agent, ranks):
        for parameter in agent.parameters():
            parameter.register_hook(lambda gradient: self.mean(gradient, ranks))

    @staticmethod
    def mean(gradient, ranks):
        gradient = gradient.clone()
        torch.distributed.all_reduce(gradient)
        return gradient / ranks


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[1])
    parser.add_argument("--iterations", type=int, default=80)
    parser.add_argument("--envs", type=int, default=1024, help="of all ranks")
    options = parser.parse_args()
    rank, ranks = rank_of_launcher()
    place = f"tcp://{os.environ.get('MASTER_ADDR', '127.0.0.1')}:{os.environ.get('MASTER_PORT', 29571)}"
    torch.distributed.init_process_group("gloo", init_method=place, rank=rank, world_size=ranks)
    torch.set_num_threads(1)
    first_id, num_envs = ids_of(rank, ranks, options.envs)
    env = Reach(num_envs, seed=1, first_id=first_id, threads=1, autoreset_mode="SameStep")
    torch.manual_seed(1)
    agent = Agent(env)  # the same on all ranks
    torch.manual_seed(2 + rank)  # and then each its own actions
    SharedGradients(agent, ranks)
    for iteration, (infos, _) in zip(range(options.iterations + 1), learn(env, agent, CONTROL_STEPS // 2, discount=0.97,
                                                                          reward_scale=10.0)):
        if iteration % 10 != 1:  # the same on all ranks, which wait for each other here
            continue
        final = [info["final_obs_batch"][info["_final_obs"]] for info in infos if "final_obs_batch" in info]
        errors = [None] * ranks
        torch.distributed.all_gather_object(errors, [np.linalg.norm(seen[:, -3:], axis=1) / 20 for seen in final])
        if rank == 0:
            median = 1e3 * np.median(np.concatenate([error for its in errors for error in its]))
            print(f"iteration {iteration:3}   median error {median:6.1f} mm", flush=True)
    weights = torch.cat([parameter.detach().flatten() for parameter in agent.parameters()])
    first = weights.clone()
    torch.distributed.broadcast(first, 0)
    if not torch.equal(weights, first):
        raise SystemExit(f"rank {rank} has learned another agent than rank 0")
    print(f"rank {rank} of {ranks}: {num_envs} environments from id {first_id} on, one agent", flush=True)


if __name__ == "__main__":
    main()
