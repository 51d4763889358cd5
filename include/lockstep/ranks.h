// Environments that several processes share among themselves: which are whose. SPDX-License-Identifier: Apache-2.0
//
// Environments of different ranks know nothing of each other, so N ranks give the bits of one process, if each makes
// its environments with their global ids:
//
//     const IdRange own = ids_of(rank_of_launcher(), 65536);
//     Batch<float> batch(plan, own.count, {.first_id = own.first});
#pragma once

#include <cstdint>
#include <span>

#include "lockstep/export.h"

namespace lockstep {

/// The environments with the ids first, first + 1 ... first + count - 1.
struct IdRange {
  std::uint32_t first = 0;
  int count = 0;
  bool operator==(const IdRange&) const = default;
};

/// One of `ranks` processes: 0 <= rank < ranks.
struct Rank {
  int rank = 0, ranks = 1;
};

/// What mpirun, torchrun or srun say in the environment: OMPI_COMM_WORLD_RANK and OMPI_COMM_WORLD_SIZE, PMI_RANK and
/// PMI_SIZE, RANK and WORLD_SIZE, SLURM_PROCID and SLURM_NTASKS, the first of these pairs that is there; without any,
/// one process. Throws UsageError where they are no numbers, or no rank of so many. Must not run while another thread
/// changes the environment.
LOCKSTEP_API Rank rank_of_launcher();

/// The rank's share of the environments with the ids first, first + 1 ...: ranges that follow each other, in the order
/// of the ranks, whose lengths differ by at most one. Throws UsageError for a rank that is none, for fewer environments
/// than ranks, for ids beyond 2^32 - 1 and for shares that no batch holds (2^24).
LOCKSTEP_API IdRange ids_of(Rank rank, std::int64_t environments, std::uint32_t first = 0);

/// Throws UsageError, with the numbers of the ranks, unless the ranges, one for each rank in any order, are the
/// environments with the ids first, first + 1 ... of which there are so many, each once.
LOCKSTEP_API void require_partition(std::span<const IdRange> by_rank, std::int64_t environments,
                                    std::uint32_t first = 0);

}  // namespace lockstep
