// Instructions as bytes. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "allocate.h"
#include "frame.h"

namespace lockstep::jit {

/// The bytes of a StepCode::Function, with its constants behind them. They may stand anywhere at a multiple of 64.
/// Throws Error if an instruction cannot be encoded.
std::vector<std::uint8_t> encode(const Allocated& code, const std::vector<std::uint64_t>& constants,
                                 const Machine& machine, CallStage call);

}  // namespace lockstep::jit
