// Instructions as text, for people. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "allocate.h"

namespace lockstep::jit {

/// A line for each instruction, and behind it the name of the number that it makes or reads.
std::string print(const Allocated& code, const Listing& listing);

}  // namespace lockstep::jit
