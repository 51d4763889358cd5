// What moves two bodies against each other. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "spans.h"

namespace lockstep {

/// A velocity of the solver that moves two bodies against each other, and the bodies that it turns or moves.
struct PairColumn {
  int velocity;
  int first, last;  ///< among the parts; the last is one past the end
};
struct ColumnPart {
  int body;
  int component;  ///< of a floating root's twist; -1 for a joint
  int share;      ///< entry of S; -1 stands for 1
  int sign;       ///< 1 if it moves the second body, -1 if it moves the first
};

}  // namespace lockstep
