// The joints that forces of tendons act on. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "ends.h"
#include "import/draft.h"
#include "ties.h"

namespace lockstep::importer::mjcf {

/// A joint of the model that takes the forces of a tendon or an actuator, and their length by its position.
struct Transmission {
  std::string joint;
  double factor = 1.0, constant = 0.0;  ///< length = factor q + constant
  double rest = 0.0;                    ///< of a spatial tendon: its length with all joints at their springref
};

/// By tendon: the one joint that moves it, or a joint of the kind tendon, which this adds to the draft's model where a
/// tendon over several joints has more than a spring, or a spatial one has anything. Throws ImportError for one of
/// these that wraps around a geom. Nothing where an equality holds the tendon, or where nothing needs a joint. Springs
/// with a range without force are soft limits of tendons then.
std::vector<std::optional<Transmission>> transmissions_of_tendons(const Scene& scene, const Ties& ties,
                                                                  const Ends& ends, Draft& draft);

inline const char* const limits_of_tendons_joints =
    "effort limits of single joints that a tendon drives together, kept as they are";

/// The name of a tendon in reports.
std::string title_of(const Tendon& tendon);

}  // namespace lockstep::importer::mjcf
