// Steps a motion and judges it. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "lockstep/batch.h"
#include "maps.h"

namespace lockstep::stability {

constexpr double seconds = 5.0;  // simulated, at each point

enum class Class {
  holds,   ///< errors <= 1e-5 and energy in its budget; soft: as stated, and as the closed form
  loose,   ///< errors <= 1e-2
  open,    ///< larger errors
  damped,  ///< soft: as the closed form of implicit Euler, which at this step differs from the stated motion
  off,     ///< soft: not as the closed form
  energy,  ///< energy beyond its budget
  fault,   ///< the environment was frozen
};

const char* to_string(Class kind);

struct Verdict {
  Class kind = Class::holds;
  /// Largest |C| in the last second. Soft: largest distance from the closed form, as a share of the first error.
  double error = 0.0;
  /// Largest energy above the budget, as a share of the energy's span. Soft: as a share of the energy at the start.
  double excess = 0.0;
  Fault fault = Fault::none;
};

/// One verdict for each setup. They run as environments of one Batch.
std::vector<Verdict> judge(const Map& map, Method method, const std::vector<Setup>& setups);

}  // namespace lockstep::stability
