// What a velocity of the solver turns and moves of two bodies against each other. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "frame.h"

namespace lockstep::kernels {

/// The axis that a part of a column turns about or slides along, in the world, times its share of the velocity.
template <class T>
struct PartAxis {
  Vec3<T> axis;
  bool slides;
};

template <class S>
LOCKSTEP_INLINE bool slides(const Tables<S>& t, const ColumnPart& part) {
  return part.component < 0 ? t.body[part.body].prismatic : part.component >= 3;
}

template <class T>
LOCKSTEP_INLINE PartAxis<T> axis_of_part(const Tables<ScalarOf<T>>& t, const ColumnPart& part, const Motion<T>& m,
                                         const Tile<T>& x) {
  const Body<ScalarOf<T>>& body = t.body[part.body];
  const int axis = part.component < 0 ? body.axis : part.component % 3;
  T share = T(part.component < 0 ? body.sign * ScalarOf<T>(part.sign) : ScalarOf<T>(part.sign));
  if (part.share >= 0) share *= x.couplings.share[part.share];
  return {scaled(column_of(m.world[part.body], axis), share), slides(t, part)};
}

}  // namespace lockstep::kernels
