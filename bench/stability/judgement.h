// A motion stepped and judged. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "lockstep/batch.h"
#include "maps.h"

namespace lockstep::stability {

constexpr double seconds = 5.0;  // simulated, at each point

enum class Class {
  holds,   ///< errors <= 1e-5 and energy in its budget; soft: as stated, and as the closed form
  loose,   ///< errors to 1e-2
  open,    ///< errors beyond
  damped,  ///< soft: as the closed form of implicit Euler, which the step makes another motion than stated
  off,     ///< soft: another motion than the closed form
  energy,  ///< energy beyond its budget
  fault,   ///< the environment was frozen
};

const char* to_string(Class kind);

struct Verdict {
  Class kind = Class::holds;
  double error = 0.0;   ///< largest |C| in the last second; soft: farthest from the closed form, by the first error
  double excess = 0.0;  ///< most energy above the budget, by what the energy may span; soft: by that of the start
  Fault fault = Fault::none;
};

/// One verdict per setup, all run as environments of one Batch.
std::vector<Verdict> judge(const Map& map, Method method, const std::vector<Setup>& setups);

}  // namespace lockstep::stability
