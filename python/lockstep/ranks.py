# Environments that several processes share among themselves. SPDX-License-Identifier: Apache-2.0
"""Each rank steps a range of the environments, known by their ids; together they have the bits of one process.

    first_id, num_envs = ids_of(*rank_of_launcher(), 65536)
    env = VectorEnv(plan, num_envs, first_id=first_id)

lockstep.mpi has what goes between ranks of MPI. Other launchers need nothing of it: docs/ranks.md.
"""

from ._lockstep import Checkpoint, Checkpoints, ids_of, rank_of_launcher, require_partition

__all__ = ["Checkpoint", "Checkpoints", "ids_of", "rank_of_launcher", "require_partition"]
