// Which sums become part of other sums, and the order of their terms. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "ir.h"

namespace lockstep::trace {

/// A sum as a kernel has it: `first` plus `second`, or `first` plus the product of `second` and `factor`.
struct Sum {
  Id first, second, factor;
  bool subtracts;  ///< minus in place of plus
  int stage = 0;   ///< how many calls were left out before it; each may change numbers
  Id result = -1;
};

/// One of the two operands of a sum.
struct Term {
  int sum;
  bool second, minus;
  bool apart;  ///< a product, whose factors go into a multiply-add
};

/// A traced step, and its sums in order.
struct Tracing {
  Graph graph;
  std::vector<Sum> sums;
};

/// By sum, the terms to add up one by one. A sum without terms becomes part of another one.
///
/// A product or a sum that nothing else uses becomes part of the sum that uses it. Then a product is rounded once, with
/// the sum, and the terms of an inner sum are added one by one. The first term is a number that is not a product. The
/// others follow in the order in which they are known, so no addition waits longer than it must.
///
/// This needs the whole step, so the step is traced once to decide. All further tracings use the same terms and so
/// round in the same places. `any` is the step of any tile. In `consistent`, the step of consistent followers, more
/// numbers are equal or zero: a sum for which that is so stays as it is. The order is the best one for `consistent`,
/// which may be `any`.
std::vector<std::vector<Term>> terms_of(const Tracing& any, const Tracing& consistent);

}  // namespace lockstep::trace
