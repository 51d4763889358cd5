// A graph as a list of operations. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "../plan/program.h"

namespace lockstep::generate {

/// The plan's step as a list, made when first asked for; null where it would be too long, or where a step solves lane by
/// lane or until it is satisfied. Thread-safe.
const OperationList* operation_list(const Program& program);

/// Whether that is faster than the tables' loops. Bounds that are idle have no say in it, so that they change no bit.
bool listing_pays(const Program& program);

}  // namespace lockstep::generate
