// One bounded row by itself: the part of (M54) that it is on, and its impulse. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "intervals.h"

namespace lockstep::kernels {

/// Relative tolerance within which a row meets its condition.
template <class T>
LOCKSTEP_INLINE T rounding() {
  return T::by_precision(4e-6, 1e-14);
}

/// A row in one phase: its interval, its box of +-force around -centre, and its compliance.
template <class T>
struct Bound {
  T lo, hi, centre, force;
  T cfm;
};

/// Whether the row holds an end of its interval or sticks. Otherwise its impulse is known.
template <class T>
LOCKSTEP_INLINE typename T::Mask held(const Branch<T>& b) {
  return b.low | b.high | b.stuck;
}

/// Takes the other branch in these lanes.
template <class T>
LOCKSTEP_INLINE void replace(Branch<T>& own, const Branch<T>& other, typename T::Mask lanes) {
  own.low = (own.low & ~lanes) | (other.low & lanes);
  own.high = (own.high & ~lanes) | (other.high & lanes);
  own.stuck = (own.stuck & ~lanes) | (other.stuck & lanes);
  own.impulse = select(lanes, other.impulse, own.impulse);
}

/// What u + cfm impulse of a held row must be.
template <class T>
LOCKSTEP_INLINE T target(const Bound<T>& row, const Branch<T>& b) {
  return select(b.low, row.lo, select(b.high, row.hi, -row.centre));
}

/// Whether the row may stick: its centre is in its interval.
template <class T>
LOCKSTEP_INLINE typename T::Mask may_stick(const Bound<T>& row) {
  return ~less(-row.centre, row.lo) & ~less(row.hi, -row.centre);
}

/// (M55): `speed` is the row's speed without its own impulse, `response` its r.
template <class T>
LOCKSTEP_INLINE Branch<T> project(const Bound<T>& row, T speed, T response) {
  const T denominator = response + row.cfm, wanted = -((speed + row.centre) / denominator);
  const T slipping = clamp(wanted, -row.force, row.force);
  const T reached = fma(denominator, slipping, speed);
  Branch<T> b;
  b.low = less(reached, row.lo);
  b.high = less(row.hi, reached) & ~b.low;
  const auto stopped = b.low | b.high;
  b.stuck = less(-row.force, wanted) & less(wanted, row.force) & ~stopped;
  b.impulse = select(stopped, (target(row, b) - speed) / denominator, slipping);
  return b;
}

/// The part of (M54) that a row moves to where its speed and impulse have left the present one by more than rounding,
/// which is `slack` in speed and `slack_impulse` in impulse. `changed` gets the lanes in which it moves.
template <class T>
LOCKSTEP_INLINE Branch<T> advance_branch(const Bound<T>& row, const Branch<T>& b, T speed, T impulse, T slack,
                                         T slack_impulse, typename T::Mask& changed) {
  const T zero = T(0), force = row.force, centre = -row.centre;
  const auto open = less(row.lo, row.hi);  // where lo = hi the row holds with any impulse
  const T above_low = select(less(row.lo, centre), force, -force),
          below_high = select(less(centre, row.hi), -force, force);
  const auto leaves_low = b.low & open & less(impulse, above_low - slack_impulse);
  const auto leaves_high = b.high & open & less(below_high + slack_impulse, impulse);
  const auto slips_up = b.stuck & less(force + slack_impulse, impulse);
  const auto slips_down = b.stuck & less(impulse, -(force + slack_impulse));
  const auto free = ~held(b);
  // A row that slips past its centre sticks before it may reach an end, or it could go round for ever.
  const auto passes = free & ((less(zero, b.impulse) & less(centre + slack, speed)) |
                              (less(b.impulse, zero) & less(speed, centre - slack)));
  const auto within = may_stick(row);
  const auto below = free & less(speed, row.lo - slack) & ~(passes & within),
             above = free & less(row.hi + slack, speed) & ~below & ~(passes & within);
  const auto sticks = passes & ~below & ~above;
  Branch<T> next;
  next.low = (b.low & ~leaves_low) | below;
  next.high = (b.high & ~leaves_high) | above;
  next.stuck = (b.stuck & ~slips_up & ~slips_down) | sticks;
  next.impulse = select(leaves_low, above_low, select(leaves_high, below_high, b.impulse));
  next.impulse = select(slips_up, force, select(slips_down, -force, next.impulse));
  changed = leaves_low | leaves_high | slips_up | slips_down | below | above | sticks;
  return next;
}

}  // namespace lockstep::kernels
