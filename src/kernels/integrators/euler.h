// Semi-implicit Euler, the only integrator for scenes with bounds. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "coupling_impulses.h"
#include "integrate.h"
#include "kernels/couplings/coupling_error.h"
#include "kernels/couplings/folding.h"
#include "kernels/couplings/joint_terms.h"
#include "kernels/couplings/solve_couplings.h"
#include "kernels/dynamics/bias_forces.h"
#include "kernels/dynamics/kinematics.h"
#include "limited_servos.h"
#include "solve_bounds.h"
#include "solve_contacts.h"

namespace lockstep::kernels {

template <class T>
void euler(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  kinematics(t, x);
  if (t.couplings > 0) coupling_errors(t, x);
  if (t.reduction.eliminates())
    follow(t, x);
  else if (t.reduction.used())
    start_velocities(t, x);
  const bool limited = t.limited_servos.count > 0, by_velocity = t.bounds.by_velocity;
  if (limited && !by_velocity) first_saturation_pass(x);
  const bool solves = !(t.contacts.used() && find_contacts(t, x));  // the step without contacts
  do {  // again only if a guess about limited servos was wrong
    bias_forces(t, batch, x);
    joint_inertias(t, batch, x);
    joint_forces(t, batch, x);
    inertia_matrix(t, batch, x);
    if (limited && !by_velocity) limited_drives(t, batch, x);
    if (t.undamped.count > 0) undamped_responses(t, x);
    if (t.reduction.by_entries()) reduce_matrix(t, x);
    if (t.folded.count > 0) fold_matrix(t, x);
    if (t.bounds.rows.count > 0) clear_bounds(x);
    if (by_velocity) keep_matrix(t, x);
    const bool by_search = limited && by_velocity;  // which then finds the first solution
    if (!solves) x.singular = T::none();
    if (solves && !by_search) factor_matrix(t, x);
    momenta_to_gain(t, x);
    if (t.folded.count > 0) fold_forces(t, x);
    if (by_velocity) keep_momentum(t, x);
    if (solves && !by_search) {
      half_solve(t, x);
      if (t.rows.known_suffice)
        known_constraint_velocities(t, x);
      else if (t.rows.count > 0)
        solve_couplings(t, batch, x);
      solved_velocities(t, x);
      integrate(t, x);
    }
    const bool bounded = t.bounds.rows.count > 0 || by_search;
    if (solves && bounded && bounds_active(t, batch, x)) solve_bounds(t, batch, x);
  } while (limited && !by_velocity && saturation_differs(t, batch, x));
  if (t.contacts.used()) touch(t, batch, solves, x);
  if (t.record_impulses) coupling_impulses(t, batch, x);  // before the roots' axes turn
  turn_root_twists(t, x, x.next.v);
}

}  // namespace lockstep::kernels
