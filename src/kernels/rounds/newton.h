// Newton's method on the velocities of the solver, with bounds, kept couplings and contacts. SPDX-License-Identifier:
// Apache-2.0
//
// (M107), (M117). A round linearises the law of every contact slot and of every row over several velocities, holds the
// velocities that bounds hold, and solves with the masked factor of A + J^T G J. A search along the step follows in
// lanes where a law bends too much. Bounds of single velocities and limited servos then move to the neighbouring piece
// as in held_velocities.h. Where nothing has moved, multipliers of hard rows are updated. A lane that has finished has
// a step of 0.
#pragma once

#include "kernels/contacts/slips.h"
#include "kernels/tile/routines.h"
#include "rows.h"

namespace lockstep::kernels {

constexpr int most_trials = 40;          ///< of one search along a step: the pieces of a hard row are this short
constexpr double enough_descent = 0.1;   ///< of the slope, what a search may leave
constexpr double searched_above = 1e-4;  ///< of 1 + the largest velocity; shorter steps are taken whole

/// y = A v - rhs with the diagonal of this round, for the gradient.
template <class T>
void momentum_left(const Tables<ScalarOf<T>>& t, const T* v, const T* rhs, T* y, const Tile<T>& x) {
  const Columns& columns = t.rounds.columns;
  for (int j = 0; j < columns.n; ++j) y[j] = fnma(x.held.diagonal[j], v[j], rhs[j]);
  for (int j = 0; j < columns.n; ++j) {
    const T* const own = x.held.matrix + columns.offset[j];
    for (int k = 1, below = columns.size[j]; k < below; ++k) {
      y[j] = fnma(own[k], v[j + k], y[j]);
      y[j + k] = fnma(own[k], v[j], y[j + k]);
    }
  }
}

/// Slope and curvature of the line function of a step: what its contacts and rows add.
template <class T>
struct AlongStep {
  T force = T(0);  // du . impulse
  T gain = T(0);   // du . G du

  LOCKSTEP_INLINE void add(const ActingRow<T>& row, const Branch<T>& law) {
    force = fma(row.change, law.impulse, force);
    gain = fma(row.change * row.change, row_gain(row, law), gain);
  }
  LOCKSTEP_INLINE void add(const ContactSlot<T>& slot, const ContactForce<T>& law, const TurningFriction<T>* turning,
                           const TurningForce<T>* turning_law) {
    T product[3];
    times_gain(law, slot.change, product);
    if (turning) {
      const Vec3<T> own = add_turning_gain(*turning_law, slot.change, turning->change, product);
      force += dot(turning->change, turning_law->impulse);
      gain += dot(turning->change, own);
    }
    for (int i = 0; i < 3; ++i) {
      force = fma(slot.change[i], law.impulse[i], force);
      gain = fma(slot.change[i], product[i], gain);
    }
  }
};

/// With the laws `of` and `law`, which are known.
template <class T>
AlongStep<T> along_step(const Tables<ScalarOf<T>>& t, ContactForce<T> ContactSlot<T>::*of,
                        TurningForce<T> TurningFriction<T>::*turning_of_it, Branch<T> ActingRow<T>::*law, Tile<T>& x) {
  AlongStep<T> sum;
  each_row(t, x,
           [&](const RowSlot&, ActingRow<T>& row, const int*, const T*) LOCKSTEP_INLINED { sum.add(row, row.*law); });
  each_slot(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>& slot) LOCKSTEP_INLINED {
    TurningFriction<T>* const turning = turning_of(pair, slot, x);
    sum.add(slot, slot.*of, turning, turning ? &(turning->*turning_of_it) : nullptr);
  });
  return sum;
}

/// The law of a slot at the share a of the step, into its `trial`.
template <class T>
LOCKSTEP_INLINE void try_slot(const ContactPatch<T>& patch, T a, ContactSlot<T>& slot, TurningFriction<T>* turning) {
  T u[3];
  for (int i = 0; i < 3; ++i) u[i] = fma(a, slot.change[i], slot.speed[i]);
  const Vec3<T> turns = turning ? fma(turning->change, a, turning->speed) : Vec3<T>::zero();
  contact_force(slot, turning, patch.friction, u, turns, slot.trial, turning ? &turning->trial : nullptr);
}

/// All laws at the share a of the step, into `trial`.
template <class T>
AlongStep<T> try_share(const Tables<ScalarOf<T>>& t, T a, Tile<T>& x) {
  AlongStep<T> sum;
  each_row(t, x, [&](const RowSlot&, ActingRow<T>& row, const int*, const T*) LOCKSTEP_INLINED {
    row.trial = row_law(row, fma(a, row.change, row.speed));
    sum.add(row, row.trial);
  });
  each_slot(t, x, [&](const auto& pair, const ContactPatch<T>& patch, ContactSlot<T>& slot) LOCKSTEP_INLINED {
    TurningFriction<T>* const turning = turning_of(pair, slot, x);
    try_slot(patch, a, slot, turning);
    sum.add(slot, slot.trial, turning, turning ? &turning->trial : nullptr);
  });
  return sum;
}

/// What the step changes in all speeds, and the laws at its end, into `trial`. Returns the slope of the line function
/// there: what the laws miss of their linearisation. No product with A.
template <class T>
T try_step(const Tables<ScalarOf<T>>& t, const T* step, Tile<T>& x) {
  T slope = T(0);
  each_row(t, x, [&](const RowSlot& slot, ActingRow<T>& row, const int* velocity, const T* value) LOCKSTEP_INLINED {
    row.change = row_speed(slot, velocity, value, step);
    row.trial = row_law(row, row.change + row.speed);
    const T linear = row_gain(row, row.law) * row.change;
    slope = fma(row.change, (row.law.impulse - linear) - row.trial.impulse, slope);
  });
  each_near(t, x, [&](const auto& pair, const ContactPatch<T>& patch, const LiveSlots<T>& slots) LOCKSTEP_INLINED {
    const RelativeTwist<T> twist = twist_of(t, pair, x, step);
    for (ContactSlot<T>& slot : slots) {
      slot_speed(slot, twist, slot.change);
      TurningFriction<T>* const turning = turning_of(pair, slot, x);
      if (turning) turning->change = by_radii(pair, twist.turning);
      try_slot(patch, T(1), slot, turning);
      T linear[3];
      times_gain(slot.force, slot.change, linear);
      if (turning) {
        const Vec3<T> own = add_turning_gain(turning->force, slot.change, turning->change, linear);
        slope += dot(turning->change, (turning->force.impulse - own) - turning->trial.impulse);
      }
      for (int i = 0; i < 3; ++i)
        slope = fma(slot.change[i], (slot.force.impulse[i] - linear[i]) - slot.trial.impulse[i], slope);
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
  const AlongStep<T> start = along_step(t, &ContactSlot<T>::force, &TurningFriction<T>::force, &ActingRow<T>::law, x);
  const T stiff = -first_slope - start.gain;  // d A d
  const T enough = T(S(enough_descent)) * absolute(first_slope);
  T low = zero, high = one, a = one, slope = last_slope,
    curvature = stiff + along_step(t, &ContactSlot<T>::trial, &TurningFriction<T>::trial, &ActingRow<T>::trial, x).gain;
  for (int trial = 1; trial <= most_trials; ++trial) {
    const auto past = less(zero, slope);
    high = select(open & past, a, high), low = select(open & ~past, a, low);
    T next = a - slope / larger(curvature, T(S(1e-30)));
    next = select(less(low, next) & less(next, high), next, half * (low + high));
    a = select(open, trial == most_trials ? low : next, a);
    const AlongStep<T> here = try_share(t, a, x);
    slope = fma(a, stiff, first_slope + (start.force - here.force));
    curvature = stiff + here.gain;
    x.counts.trials += select(open, one, zero), x.counts.tile_trials += one;
    open = open & less(enough, absolute(slope));
    if (!any(open)) break;
  }
  return a;
}

/// The gradient, and the matrix of a round without what contacts and rows add to it. Servos are those of
/// begin_servos().
template <class T>
void begin_round(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  const int n = t.rounds.columns.n;
  T* const change = x.held.raw;
  set_goals(t, position_phase, x);
  round_terms(t, batch, position_phase, x);
  for (int k = 0; k < n; ++k) change[k] = x.rounds.z[k] - x.held.start[k];
  momentum_left(t, change, x.held.rhs, x.rounds.gradient, x);
  for (int k = 0; k < n; ++k) x.held.rhs[k] = x.rounds.gradient[k] = x.rounds.gradient[k] + x.rounds.momentum[k];
  for (int e = 0; e < t.rounds.columns.entries; ++e)  // no -0: beside a contact of another lane, 0 is added to it
    x.held.factor[e] = select(beyond(x.held.matrix[e], T(0)), x.held.matrix[e], T(0));
  for (int k = 0; k < n; ++k) x.held.factor[t.rounds.columns.offset[k]] = x.held.diagonal[k];
}

/// A step of Newton's method with held velocities masked.
template <class T>
void solve_round(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const T zero = T(0);
  T *const z = x.rounds.z, *const step = x.rounds.step;
  x.rounds.weak = x.rounds.weak | (factor_masked(t, x) & x.rounds.open);
  solve_masked(t, position_phase, z, x);
  T largest = zero, fastest = zero, slope = zero;
  for (int k = 0; k < t.rounds.columns.n; ++k) {
    step[k] = select(x.rounds.open, found_change(x, k), zero);
    slope = fnma(step[k], x.rounds.gradient[k] + x.held.impulse[k], slope);
    largest = farther(largest, step[k]), fastest = farther(fastest, z[k]);
  }
  x.rounds.largest = largest, x.rounds.fastest = fastest, x.rounds.slope = slope;
}

/// What the last step has done to the slots of a lane.
template <class T>
struct Regions {
  typename T::Mask changed;  // some slot sticks, slides or is off as it was not before
  typename T::Mask slides;   // some slot slides
};

/// Takes this share of the step: slots have the speeds and the laws there.
template <class T>
Regions<T> move_slots(const Tables<ScalarOf<T>>& t, T share, Tile<T>& x) {
  Regions<T> found{T::none(), T::none()};
  each_slot(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>& slot) LOCKSTEP_INLINED {
    const ContactForce<T>&from = slot.force, &to = slot.trial;
    found.changed = found.changed | (from.sticks & ~to.sticks) | (to.sticks & ~from.sticks) |
                    (from.slides & ~to.slides) | (to.slides & ~from.slides);
    found.slides = found.slides | from.slides | to.slides;
    for (int i = 0; i < 3; ++i) slot.speed[i] = fma(share, slot.change[i], slot.speed[i]);
    slot.force = slot.trial;
    if (TurningFriction<T>* const turning = turning_of(pair, slot, x)) {
      turning->speed = fma(turning->change, share, turning->speed);
      turning->force = turning->trial;
    }
  });
  return found;
}

/// J^T impulse of all contacts and rows at the iterate.
template <class T>
void momentum_of_impulses(const Tables<ScalarOf<T>>& t, T* momentum, Tile<T>& x) {
  momentum_of_contacts(t, momentum, x);
  add_row_momentum(t, momentum, x);
}

/// From the iterate x.rounds.z, whose speeds, forces and their momentum are known, to the solution. Slips are assumed
/// at most `passes` times. The first phase of the bounds has the momentum and the intervals. Returns the lanes of
/// `open` that have not finished.
template <class T>
typename T::Mask newton(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, typename T::Mask open,
                        int passes, Tile<T>& x) {
  using S = ScalarOf<T>;
  constexpr double tiny_step = sizeof(S) == 4 ? 1e-3 : 1e-6;
  const int n = t.rounds.columns.n;
  const T zero = T(0), one = T(1);
  T *const z = x.rounds.z, *const step = x.rounds.step;
  T pass = zero, round = zero;  // of each lane: its slip passes, and its rounds in the present one
  auto unfinished = T::none();
  Updates<T> updates;
  while (any(open)) {
    x.counts.rounds += select(open, one, zero), x.counts.tile_rounds += one;

    x.rounds.open = open;
    routine(t, x, Routine::begin_round, [&]() LOCKSTEP_INLINED { begin_round(t, batch, x); });
    add_gains(t, x.held.factor, x);
    add_row_gains(t, x.held.factor, x);
    routine(t, x, Routine::solve_round, [&]() LOCKSTEP_INLINED { solve_round(t, x); });
    const T largest = x.rounds.largest, fastest = x.rounds.fastest, slope = x.rounds.slope;

    // How the laws bend along the step, and a search where they bend too much.
    const T last = try_step(t, step, x);
    const T allowed = T(t.contacts.tolerance) * (one + fastest);
    const auto small = less(largest, allowed), tiny = less(largest, T(S(tiny_step)) * allowed);
    // A looser tolerance leaves no more unsearched: stiff rows would go to and fro between their pieces.
    const T unsearched = smaller(allowed, T(S(searched_above)) * (one + fastest));
    const auto bends = open & ~less(largest, unsearched) & less(T(S(enough_descent)) * absolute(slope), last);
    T share = one;
    if (any(bends)) {
      const bool fewer = any(open & ~bends);
      if (fewer) list_live_slots(t, bends, x);
      share = search_along(t, bends, slope, last, x);
      if (fewer) list_live_slots(t, open, x);
    }

    // The new iterate, and the pieces of the laws that it is on.
    const Regions<T> seen = move_slots(t, share, x);
    for (int k = 0; k < n; ++k) z[k] = select(open, select(bends, fma(share, step[k], z[k]), x.held.velocity[k]), z[k]);
    const auto changed = seen.changed | move_rows(t, z, bends, open, x);
    for (int k = 0; k < n; ++k) x.held.velocity[k] = z[k];
    const auto moved = move_pieces(t, batch, 1, ~less(round, T(S(all_move))), open, x);

    // A lane that has ended is solved once more beside others, to an impulse that differs by rounding.
    for (int r = 0; r < t.bounds.single; ++r) {
      const Branch<T>& own = x.search.branch[r];
      T& kept = x.rounds.single_impulse[r];
      kept = select(open, select(held(own), x.held.impulse[t.rounds.velocity[r]], own.impulse), kept);
    }

    // Lanes that have settled end, or update the multipliers of their hard rows, or assume other slips.
    const auto settled = open & ~changed & ~moved & ~bends;
    const auto finished = (settled & (~seen.slides | small)) | (open & tiny & ~moved);
    const auto updated = update_multipliers(t, z, settled, updates, x);
    round += select(open, one, zero);
    const auto over = open & ~finished & ~less(round, T(S(t.contacts.rounds)));
    const auto ends = over | (finished & ~updated), asks = ends & less(pass + one, T(S(passes)));
    const auto renewed = any(asks) ? renew_slips(t, asks, less(zero, pass), x) : asks;
    pass += select(renewed, one, zero), x.counts.passes += select(renewed, one, zero);
    round = select(renewed, zero, round);
    updates.count = select(renewed, zero, updates.count), updates.missing = select(renewed, zero, updates.missing);
    unfinished = unfinished | (over & ~renewed);
    const auto ended = ends & ~renewed;
    open = open & ~ended;
    if (!any(open)) break;
    if (any(ended)) list_live_slots(t, open, x);
    momentum_of_impulses(t, x.rounds.momentum, x);
  }
  if (!x.contacts.lists_all) list_live_slots(t, ~T::none(), x);
  return unfinished;
}

/// Where a solve begins: twice the velocity of the step's start less that of the step before (M107), and the guess of
/// the bounds there.
template <class T>
void begin_newton(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, typename T::Mask open,
                  Tile<T>& x) {
  const int n = t.rounds.columns.n;
  x.counts.solves += select(open, T(1), T(0));
  slot_speeds(t, x.rounds.z, &ContactSlot<T>::speed, x);
  each_slot(t, x, [&](const auto& pair, const ContactPatch<T>& patch, ContactSlot<T>& slot) LOCKSTEP_INLINED {
    contact_force(patch.friction, slot, turning_of(pair, slot, x));
  });
  evaluate_rows(t, x.rounds.z, x);
  momentum_of_impulses(t, x.rounds.momentum, x);
  for (int k = 0; k < n; ++k) {
    x.rounds.kept[k] = x.held.momentum[k];
    x.held.momentum[k] += x.rounds.momentum[k];
    x.held.mask[k] = T::none();
  }
  guess(t, batch, 1, open, open, T::none(), x);
  for (int r = 0; r < t.bounds.single; ++r)
    x.held.light[r] = T(1) / x.held.matrix[t.rounds.columns.offset[t.rounds.velocity[r]]];
  for (int k = 0; k < n; ++k) x.held.momentum[k] = x.rounds.kept[k];
}

}  // namespace lockstep::kernels
