// The hash of a plan's step, found once. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "../plan/program.h"

namespace lockstep::generate {

/// 0 for a plan that no kernel can be generated for. Thread-safe.
std::uint64_t hash_of(const Program& program);

}  // namespace lockstep::generate
