// One bounded row alone: which of its conditions it is held by, and by what impulse (M50). SPDX-License-Identifier: Apache-2.0
#pragma once

#include "intervals.h"

namespace lockstep::kernels {

/// A row as it is asked in one phase.
template <class T>
struct Bound {
  T lo, hi, centre, force;
  T interval_cfm, box_cfm;
};

template <class T>
struct Branch {
  typename T::Mask held;  ///< u + cfm impulse = target; elsewhere the impulse is known
  T target, cfm;
  T impulse;
};

/// `speed` is what the row would have without its own impulse, `response` its r.
template <class T>
LOCKSTEP_INLINE Branch<T> project(const Bound<T>& row, T speed, T response) {
  const T inside = response + row.interval_cfm, wanted = -((speed + row.centre) / (response + row.box_cfm));
  const T slipping = clamp(wanted, -row.force, row.force);
  const T reached = fma(inside, slipping, speed);
  const auto below = less(reached, row.lo), above = less(row.hi, reached);
  const auto stopped = below | above, stuck = less(-row.force, wanted) & less(wanted, row.force);
  Branch<T> branch;
  branch.held = stopped | stuck;
  branch.target = select(below, row.lo, select(above, row.hi, -row.centre));
  branch.cfm = select(stopped, row.interval_cfm, row.box_cfm);
  branch.impulse = select(stopped, (branch.target - speed) / inside, slipping);
  return branch;
}

}  // namespace lockstep::kernels
