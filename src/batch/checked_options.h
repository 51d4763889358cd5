// What a Batch can be made with. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <string>

#include "lockstep/batch.h"
#include "lockstep/error.h"

namespace lockstep {

inline constexpr int most_environments = 1 << 24;

/// The number, where so many environments can be and their ids are different.
inline int checked_environments(int environments, const BatchOptions& options) {
  if (environments < 1 || environments > most_environments)
    throw SettingsError("environments",
                        "is " + std::to_string(environments) + ", outside 1 to " + std::to_string(most_environments),
                        "give 1 or more, in several batches if there are too many");
  if (options.first_id > std::numeric_limits<std::uint32_t>::max() - static_cast<std::uint32_t>(environments - 1))
    throw SettingsError("first_id",
                        "is " + std::to_string(options.first_id) + ", beyond which " + std::to_string(environments) +
                            " ids would begin again at 0",
                        "give a smaller one");
  return environments;
}

}  // namespace lockstep
