// Newton's method on the velocities of the solver, with contacts and bounds. SPDX-License-Identifier: Apache-2.0
//
// (M107). A round linearises the law of every slot, holds the velocities that the bounds hold, and solves with the
// masked factor of A + J^T G J. A search along the step follows in lanes where the law bends too much. Bounded rows and
// limited servos then move to the neighbouring piece as in held_velocities.h. A lane that has finished has a step of 0.
#pragma once

#include "kernels/bounds/held_velocities.h"
#include "law.h"

namespace lockstep::kernels {

constexpr int most_trials = 12;  ///< of one search along a step
constexpr double enough_descent = 0.1;

/// y = A v - rhs with the diagonal of this round, for the gradient.
template <class T>
void momentum_left(const Tables<ScalarOf<T>>& t, const T* v, const T* rhs, T* y, const Tile<T>& x) {
  const Columns& columns = t.solver;
  for (int j = 0; j < columns.n; ++j) y[j] = fnma(x.held.diagonal[j], v[j], rhs[j]);
  for (int j = 0; j < columns.n; ++j) {
    const T* const own = x.held.matrix + columns.offset[j];
    for (int k = 1, below = columns.size[j]; k < below; ++k) {
      y[j] = fnma(own[k], v[j + k], y[j]);
      y[j + k] = fnma(own[k], v[j], y[j + k]);
    }
  }
}

/// Evaluates the law of all slots at the speed u + a du, into `to`.
template <class T>
void evaluate(const Tables<ScalarOf<T>>& t, T a, ContactForce<T> ContactSlot<T>::*to, Tile<T>& x) {
  each_near(t, x, [&](const auto& pair, const ContactPatch<T>& patch, ContactSlot<T>* slots) LOCKSTEP_INLINED {
    for (int s = 0; s < pair.slots; ++s) {
      T u[3];
      for (int i = 0; i < 3; ++i) u[i] = fma(a, slots[s].change[i], slots[s].speed[i]);
      contact_force(slots[s], patch.friction, u, slots[s].*to);
    }
  });
}

/// Slope and curvature of the line function of a step: what its contacts add.
template <class T>
struct AlongStep {
  T force = T(0);  // du . impulse
  T gain = T(0);   // du . G du
};

template <class T>
AlongStep<T> along_step(const Tables<ScalarOf<T>>& t, ContactForce<T> ContactSlot<T>::*of, Tile<T>& x) {
  AlongStep<T> sum;
  each_near(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>* slots) LOCKSTEP_INLINED {
    for (int s = 0; s < pair.slots; ++s) {
      T product[3];
      times_gain(slots[s].*of, slots[s].change, product);
      for (int i = 0; i < 3; ++i) {
        sum.force = fma(slots[s].change[i], (slots[s].*of).impulse[i], sum.force);
        sum.gain = fma(slots[s].change[i], product[i], sum.gain);
      }
    }
  });
  return sum;
}

/// Slope of the line function at the whole step: what the law misses of its linearisation. No product with A.
template <class T>
T slope_at_end(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  T slope = T(0);
  each_near(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>* slots) LOCKSTEP_INLINED {
    for (int s = 0; s < pair.slots; ++s) {
      T linear[3];
      times_gain(slots[s].force, slots[s].change, linear);
      for (int i = 0; i < 3; ++i)
        slope = fma(slots[s].change[i], (slots[s].force.impulse[i] - linear[i]) - slots[s].trial.impulse[i], slope);
    }
  });
  return slope;
}

/// The share of the step at which the line function is least, in the lanes `open`; 1 in the others. The line function
/// is convex, so its slope rises: Newton within a bracket that closes. Leaves the law there in `trial`.
template <class T>
T search_along(const Tables<ScalarOf<T>>& t, typename T::Mask open, T first_slope, T last_slope, Tile<T>& x) {
  using S = ScalarOf<T>;
  const T zero = T(0), one = T(1), half = T(S(0.5));
  const AlongStep<T> start = along_step(t, &ContactSlot<T>::force, x);
  const T stiff = -first_slope - start.gain;  // d A d
  const T enough = T(S(enough_descent)) * absolute(first_slope);
  T low = zero, high = one, a = one, slope = last_slope,
    curvature = stiff + along_step(t, &ContactSlot<T>::trial, x).gain;
  for (int trial = 1; trial <= most_trials; ++trial) {
    const auto past = less(zero, slope);
    high = select(open & past, a, high), low = select(open & ~past, a, low);
    T next = a - slope / larger(curvature, T(S(1e-30)));
    next = select(less(low, next) & less(next, high), next, half * (low + high));
    a = select(open, trial == most_trials ? low : next, a);
    evaluate(t, a, &ContactSlot<T>::trial, x);
    const AlongStep<T> here = along_step(t, &ContactSlot<T>::trial, x);
    slope = fma(a, stiff, first_slope + (start.force - here.force));
    curvature = stiff + here.gain;
    open = open & less(enough, absolute(slope));
    if (!any(open)) break;
  }
  return a;
}

/// The matrix of a round, factored. Returns the lanes with a pivot that is too small.
template <class T>
typename T::Mask factor_with_contacts(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int e = 0; e < t.solver.entries; ++e) x.held.factor[e] = x.held.matrix[e] + T(0);  // no -0: others add 0 to it
  for (int z = 0; z < t.solver.n; ++z) x.held.factor[t.solver.offset[z]] = x.held.diagonal[z];
  add_gains(t, x.held.factor, x);
  return factor_masked(t, x);
}

/// What the last step has done to the slots of a lane.
template <class T>
struct Regions {
  typename T::Mask changed;  // some slot sticks, slides or is off as it was not before
  typename T::Mask slides;   // some slot slides
};

template <class T>
Regions<T> regions(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  Regions<T> found{T::none(), T::none()};
  each_near(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>* slots) LOCKSTEP_INLINED {
    for (int s = 0; s < pair.slots; ++s) {
      const ContactForce<T>&from = slots[s].force, &to = slots[s].trial;
      found.changed = found.changed | (from.sticks & ~to.sticks) | (to.sticks & ~from.sticks) |
                      (from.slides & ~to.slides) | (to.slides & ~from.slides);
      found.slides = found.slides | from.slides | to.slides;
    }
  });
  return found;
}

/// From the iterate x.contacts.z, whose speeds, forces and their momentum are known, to the solution of the present
/// targets. `phase` has the momentum, and slot 0 of the bounds the intervals. Returns the lanes of `open` that are not
/// finished.
template <class T>
typename T::Mask newton(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, typename T::Mask open,
                        Tile<T>& x) {
  using S = ScalarOf<T>;
  constexpr double tiny_step = sizeof(S) == 4 ? 1e-3 : 1e-6;
  const int n = t.solver.n;
  const T zero = T(0), one = T(1);
  T *const z = x.contacts.z, *const step = x.contacts.step;
  for (int round = 0; round < t.contacts.rounds && any(open); ++round) {
    set_goals(t, position_phase, x);
    round_terms(t, batch, position_phase, x);
    for (int k = 0; k < n; ++k) step[k] = z[k] - x.dynamics.start[k];
    momentum_left(t, step, x.held.rhs, x.contacts.gradient, x);
    for (int k = 0; k < n; ++k)
      x.held.rhs[k] = x.contacts.gradient[k] = x.contacts.gradient[k] + x.contacts.momentum[k];
    x.contacts.weak = x.contacts.weak | factor_with_contacts(t, x);
    solve_masked(t, position_phase, z, x);
    T largest = zero, fastest = zero, slope = zero;
    for (int k = 0; k < n; ++k) {
      step[k] = select(open, found_change(x, k), zero);
      slope = fnma(step[k], x.contacts.gradient[k] + x.held.impulse[k], slope);
      largest = farther(largest, step[k]), fastest = farther(fastest, z[k]);
    }
    slot_speeds(t, step, &ContactSlot<T>::change, x);
    evaluate(t, one, &ContactSlot<T>::trial, x);
    const T allowed = T(t.contacts.tolerance) * (one + fastest);
    const auto small = less(largest, allowed), tiny = less(largest, T(S(tiny_step)) * allowed);
    const T last = slope_at_end(t, x);
    const auto bends = open & ~small & less(T(S(enough_descent)) * absolute(slope), last);
    const T share = any(bends) ? search_along(t, bends, slope, last, x) : one;
    const Regions<T> seen = regions(t, x);
    const auto finished = ((~seen.slides | small) & ~seen.changed & ~bends) | tiny;
    for (int k = 0; k < n; ++k) z[k] = select(open, select(bends, fma(share, step[k], z[k]), x.held.velocity[k]), z[k]);
    each_near(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>* slots) LOCKSTEP_INLINED {
      for (int s = 0; s < pair.slots; ++s) {
        for (int i = 0; i < 3; ++i) slots[s].speed[i] = fma(share, slots[s].change[i], slots[s].speed[i]);
        slots[s].force = slots[s].trial;
      }
    });
    for (int k = 0; k < n; ++k) x.held.velocity[k] = z[k];
    const auto moved = move_pieces(t, batch, 1, round >= all_move, open, x);
    open = open & ~(finished & ~moved);
    if (any(open)) momentum_of_contacts(t, x.contacts.momentum, x);
  }
  return open;
}

/// Where a solve begins: twice the velocity of the step's start less that of the step before (M107), and the guess of
/// the bounds there.
template <class T>
void begin_newton(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, typename T::Mask open,
                  Tile<T>& x) {
  const int n = t.solver.n, rows = t.bounds.rows.count;
  slot_speeds(t, x.contacts.z, &ContactSlot<T>::speed, x);
  each_near(t, x, [&](const auto& pair, const ContactPatch<T>& patch, ContactSlot<T>* slots) LOCKSTEP_INLINED {
    for (int s = 0; s < pair.slots; ++s) contact_force(slots[s], patch.friction, slots[s].speed, slots[s].force);
  });
  momentum_of_contacts(t, x.contacts.momentum, x);
  for (int k = 0; k < n; ++k) {
    x.contacts.kept[k] = x.held.momentum[k];
    x.held.momentum[k] += x.contacts.momentum[k];
    x.held.mask[k] = T::none();
  }
  guess(t, batch, 1, open, T::none(), x);
  for (int r = 0; r < rows; ++r) x.held.light[r] = T(1) / x.held.matrix[t.solver.offset[t.bounds.velocity[r]]];
  for (int k = 0; k < n; ++k) x.held.momentum[k] = x.contacts.kept[k];
}

}  // namespace lockstep::kernels
