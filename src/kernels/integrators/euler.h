// Semi-implicit Euler, the only integrator for scenes with bounds. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "coupling_impulses.h"
#include "integrate.h"
#include "kernels/couplings/coupling_error.h"
#include "kernels/couplings/free_velocity.h"
#include "kernels/couplings/joint_terms.h"
#include "kernels/couplings/solve_couplings.h"
#include "kernels/dynamics/bias_forces.h"
#include "kernels/dynamics/kinematics.h"
#include "limited_servos.h"
#include "solve_bounds.h"

namespace lockstep::kernels {

template <class T>
void euler(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  kinematics(t, x);
  if (t.couplings > 0) coupling_errors(t, x);
  if (t.reduction.eliminates()) follow(t, x);
  if (t.reduction.has_constraint_velocities()) start_constraint_velocities(t, x);
  if (t.limited_servos.count > 0) first_saturation_pass(x);
  do {  // again only if a guess about limited servos was wrong
    bias_forces(t, batch, x);
    joint_inertias(t, batch, x);
    joint_forces(t, batch, x);
    inertia_matrix(t, batch, x);
    if (t.limited_servos.count > 0) limited_drives(t, batch, x);
    if (t.undamped.count > 0) undamped_responses(t, x);
    if (t.reduction.by_entries()) reduce_matrix(t, x);
    if (t.bounds.rows.count > 0) clear_bounds(x);
    factor_matrix(t, x);
    free_velocity(t, x);
    if (t.rows.known_suffice)
      known_constraint_velocities(t, x);
    else if (t.rows.count > 0)
      solve_couplings(t, batch, x);
    solved_velocities(t, x);
    integrate(t, x);
    if (t.bounds.rows.count > 0 && bounds_active(t, batch, x)) solve_bounds(t, batch, x);
  } while (t.limited_servos.count > 0 && saturation_differs(t, batch, x));
  if (t.record_impulses) coupling_impulses(t, batch, x);  // before the roots' axes turn
  turn_root_twists(t, x, x.next.v);
}

}  // namespace lockstep::kernels
