// SPDX-License-Identifier: Apache-2.0
#include "lockstep/environment_set.h"

#include <algorithm>

namespace lockstep {

void EnvironmentSet::check(int environments) const {
  const auto check_places = [&](const int* places, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
      if (places[i] < 0 || places[i] >= environments)
        throw UsageError("environment " + std::to_string(places[i]),
                         "is outside the batch of " + std::to_string(environments),
                         "give 0 to " + std::to_string(environments - 1));
  };
  if (kind_ == Kind::places) return check_places(places_, count_);
  if (kind_ == Kind::own && !own_is_mask_) return check_places(own_.data(), own_.size());
  if (kind_ == Kind::all) return;
  if (count_ != static_cast<std::size_t>(environments))
    throw UsageError("mask of environments",
                     "has " + std::to_string(count_) + " entries for " + std::to_string(environments) + " environments",
                     "give one per environment");
  if (kind_ == Kind::own) return;
  const unsigned char* const wrong = std::find_if(mask_, mask_ + count_, [](unsigned char c) { return c > 1; });
  if (wrong != mask_ + count_)
    throw UsageError("mask of environments",
                     "has a " + std::to_string(*wrong) + " at " + std::to_string(wrong - mask_) + ", not 0 or 1",
                     "give 0 or 1 for each environment, or places as int");
}

}  // namespace lockstep
