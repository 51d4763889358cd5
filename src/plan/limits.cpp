// SPDX-License-Identifier: Apache-2.0
#include "limits.h"

#include <fmt/format.h>

#include "lockstep/error.h"

namespace lockstep {

void require_room(const Program& program, long entries, const char* matrix) {
  if (entries <= most_entries) return;
  constexpr long megabyte = 1000 * 1000;
  throw ModelError(
      "model '" + program.model.name + "'",
      fmt::format("is too large: {} would have at least {} entries, more than {}. In single precision they "
                  "take {} MB for each environment, in double {} MB",
                  matrix, entries, most_entries, entries * static_cast<long>(sizeof(float)) / megabyte,
                  entries * static_cast<long>(sizeof(double)) / megabyte),
      "split the mechanism, shorten its chains of joints, or leave out limits and couplings");
}

long entries_of(const std::vector<int>& parent) {
  std::vector<long> depth(parent.size());
  long entries = 0;
  for (std::size_t k = 0; k < parent.size(); ++k) {
    depth[k] = parent[k] < 0 ? 1 : depth[static_cast<std::size_t>(parent[k])] + 1;
    entries += depth[k];
  }
  return entries;
}

}  // namespace lockstep
