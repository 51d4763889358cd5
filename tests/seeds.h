// How many random models a test takes. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>

namespace lockstep {

/// All of them in the slow preset, which sets LOCKSTEP_TEST_ALL_SEEDS, else the first `quick` ones.
inline int seeds_of(int all, int quick) { return std::getenv("LOCKSTEP_TEST_ALL_SEEDS") ? all : quick; }

}  // namespace lockstep
