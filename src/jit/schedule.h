// The order of a listing's operations, so that few wait for others. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "operations.h"

namespace lockstep::jit {

/// List scheduling: of the next `window` operations, the first that need not wait comes next. Longer windows wait less
/// and need more registers. No result changes by a bit.
void schedule(Listing& listing, int window);

}  // namespace lockstep::jit
