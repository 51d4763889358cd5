// One model of a soak. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "totals.h"

namespace lockstep::soak {

/// Makes the model of this seed and steps it as programs do: random actions and efforts, resets at any time, parameters
/// that differ, savepoints. Odd seeds are in double precision. Every second pair of seeds moves gently. On the way a
/// second batch with two threads goes on from a savepoint of the first, and must keep its bits.
Totals run(std::uint64_t seed, int environments, int periods);

}  // namespace lockstep::soak
