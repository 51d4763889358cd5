// Semi-implicit Euler: the step that every scene can take. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "coupling_impulses.h"
#include "integrate.h"
#include "kernels/couplings/coupling_error.h"
#include "kernels/couplings/folding.h"
#include "kernels/couplings/functions.h"
#include "kernels/couplings/joint_terms.h"
#include "kernels/couplings/solve_couplings.h"
#include "kernels/dynamics/bias_forces.h"
#include "kernels/dynamics/kinematics.h"
#include "kernels/loops/find_loops.h"
#include "kernels/loops/impulses.h"
#include "kernels/tile/routines.h"
#include "limited_servos.h"
#include "solve_bounds.h"
#include "solve_contacts.h"

namespace lockstep::kernels {

/// A, and the momentum that forces add.
template <class T>
void forces(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  bias_forces(t, batch, x);
  joint_inertias(t, batch, x);
  joint_forces(t, batch, x);
  inertia_matrix(t, batch, x);
  if (t.guesses_servos()) limited_drives(t, batch, x);
  if (t.undamped.count > 0) undamped_responses(t, x);
  if (t.reduction.by_entries()) reduce_matrix(t, x);
  if (t.folded.count > 0) fold_matrix(t, x);
  if (t.rounds.used()) keep_matrix(t, x);
}

template <class T>
void momenta(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  momenta_to_gain(t, x);
  if (t.folded.count > 0) fold_forces(t, x);
  if (t.rounds.used()) keep_momentum(t, x);
}

/// The step without bounds and contacts.
template <class T>
void free_step(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  factor_matrix(t, x);
  momenta(t, x);
  half_solve(t, x);
  if (t.rows.known_suffice)
    known_constraint_velocities(t, x);
  else if (t.rows.count > 0)
    solve_couplings(t, batch, x);
  solved_velocities(t, x);
  integrate(t, x);
}

template <class T>
void euler(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  // Where everything is.
  routine(t, x, Routine::kinematics, [&]() LOCKSTEP_INLINED { kinematics(t, x); });
  if (t.shares_change()) changing_shares(t, x);
  if (t.couplings > 0) coupling_errors(t, x);
  if (t.reduction.eliminates())
    follow(t, x);
  else if (t.reduction.used())
    start_velocities(t, x);
  const bool touching = t.contacts.used() && find_contacts(t, x);  // in all lanes, so nothing asks for a free step
  if (t.loops.used()) find_loops(t, batch, x);
  // Rounds that decide about servos, or hold loops, find the first solution.
  const bool searches = t.rounds.used() && t.solves_first();
  if (t.guesses_servos()) first_saturation_pass(x);
  do {  // again only if a guess about limited servos was wrong
    routine(t, x, Routine::forces, [&]() LOCKSTEP_INLINED { forces(t, batch, x); });
    if (t.bounds.rows.count > 0) clear_bounds(x);
    share_momenta(t, x);
    if (t.rows.count > 0 || !(touching || searches)) {
      routine(t, x, Routine::free_step, [&]() LOCKSTEP_INLINED { free_step(t, batch, x); });
    } else {
      x.singular = T::none();
      routine(t, x, Routine::momenta, [&]() LOCKSTEP_INLINED { momenta(t, x); });
    }

    // With them, in lanes where they act.
    if (!touching && (t.bounds.rows.count > 0 || searches) && bounds_active(t, batch, x)) solve_bounds(t, batch, x);
  } while (t.guesses_servos() && saturation_differs(t, batch, x));
  if (t.contacts.used()) touch(t, batch, !touching, x);
  if (t.loops.used()) {
    clear_loop_forces(t, x);
    add_loop_impulses(t, ~T::none(), x);
    end_loop_forces(t, t.dt, x);
  }
  if (t.record_impulses) coupling_impulses(t, batch, x);  // before the roots' axes turn
  turn_root_twists(t, x, x.next.v);
}

}  // namespace lockstep::kernels
