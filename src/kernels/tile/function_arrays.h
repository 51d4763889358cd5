// Arrays of the functions that followers are of a joint. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "state.h"

namespace lockstep::kernels {

template <class T>
struct FunctionArrays {
  T* number;        // [numbers] of all functions
  T* piece;         // [4] by point of a table
  T* bend;          // [functions] f'' where the shares are
  T* acceleration;  // [followers] at constant velocities of the others (M139)

  template <class Take>
  void arrays(const Tables<ScalarOf<T>>& t, Take& take) {
    const auto& f = t.functions;
    take("functions.number", number, f.number.count, Lifetime::call);
    take("functions.piece", piece, f.piece.count, Lifetime::call);
    take("functions.bend", bend, f.places.count);
    take("functions.acceleration", acceleration, t.reduction.followers);
  }
};

}  // namespace lockstep::kernels
