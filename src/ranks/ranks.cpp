// SPDX-License-Identifier: Apache-2.0
#include "lockstep/ranks.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <numeric>
#include <vector>

#include "lockstep/error.h"

namespace lockstep {
namespace {

constexpr std::int64_t most_ids = std::int64_t{1} << 32, most_of_a_batch = 1 << 24;

// What a launcher says. What runs inside of another one comes first: mpirun and torchrun run within a job of Slurm.
struct Launcher {
  const char *rank, *ranks;
};
constexpr Launcher launchers[] = {{"OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"},
                                  {"PMI_RANK", "PMI_SIZE"},
                                  {"RANK", "WORLD_SIZE"},
                                  {"SLURM_PROCID", "SLURM_NTASKS"}};

int number_in(const char* variable) {
  const char* const text = std::getenv(variable);
  int number = 0;
  const char* const end = text + std::strlen(text);
  const auto [behind, error] = std::from_chars(text, end, number);
  if (error != std::errc() || behind != end)
    throw UsageError(fmt::format("rank in {}", variable), fmt::format("is '{}', which is no whole number", text),
                     "start the process by a launcher, or give the rank yourself");
  return number;
}

void require_rank(Rank rank, const std::string& element) {
  if (rank.ranks < 1 || rank.rank < 0 || rank.rank >= rank.ranks)
    throw UsageError(element, fmt::format("is {} of {}", rank.rank, rank.ranks),
                     "give a rank from 0 to one below their number");
}

std::string ids_in_words(std::int64_t first, std::int64_t end) {
  return end == first + 1 ? fmt::format("id {}", first) : fmt::format("ids {} to {}", first, end - 1);
}

}  // namespace

Rank rank_of_launcher() {
  for (const Launcher& launcher : launchers) {
    if (!std::getenv(launcher.rank) || !std::getenv(launcher.ranks)) continue;
    const Rank own{number_in(launcher.rank), number_in(launcher.ranks)};
    require_rank(own, fmt::format("rank in {} and {}", launcher.rank, launcher.ranks));
    return own;
  }
  return {};
}

IdRange ids_of(Rank rank, std::int64_t environments, std::uint32_t first) {
  require_rank(rank, "rank");
  if (environments < rank.ranks)
    throw UsageError("ids of ranks", fmt::format("{} environments are fewer than {} ranks", environments, rank.ranks),
                     "give each rank one at least");
  if (environments > most_ids - first)
    throw UsageError("ids of ranks", fmt::format("are {} from {} on, beyond 2^32 - 1", environments, first),
                     "take fewer environments, or a lower first id");
  // The first ranks have one more, where they cannot all have as many.
  const std::int64_t each = environments / rank.ranks, more = environments % rank.ranks;
  const std::int64_t begin = rank.rank * each + std::min<std::int64_t>(rank.rank, more),
                     count = each + (rank.rank < more ? 1 : 0);
  if (count > most_of_a_batch)
    throw UsageError("ids of ranks", fmt::format("are {} for rank {}, more than a batch holds", count, rank.rank),
                     "take more ranks: a batch holds 2^24");
  return {static_cast<std::uint32_t>(first + begin), static_cast<int>(count)};
}

void require_partition(std::span<const IdRange> by_rank, std::int64_t environments, std::uint32_t first) {
  std::vector<std::size_t> order(by_rank.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return by_rank[a].first < by_rank[b].first; });
  const std::string remedy = "give each rank the range that ids_of() gives it";
  if (environments < 0 || environments > most_ids - first)
    throw UsageError("ids of ranks", fmt::format("are {} from {} on, beyond 2^32 - 1", environments, first), remedy);
  std::int64_t next = first;
  std::size_t before = 0;  // the rank that owns what is below `next`
  for (const std::size_t rank : order) {
    const std::int64_t begin = by_rank[rank].first, end = begin + by_rank[rank].count;
    if (by_rank[rank].count < 1) throw UsageError("ids of ranks", fmt::format("are none for rank {}", rank), remedy);
    if (begin > next)
      throw UsageError("ids of ranks", fmt::format("leave a gap: no rank owns {}", ids_in_words(next, begin)), remedy);
    if (begin < next && next == first)
      throw UsageError("ids of ranks", fmt::format("begin with {} for rank {}, below {}", begin, rank, first), remedy);
    if (begin < next)
      throw UsageError("ids of ranks",
                       fmt::format("overlap: ranks {} and {} both own {}", std::min(before, rank),
                                   std::max(before, rank), ids_in_words(begin, std::min(end, next))),
                       remedy);
    next = end, before = rank;
  }
  const std::int64_t end = first + environments;
  if (next < end)
    throw UsageError("ids of ranks", fmt::format("leave a gap: no rank owns {}", ids_in_words(next, end)), remedy);
  if (next > end)
    throw UsageError("ids of ranks", fmt::format("go on to {} for rank {}, beyond {}", next - 1, before, end - 1),
                     remedy);
}

}  // namespace lockstep
