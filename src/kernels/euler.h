// Semi-implicit Euler: the step that takes everything, bounds among it. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "bias_forces.h"
#include "compete.h"
#include "coupling_error.h"
#include "couplings.h"
#include "free_velocity.h"
#include "impulses.h"
#include "integrate.h"
#include "joint_terms.h"
#include "kinematics.h"
#include "saturation.h"

namespace lockstep::kernels {

template <class T>
void euler(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  kinematics(t, x);
  if (t.couplings > 0) coupling_errors(t, x);
  if (t.reduction.eliminates()) follow(t, x);
  if (t.reduction.keeps_speeds()) measure_speeds(t, x);
  if (t.limited.count > 0) first_pass(x);
  do {  // once, and again where a servo turns out to be at its limit of effort, or not to be
    bias_forces(t, lanes, x);
    joint_inertias(t, lanes, x);
    joint_forces(t, lanes, x);
    inertia_matrix(t, x);
    if (t.limited.count > 0) limited_drives(t, lanes, x);
    if (t.natural.count > 0) natural_responses(t, x);
    if (t.reduction.by_entries()) reduce_matrix(t, x);
    if (t.bounds.form.count > 0) forget_bounds(x);
    factor_matrix(t, x);
    free_velocity(t, x);
    if (t.rows.prescribed)
      prescribe_speeds(t, x);
    else if (t.rows.count > 0)
      solve_couplings(t, lanes, x);
    solved_velocities(t, x);
    integrate(t, x);
    if (t.bounds.form.count > 0 && bounds_act(t, x)) compete(t, lanes, x);
  } while (t.limited.count > 0 && saturation_differs(t, lanes, x));
  if (t.record_impulses) coupling_impulses(t, x);  // in the axes of the step's start
  if (t.floating) turn_root_twist(x.half_turn, x.next_v);
}

}  // namespace lockstep::kernels
