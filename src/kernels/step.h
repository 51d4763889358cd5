// The step of one tile: the main path, stage by stage. SPDX-License-Identifier: Apache-2.0
//
//     M(q) dv/dt + c(q, v) = tau,   C = J q + gamma = 0
//
// docs/mathematics.md has the formulas; comments cite them as (M12). An integrator says in which order the stages come:
// euler.h is the one to read first. A stage whose table is empty does not run.
#pragma once

#include "../simd/denormals.h"
#include "check.h"
#include "diagnostics.h"
#include "euler.h"
#include "lay_out.h"
#include "leapfrog.h"
#include "load.h"
#include "runge_kutta.h"
#include "store.h"

namespace lockstep::kernels {

template <class T>
void step(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  switch (t.integrator) {
    case integrator_leapfrog: leapfrog_step(t, lanes, x); break;
    case integrator_extrapolated: extrapolated_step(t, lanes, x); break;
    case integrator_runge_kutta: runge_kutta_step(t, lanes, x); break;
    default: euler(t, lanes, x); break;
  }
  if (t.record_diagnostics) diagnose(t, lanes, x);
  check(t, lanes, x);
  if (t.record_diagnostics) add_energies(x);
}

/// Tables' way of a step. Generated code for one plan is another (generate/).
struct ByTables {
  static constexpr int together = 1;  ///< tiles that it steps in turn, part by part
  static constexpr int keeps = 0;     ///< numbers of each that go from part to part
  template <class S>
  LOCKSTEP_INLINE static Outline outline(const Tables<S>& t) {
    return kernels::outline(t);
  }
  template <class T>
  LOCKSTEP_INLINE static void step(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>* lanes, Tile<T>* x, T* const*,
                                   int) {
    kernels::step(t, *lanes, *x);
  }
};

/// `substeps` steps of environments [first, last), whole tiles, in the scratch block: room for Way::together of them
/// and for what is kept of each.
template <class T, class Way = ByTables>
void advance(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, std::ptrdiff_t first, std::ptrdiff_t last,
             int substeps, void* scratch) {
  const simd::FlushDenormals flush;
  Tile<T> x[Way::together];
  Lanes<ScalarOf<T>> own[Way::together];
  T* kept[Way::together];
  for (int k = 0; k < Way::together; ++k) {
    void* const behind = static_cast<char*>(scratch) + lay_out(t, scratch, x[k]);
    kept[k] = static_cast<T*>(behind);
    scratch = kept[k] + Way::keeps;
    uniform_masses(t, x[k]);
    uniform_ratios(t, x[k]);
  }
  const Outline known = Way::outline(t);
  for (int k = 0; k < Way::together; ++k) own[k] = at(lanes, first + k * T::lanes, known);
  while (first < last) {
    int tiles = 0;
    for (; tiles < Way::together && first < last; ++tiles, first += T::lanes) load(t, own[tiles], x[tiles], known);
    for (int i = 0; i < substeps; ++i) Way::step(t, own, x, kept, tiles);
    for (int k = 0; k < tiles; ++k) {
      store(t, own[k], x[k], known);
      move(own[k], Way::together * T::lanes, known);
    }
  }
}

}  // namespace lockstep::kernels
