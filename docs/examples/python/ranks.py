#!/usr/bin/env python3
# Arms with grippers on ranks of MPI: rank 0 acts for all of them. SPDX-License-Identifier: Apache-2.0
"""mpirun -n 2 /usr/bin/python3 ranks.py --folder run

Rank 0 has the policy: it sees the readings of all environments and makes their actions, which here are random targets.
Each rank steps its own environments. A checkpoint is written every ten updates; whoever starts again with the same
folder, on any number of ranks, goes on from the last one. At the end rank 0 writes positions.npy, which does not depend
on the number of ranks, and says where the time went. Needs mpi4py (Debian: python3-mpi4py)."""

import argparse
import time
from pathlib import Path

import numpy as np
from mpi4py import MPI
from reach import plan as reach_plan

from lockstep.mpi import Ranks
from lockstep.ranks import Checkpoints, ids_of

def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[1])
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--envs", type=int, default=4096, help="of all ranks")
    parser.add_argument("--updates", type=int, default=50, help="control periods of four steps")
    parser.add_argument("--threads", type=int, default=1, help="of each rank")
    options = parser.parse_args()

    comm = MPI.COMM_WORLD
    plan = reach_plan()
    first_id, num_envs = ids_of(comm.rank, comm.size, options.envs)
    batch = plan.batch(num_envs, first_id=first_id, seed=1, threads=options.threads)
    ranks = Ranks(comm, batch)
    checkpoints = Checkpoints(options.folder)
    batch.randomize("mass", "scale", 0.8, 1.2)
    batch.reset_random(spread=0.2)
    begin = ranks.restore(checkpoints, batch) or 0

    is_root = comm.rank == 0
    readings = np.empty((plan.nv, options.envs), batch.dtype) if is_root else None
    spent = dict.fromkeys(("act", "scatter", "step", "gather", "save"), 0.0)
    now = time.perf_counter()

    def lap(part):
        nonlocal now
        before, now = now, time.perf_counter()
        spent[part] += now - before

    for update in range(begin, options.updates):
        actions = None
        if is_root:
            actions = np.random.default_rng(update).uniform(-0.4, 0.4, (plan.nv, options.envs)).astype(batch.dtype)
        lap("act")
        ranks.scatter(actions, batch.rows.q_target)
        lap("scatter")
        batch.step(4)
        lap("step")
        ranks.gather(batch.rows.q, readings)
        lap("gather")
        if (update + 1) % 10 == 0:
            ranks.checkpoint(checkpoints, update + 1, batch)
        lap("save")

    faults = ranks.faults(batch)
    if is_root:
        if begin < options.updates:
            np.save(options.folder / "positions.npy", readings)
        total = max(sum(spent.values()), 1e-9)
        shares = ", ".join(f"{part} {100 * seconds / total:.0f} %" for part, seconds in spent.items())
        print(f"{options.envs} environments on {comm.size} ranks, updates {begin} to {options.updates}: {total:.2f} s: "
              f"{shares}; faults: {faults['count'] or 'none'}")


if __name__ == "__main__":
    main()
