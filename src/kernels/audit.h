// The audit of energy: finds motion that gains energy from nowhere. SPDX-License-Identifier: Apache-2.0
//
// (M93), (M94). It serves every integrator and method. Only tiles in which a joint turns far in the step pay for it.
#pragma once

#include "kernels/bounds/intervals.h"
#include "kernels/couplings/coupling_error.h"
#include "kernels/dynamics/energies.h"
#include "kernels/tile/control.h"

namespace lockstep::kernels {

/// The most work that the actuators and springs of joint j can have done in the step (M93).
template <class T>
T most_work(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x, int j) {
  const int k = t.velocity_of(j);
  const T zero = T(0), limit = effort_limit<T>(t, batch, j);
  T moved = x.next.q[j] - x.state.q[j];
  if (t.body[t.joint_body[j]].kind >= ball_joint) moved = T(t.step * ScalarOf<T>(0.5)) * (x.state.v[k] + x.next.v[k]);
  T best = zero;
  for (int time = 0; time < t.input_times; ++time) {
    const Servo<T> own = servo<T>(t, batch, x, j, time);
    const T effort = feed_forward<T>(t, batch, j, time);
    const T first = own.force(zero, x.state.q[j], x.state.v[k]) + effort,
            last = own.force(zero, x.next.q[j], x.next.v[k]) + effort;
    best = larger(best, larger(clamp(first, -limit, limit) * moved, clamp(last, -limit, limit) * moved));
  }
  const T rest = without_whole_turns(t, x, j, T(t.rest[j])),
          middle = T(ScalarOf<T>(0.5)) * (x.state.q[j] + x.next.q[j]);
  return fnma(stiffness<T>(t, batch, j) * moved, middle - rest, best);
}

/// Kinetic and potential energy of a state.
template <class T>
void energies_of(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const State<T>& state,
                 Tile<T>& x, T& kinetic, T& potential) {
  const State<T> own = x.state;
  x.state = state;
  motions(t, x, x.audit.motion);
  kinetic = kinetic_energy(t, batch, x, x.audit.motion);
  potential = potential_energy(t, batch, x, x.audit.motion);
  x.state = own;
}

/// The largest error of a coupling, and distance of a joint beyond its range.
template <class T>
T largest_error(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x, const T* q) {
  T largest = T(0);
  const bool some_curved = t.functions.used();  // these have no errors
  for (int c = 0; c < t.couplings; ++c)
    if (!some_curved || !t.functions.curved[c]) largest = larger(largest, absolute(coupling_error(t, x, c, q)));
  for (int i = 0; i < t.bounds.watched.count; ++i) {
    const int j = t.bounds.watched[i].joint;
    if (!t.bounds.watched[i].ranged) continue;
    const Interval<T> range = position_limits<T>(t, batch, j);
    largest = larger(largest, larger(range.lo - q[j], q[j] - range.hi));
  }
  for (int b = 0; b < t.balls.count; ++b) {
    if (t.balls[b].row < 0) continue;
    const Vec3<T> turn = at_ball(t.balls[b], q);
    largest = larger(largest, sqrt(dot(turn, turn)) - position_limits<T>(t, batch, t.balls[b].joint).hi);
  }
  return largest;
}

/// Lanes in which errors of positions are corrected, which moves masses in gravity.
template <class T>
typename T::Mask corrects(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x) {
  const T before = largest_error(t, batch, x, x.state.q), after = largest_error(t, batch, x, x.next.q);
  return less(T::by_precision(1e-4, 1e-6), before) & less(after, before);
}

/// (M94): adds up what the step has gained from nowhere, in lanes of x.audit.fast, and sets x.too_fast where it is too
/// much.
template <class T>
void audit(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  using S = ScalarOf<T>;
  AuditState<T>& state = *x.audit.state;
  when(x, ~state.known, [&] { energies_of(t, batch, x.state, x, state.kinetic, state.potential); });
  T kinetic, potential;
  energies_of(t, batch, x.next, x, kinetic, potential);
  T gained = (kinetic - state.kinetic) + (potential - state.potential);
  for (int j = 0; j < t.joints; ++j) gained = gained - most_work(t, batch, x, j);
  if (t.contacts.used()) gained = gained - x.contacts.work;  // (M126)
  const T rounding = farther(farther(farther(state.kinetic, kinetic), state.potential), potential) * T::rounding();
  gained = fnma(T(S(4)), absolute(rounding), gained);
  const auto lanes = x.audit.fast & ~corrects(t, batch, x);
  const T most = larger(state.most, larger(state.kinetic, kinetic));
  const T total = larger(state.gained + gained, T(S(-0.25)) * most);
  state = {select(lanes, total, state.gained), select(lanes, most, state.most), kinetic, potential, ~T::none()};
  x.too_fast = x.too_fast | (less(T(t.most_gain) * most, total) & lanes);
}

/// Audits the step in lanes where a velocity is large.
template <class T>
LOCKSTEP_INLINE void audit_if(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  x.audit.fast =
      beyond(farthest(x.next.v, t.velocities, farthest(x.state.v, t.velocities, T(0))), T(t.fast_above)) & ~x.frozen;
  either_way(
      x, x.audit.fast, [&] { audit(t, batch, x); }, [&] { x.audit.state->known = T::none(); });
}

}  // namespace lockstep::kernels
