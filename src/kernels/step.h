// The step of one tile: the main path, stage by stage. SPDX-License-Identifier: Apache-2.0
//
//     M(q) dv/dt + c(q, v) = tau,   C = J q + gamma = 0
//
// docs/mathematics.md has the formulas; comments cite them as (M12). A stage whose table is empty does not run.
#pragma once

#include "../simd/denormals.h"
#include "bias_forces.h"
#include "check.h"
#include "compete.h"
#include "coupling_error.h"
#include "diagnostics.h"
#include "direct.h"
#include "elimination.h"
#include "free_velocity.h"
#include "impulses.h"
#include "integrate.h"
#include "joint_terms.h"
#include "kinematics.h"
#include "lay_out.h"
#include "load.h"
#include "mass_matrix.h"
#include "pgs.h"
#include "responses.h"
#include "row_terms.h"
#include "saturation.h"
#include "store.h"
#include "tgs.h"

namespace lockstep::kernels {

template <class T>
void step(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  kinematics(t, x);
  if (t.couplings > 0) coupling_errors(t, lanes, x);
  if (t.limited.count > 0) first_pass(x);
  do {  // once, and again where a servo turns out to be at its limit of effort, or not to be
    bias_forces(t, lanes, x);
    mass_matrix(t, x);
    joint_terms(t, lanes, x);
    if (t.limited.count > 0) limited_drives(t, lanes, x);
    if (t.natural.count > 0) natural_responses(t, x);
    if (t.reduction.followers > 0) eliminate(t, x);
    if (t.bounds.form.count > 0) forget_bounds(x);
    free_velocity(t, x);
    if (t.rows.count > 0) {
      responses(t, x);
      row_terms(t, lanes, x);
      switch (t.method) {
        case method_pgs: pgs(t, x); break;
        case method_tgs: tgs(t, x); break;
        default: direct(t, x); break;  // direct, and what reduced leaves to solve
      }
    }
    solved_velocities(t, x);
    integrate(t, x);
    if (t.bounds.form.count > 0 && bounds_act(t, x)) compete(t, lanes, x);
  } while (t.limited.count > 0 && saturation_differs(t, lanes, x));
  if (t.record_impulses) coupling_impulses(t, x);  // in the axes of the step's start
  if (t.floating) turn_root_twist(x);
  if (t.record_diagnostics) diagnose(t, lanes, x);
  check(t, lanes, x);
  if (t.record_diagnostics) add_energies(x);
}

/// Tables's way of a step. Generated code for one plan is another (generate/).
struct ByTables {
  template <class T>
  LOCKSTEP_INLINE static void step(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
    kernels::step(t, lanes, x);
  }
};

/// `substeps` steps of environments [first, last), whole tiles, in the scratch block.
template <class T, class Way = ByTables>
void advance(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, std::ptrdiff_t first, std::ptrdiff_t last,
             int substeps, void* scratch) {
  const simd::FlushDenormals flush;
  Tile<T> x;
  lay_out(t, scratch, x);
  uniform_masses(t, x);
  uniform_ratios(t, x);
  for (std::ptrdiff_t environment = first; environment < last; environment += T::lanes) {
    const Lanes<ScalarOf<T>> own = at(lanes, environment);
    load(t, own, x);
    for (int i = 0; i < substeps; ++i) Way::step(t, own, x);
    store(t, own, x);
  }
}

}  // namespace lockstep::kernels
