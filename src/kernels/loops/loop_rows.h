// Loops as rows of the Newton rounds: what they ask for, and how far they yield. SPDX-License-Identifier: Apache-2.0
//
// (M131). All rows that hold the origins of a loop have one response (M118), their mean, and so have those that hold
// its directions. What moves hardly anything of what the bodies move against each other takes no impulse: a planar loop
// has such rows.
#pragma once

#include "kernels/bounds/held_velocities.h"

namespace lockstep::kernels {

constexpr double fastest_closing = 3.0;  ///< of a hard loop, m/s and rad/s
constexpr double slow_closing = 0.1;     ///< what of that may stay in the velocities, m/s and rad/s
constexpr double slipped = 2e-3;         ///< gap of a loop that has a force limit and did not hold, m and rad
constexpr double moves_nothing = 1e-7;   ///< a row's own response, as a share of that of all directions

/// The largest impulse of row i of a loop, over a step.
template <class S>
LOCKSTEP_INLINE S limit_of(const HeldLoop<S>& loop, int i) {
  return i < loop.translations ? loop.force : loop.torque;
}
template <class T>
LOCKSTEP_INLINE typename T::Mask is_at_limit(const HeldLoop<ScalarOf<T>>& loop, int i, T impulse) {
  return ~less(absolute(impulse), T(limit_of(loop, i)) * T(ScalarOf<T>(1 - 1e-5)));
}

/// Lanes in which row i of a hard loop with a force limit is open as it is after it has slipped.
template <class T>
LOCKSTEP_INLINE typename T::Mask has_opened(const HeldLoop<ScalarOf<T>>& loop, int i, T gap) {
  using S = ScalarOf<T>;
  return loop.soft || !(limit_of(loop, i) < S(unlimited)) ? T::none() : beyond(gap, T(S(slipped)));
}

/// The speed by which row i closes its loop, (M131). At a midpoint, close_loops() moves the positions of rows that
/// hold; one that has slipped comes back by no more than its force.
template <class T>
LOCKSTEP_INLINE T closing_speed(const Tables<ScalarOf<T>>& t, const HeldLoop<ScalarOf<T>>& loop, int i, T gap) {
  using S = ScalarOf<T>;
  if (loop.soft) return T(loop.rate) * gap;
  const T speed = clamp(T(loop.rate) * gap, T(S(-fastest_closing)), T(S(fastest_closing)));
  return t.solves_midpoint ? select(has_opened(loop, i, gap), speed, T(0)) : speed;
}

/// Lanes in which the speed of a push must not stay. That of a frame that is moved is the speed of the frame.
template <class T>
LOCKSTEP_INLINE typename T::Mask closes_fast(const Tables<ScalarOf<T>>& t, const HeldLoop<ScalarOf<T>>& loop, int i,
                                             T gap) {
  return loop.soft || loop.moves ? T::none() : beyond(closing_speed(t, loop, i, gap), T(ScalarOf<T>(slow_closing)));
}

/// act(loop, its number, its first row of the rounds)
template <class T, class Act>
LOCKSTEP_INLINE void each_loop(const Tables<ScalarOf<T>>& t, Tile<T>& x, Act&& act) {
  const int first = t.rounds.slots.count - t.loops.rows;
  for (int l = 0; l < t.loops.loops.count; ++l) act(t.loops.loops[l], l, x.rounds.row + first + t.loops.loops[l].row);
}

/// Lanes in which some loop asks for something else in the velocity phase.
template <class T>
typename T::Mask loops_with_two_phases(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  auto differ = T::none();
  each_loop(t, x, [&](const auto& loop, int, const ActingRow<T>*) LOCKSTEP_INLINED {
    for (int i = 0; i < loop.rows(); ++i) differ = differ | closes_fast(t, loop, i, x.loops.gap[loop.row + i]);
  });
  return differ;
}

/// Compliance, goal and box of the rows, whose own responses are known.
template <class T>
void open_loop_rows(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Phase phase, Tile<T>& x) {
  using S = ScalarOf<T>;
  const S* const switches = batch.field(Parameter::loop_switch);
  const T zero = T(0), far = T(S(unlimited)), half = T(t.dt * S(0.5));
  each_loop(t, x, [&](const auto& loop, int l, ActingRow<T>* rows) LOCKSTEP_INLINED {
    const auto off = switches ? ~beyond(T::load(switches + l * batch.stride), zero) : T::none();
    const auto open = [&](int first, int count, const T* squares, S limit) LOCKSTEP_INLINED {
      T response = zero, own = zero, all = zero;
      for (int i = first; i < first + count; ++i) response += rows[i].response, own += rows[i].own_response;
      for (int k = loop.column; k < loop.column + loop.columns; ++k)
        all = fma(squares[k],
                  T(1) / x.held.matrix[t.rounds.columns.offset[t.rounds.place[t.loops.columns[k].velocity]]], all);
      const T mean = response * T(S(1) / S(count));
      T cfm = T(loop.cfm);
      if (loop.cfm_per_response > S(0)) cfm = fma(T(loop.cfm_per_response / S(count)), own, cfm);
      for (int i = first; i < first + count; ++i) {
        ActingRow<T>& row = rows[i];
        const T gap = x.loops.gap[loop.row + i];
        const T speed = closing_speed(t, loop, i, gap);
        const T closing = phase == velocity_phase ? select(closes_fast(t, loop, i, gap), zero, speed) : speed;
        const auto idle = off | ~less(T(S(moves_nothing)) * all, row.response);
        row.lo = -far, row.hi = far, row.force = T(limit);
        row.centre = fma(half, x.loops.bias[loop.row + i], closing);
        row.rounding = fma(T(loop.rate), x.loops.frames[l].size, row.rounding);
        row.response = mean;
        row.cfm = select(idle, infinite_compliance<T>(), cfm);
      }
    };
    open(0, loop.translations, x.loops.moved, loop.force);
    if (loop.rotations > 0) open(loop.translations, loop.rotations, x.loops.turned, loop.torque);
  });
}

}  // namespace lockstep::kernels
