// Sums that become parts of others, and the order in which they are added up. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "ir.h"

namespace lockstep::trace {

/// A sum as it was asked for: `first` and `second`, or `first` and the product of `second` and `factor`.
struct Sum {
  Id first, second, factor;
  bool subtracts;  ///< what is second
  int stage = 0;   ///< behind so many calls that are left out: what is before may be another number behind
  Id result = -1;
};

/// One of two that a sum was asked for with.
struct Term {
  int sum;
  bool second, minus;
  bool apart;  ///< a product, of which the sum takes the factors
};

/// A step written down, and the sums that it asked for, one after the other.
struct Tracing {
  Graph graph;
  std::vector<Sum> sums;
};

/// Of each sum all that is to be added up for it, one by one; nothing for those that become part of another one. What
/// nothing else wants becomes part of a sum: a product, which is rounded once with it, not twice, or a sum, whose parts
/// are added one by one. First comes a number, then what is known soonest: no addition waits for more than it must.
///
/// Decided by the whole step, so a step is recorded before, and all others, which are to round in the same places, go
/// by that: `any` is to have no two numbers in one that others have apart. In place more numbers are the same or
/// nothing: sums of which that is so stay as they are, and the order is the one that is best there. (`consistent` may
/// be `any`.)
std::vector<std::vector<Term>> terms_of(const Tracing& any, const Tracing& consistent);

}  // namespace lockstep::trace
