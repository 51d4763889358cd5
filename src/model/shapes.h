// What is said once of each kind of shape. SPDX-License-Identifier: Apache-2.0
//
// CONTRIBUTING.md has what else a new kind needs.
#pragma once

#include "lockstep/model.h"

namespace lockstep {

struct ShapeRule {
  ShapeKind kind;
  const char* name;
  int sizes;  ///< numbers that Shape::size has, all above 0; a hull's may be 0
  Inertia (*solid)(
      const Shape& shape);  ///< of density 1: the mass is the volume, or 0. A hull is weighed without radius
};

/// Throws std::out_of_range for none of the enumerators.
const ShapeRule& rule_of(ShapeKind kind);

/// Of density 1.
inline Inertia solid_of(const Shape& shape) { return rule_of(shape.kind).solid(shape); }

}  // namespace lockstep
