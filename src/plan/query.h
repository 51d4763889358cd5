// What a Query asks for, in numbers. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "program.h"

namespace lockstep {

struct QueryShape {
  int elements;  ///< that there are
  int rows;      ///< of each
};

/// Throws UsageError for none of the enumerators.
QueryShape shape_of(const Program& program, Quantity quantity);

}  // namespace lockstep
