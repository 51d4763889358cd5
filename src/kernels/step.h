// The step of one tile: the main path, stage by stage. SPDX-License-Identifier: Apache-2.0
//
//     M(q) dv/dt + c(q, v) = tau,   C = J q + gamma = 0
//
// docs/mathematics.md has the formulas; comments cite them as (M12). Each integrator calls the stages in its own order;
// read euler.h first. A stage whose table is empty does not run.
#pragma once

#include "audit.h"
#include "check.h"
#include "diagnostics.h"
#include "kernels/couplings/actuators.h"
#include "kernels/integrators/euler.h"
#include "kernels/integrators/leapfrog.h"
#include "kernels/integrators/runge_kutta.h"
#include "kernels/tile/lay_out.h"
#include "load.h"
#include "records.h"
#include "simd/floating_point_mode.h"
#include "store.h"

namespace lockstep::kernels {

template <class T>
void step(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  if (t.tendons.count > 0) place_tendons(t, x);
  if (t.actuators.used()) actuate(t, batch, x);
  if (t.record_accelerations) keep_velocities(t, x);
  switch (t.integrator) {
    case Integrator::leapfrog: leapfrog_step(t, batch, x); break;
    case Integrator::extrapolated: extrapolated_step(t, batch, x); break;
    case Integrator::runge_kutta: runge_kutta_step(t, batch, x); break;
    default: euler(t, batch, x); break;
  }
  if (t.functions.used()) place_curved(t, x, x.next.q, x.next.v);
  if (t.spatial.used()) place_spatial_tendons(t, x, x.next);
  if (t.record_diagnostics) diagnose(t, batch, x);
  if (t.record_efforts && t.integrator == Integrator::euler) euler_efforts(t, batch, x);
  if (t.sums_contacts() && t.integrator == Integrator::euler) {
    clear_contact_impulses(t, x);
    add_contact_impulses(t, ~T::none(), x);
  }
  if (t.audited) audit_if(t, batch, x);
  if (t.balls.count > 0) {
    wrap_balls(t, x.next.q);
    if (t.audited) x.audit.state->known = T::none();  // energies of the numbers that the next step begins with
  }
  check(t, batch, x);
  if (t.spatial.used() && (t.turning.count > 0 || t.balls.count > 0))  // to the last bit of angles without whole turns
    place_spatial_tendons(t, x, x.state);
  if (t.record_diagnostics) add_energies(x);
  if (t.records_calls()) add_records(t, x);
}

/// A step by the tables. Compiled and generated code have types of their own in place of this one.
struct ByTables {
  static constexpr int tiles_per_call = 1;  ///< the most that it steps in turn, part by part
  LOCKSTEP_INLINE int tiles() const { return 1; }
  /// Numbers of each tile behind its arrays.
  LOCKSTEP_INLINE int carried() const { return 0; }
  template <class S>
  LOCKSTEP_INLINE static TileShape shape(const Tables<S>& t) {
    return kernels::tile_shape(t);
  }
  template <class T>
  LOCKSTEP_INLINE void begin(const Tables<ScalarOf<T>>&, const StatePointers<ScalarOf<T>>&, Tile<T>&, T*, int) {}
  template <class T>
  LOCKSTEP_INLINE void step(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>* batch, Tile<T>* x,
                            T* const*, int) {
    kernels::step(t, *batch, *x);
  }
};

/// Takes `substeps` steps of environments [first, last), which are whole tiles. The scratch block has room for
/// way.tiles() tiles and their carried numbers.
template <class T, class Way>
LOCKSTEP_INLINE void advance(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch,
                             std::ptrdiff_t first, std::ptrdiff_t last, int substeps, void* scratch, Way way) {
  const simd::StepMode mode;
  Tile<T> x[Way::tiles_per_call];
  StatePointers<ScalarOf<T>> own[Way::tiles_per_call];
  T* carried[Way::tiles_per_call];
  for (int k = 0; k < way.tiles(); ++k) {
    void* const behind = static_cast<char*>(scratch) + lay_out(t, scratch, x[k]);
    carried[k] = static_cast<T*>(behind);
    scratch = carried[k] + way.carried();
    uniform_masses(t, x[k]);
    uniform_ratios(t, x[k]);
  }
  const TileShape shape = Way::shape(t);
  for (int k = 0; k < way.tiles(); ++k) own[k] = at(t, batch, first + k * T::lanes);
  while (first < last) {
    int tiles = 0;
    for (; tiles < way.tiles() && first < last; ++tiles, first += T::lanes) {
      load(t, own[tiles], x[tiles], shape);
      way.begin(t, own[tiles], x[tiles], carried[tiles], tiles);
    }
    for (int i = 0; i < substeps; ++i) {
      for (int k = 0; k < tiles; ++k) x[k].step = static_cast<std::uint32_t>(i);
      way.step(t, own, x, carried, tiles);
    }
    for (int k = 0; k < tiles; ++k) {
      store(t, own[k], x[k], shape);
      move(t, own[k], way.tiles() * T::lanes);
    }
  }
}

/// The same by the tables.
template <class T>
void advance_by_tables(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, std::ptrdiff_t first,
                       std::ptrdiff_t last, int substeps, void* scratch) {
  advance<T>(t, batch, first, last, substeps, scratch, ByTables{});
}

}  // namespace lockstep::kernels
