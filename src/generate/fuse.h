// Sums that a product is to become part of. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "graph.h"

namespace lockstep::generate {

/// A sum or difference as it was asked for, and what came of it.
struct Sum {
  Id a, b, result;  ///< result is -1 for a multiply-add that is no plain sum
};

enum class Fuses : char { none, first, second };  ///< the operand that is the product

/// Of each sum: a product that nothing else wants, or a sum of products, becomes part of it. Decided by the whole step, so a step is recorded
/// twice, and one with less to do, which is to round in the same places, goes by what the whole one decided.
std::vector<Fuses> fuses_of(const Graph& graph, const std::vector<Sum>& sums);

}  // namespace lockstep::generate
