// Intervals and boxes of the bounded rows in this step: (M56) to (M59). SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/couplings/joint_terms.h"
#include "kernels/couplings/row_terms.h"
#include "kernels/dynamics/balls.h"

namespace lockstep::kernels {

enum Phase { position_phase = 0, velocity_phase = 1 };

template <class T>
struct Interval {
  T lo, hi;
};

/// A distance from an end of a range, 0 if it is the rounding of a position that has been put there.
template <class T>
LOCKSTEP_INLINE T up_to_rounding(T distance, T end) {
  return select(beyond(distance, farther(T(0), end) * (T(ScalarOf<T>(4)) * T::rounding())), distance, T(0));
}

/// The range of joint j, of this environment.
template <class T>
LOCKSTEP_INLINE Interval<T> position_limits(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch,
                                            int j) {
  const ScalarOf<T>* own = batch.field(Parameter::position_limits);
  if (!own) return {T(t.bounds.lower[j]), T(t.bounds.upper[j])};
  own += 2 * t.dof[j] * batch.stride;
  const T far = T(ScalarOf<T>(unlimited));
  return {larger(T::load(own), -far), smaller(T::load(own + batch.stride), far)};
}

template <class T>
LOCKSTEP_INLINE T speed_limit(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int j) {
  return field<T>(batch, Parameter::velocity_limit, t.bounds.speed_limit.data).at(j, t.dof[j]);
}

/// The most that dry friction takes in a step.
template <class T>
LOCKSTEP_INLINE T friction_impulse(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int j) {
  const ScalarOf<T>* const own = batch.field(Parameter::friction);
  return own ? T(t.step) * T::load(own + t.dof[j] * batch.stride) : T(t.bounds.friction[j]);
}

/// The time in the step at which a row is evaluated: its start, or a sub-step of tgs.
template <class T>
struct StepTime {
  bool in_velocity_phase;   ///< no position is corrected there
  ScalarOf<T> inverse;      ///< 1 / the step, or 1 / the sub-step
  ScalarOf<T> elapsed = 0;  ///< since the start of the step
  bool sub_step = false;
  const T* start = nullptr;  ///< [joints] positions at the start of the step, if x.state has those of its midpoint
};

/// (M56), (M57): the interval that a range gives the velocity v of what is at q now and was at `began` at the start of
/// the step, with the bounds of joint j.
template <class T>
LOCKSTEP_INLINE Interval<T> range_interval(const Bounds<ScalarOf<T>>& b, int j, const Interval<T>& range, T q, T began,
                                           T v, const StepTime<T>& at) {
  const T zero = T(0), below = up_to_rounding(range.lo - q, range.lo), above = up_to_rounding(range.hi - q, range.hi);
  const T inside = T(at.inverse),
          beyond = at.in_velocity_phase ? zero : T(at.sub_step ? b.sub_step_rate[j] : b.limit_rate[j]);
  T back[2] = {beyond, beyond};
  if (at.start && !at.in_velocity_phase) {  // what has left its range on the way to the midpoint comes back at once
    back[0] = select(less(began, range.lo), beyond, inside), back[1] = select(less(range.hi, began), beyond, inside);
  }
  Interval<T> i{below * select(less(zero, below), back[0], inside), above * select(less(above, zero), back[1], inside)};
  if (at.in_velocity_phase && b.restitution[j] > 0) {
    const T back = -(T(b.restitution[j]) * v);
    const auto hits_lower = less(v, i.lo), hits_upper = less(i.hi, v);
    i.lo = select(hits_lower, larger(i.lo, back), i.lo);
    i.hi = select(hits_upper, smaller(i.hi, back), i.hi);
  }
  return i;
}

/// (M180): no correction of a spatial tendon's position, of joint j, passes the reach of its row, in 1 / `inverse`.
template <class T>
LOCKSTEP_INLINE Interval<T> within_reach(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int j, ScalarOf<T> inverse,
                                         const Interval<T>& corrections) {
  for (int i = 0; i < t.spatial.tendons.count; ++i) {
    if (t.spatial.tendons[i].joint != j) continue;
    const T most = T(inverse) * x.spatial.reach[i];
    return {smaller(corrections.lo, most), larger(corrections.hi, -most)};
  }
  return corrections;
}

/// Of joint j. `moved` is its displacement since the start of the step.
template <class T>
LOCKSTEP_INLINE Interval<T> range_interval(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch,
                                           const Tile<T>& x, int j, const StepTime<T>& at, T moved) {
  const Interval<T> i = range_interval(t.bounds, j, position_limits<T>(t, batch, j), x.state.q[j] + moved,
                                       at.start ? at.start[j] : T(0), x.state.v[t.velocity_of(j)], at);
  return at.in_velocity_phase ? i : within_reach(t, x, j, at.inverse, i);
}

/// The same, clamped to the velocity limit.
template <class T>
LOCKSTEP_INLINE Interval<T> joint_interval(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch,
                                           const Tile<T>& x, int j, const StepTime<T>& at, T moved) {
  const Bounds<ScalarOf<T>>& b = t.bounds;
  const T far = T(ScalarOf<T>(unlimited));
  const Interval<T> i = b.has[j] & has_range ? range_interval(t, batch, x, j, at, moved) : Interval<T>{-far, far};
  if (!(b.has[j] & has_speed_limit)) return i;
  const T most = speed_limit<T>(t, batch, j);
  return {clamp(i.lo, -most, most), clamp(i.hi, -most, most)};
}

/// k of (M58): the velocity that a kinematic drive prescribes.
template <class T>
LOCKSTEP_INLINE T kinematic_velocity(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch,
                                     const Tile<T>& x, int j, T q) {
  const std::ptrdiff_t row = t.dof[j] * batch.stride;
  const T target = without_whole_turns(t, x, j, T::load(batch.position_target + row)),
          speed = T::load(batch.velocity_target + row);
  const ScalarOf<T> left = t.solves_midpoint ? t.step * ScalarOf<T>(0.5) : t.step;  // of the step, from q on
  const T prescribed = fma(T(t.bounds.drive_rate[j]), fnma(T(left), speed, target - q), speed);
  if (!t.spatial.used()) return prescribed;
  const T far = T(ScalarOf<T>(unlimited));
  const Interval<T> reach = within_reach(t, x, j, ScalarOf<T>(1) / t.step, {far, -far});
  return clamp(prescribed, speed + reach.hi, speed + reach.lo);
}

/// (M59): the hard bounds of all joints that move with the row's velocity.
template <class T>
void joint_row(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int r, Phase phase,
               const StepTime<T>& at, T moved, Tile<T>& x) {
  using S = ScalarOf<T>;
  const Bounds<S>& b = t.bounds;
  const T far = T(S(unlimited));
  T lo = -far, hi = far, force = T(0), prescribed = T(0), corrected_by = T(0);
  int drives = 0;

  // What each member asks, in terms of the row's velocity.
  for (int m = b.member_start[r]; m < b.member_start[r + 1]; ++m) {
    const Member member = b.member[m];
    const int has = b.has[member.joint];
    const T share = x.bounds.member_share[m], inverse = x.bounds.member_inverse[m];
    const bool corrected = phase == position_phase && member.follower >= 0;
    const T correction = corrected ? x.couplings.correction[member.follower] : T(0);
    if (has & (has_range | has_speed_limit)) {
      const Interval<T> own = joint_interval(t, batch, x, member.joint, at, moved);
      const T one = (own.lo - correction) * inverse, other = (own.hi - correction) * inverse;
      lo = larger(lo, smaller(one, other));
      hi = smaller(hi, larger(one, other));
    }
    if (has & has_friction) force = fma(larger(share, -share), friction_impulse<T>(t, batch, member.joint), force);
    if ((has & has_kinematic_drive) && b.kinematic[r]) {
      prescribed =
          fma(kinematic_velocity(t, batch, x, member.joint, x.state.q[member.joint]) - correction, inverse, prescribed);
      corrected_by = fma(correction, inverse, corrected_by);
      ++drives;
    }
  }

  // Where no velocity meets all, the two ends share the violation.
  const T middle = T(S(0.5)) * (lo + hi);
  const auto empty = less(hi, lo);
  lo = select(empty, middle, lo);
  hi = select(empty, middle, hi);

  // Drives: their mean within the limits, and what (M60) needs of them.
  if (drives > 0) {
    const T each = T(S(1) / S(drives));
    if (b.may_depend && phase == position_phase) x.bounds.correction[r] = corrected_by * each;
    if (b.may_depend && phase == velocity_phase) x.bounds.slowest[r] = clamp(T(0), lo, hi);
    lo = hi = clamp(prescribed * each, lo, hi);
  }
  const int i = phase * b.rows.count + r;
  x.bounds.lo[i] = lo;
  x.bounds.hi[i] = hi;
  x.bounds.force[r] = force;
}

/// J w of (M42): the speed that followers' corrections add to a coupling's row.
template <class T>
LOCKSTEP_INLINE T correction_speed(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int coupling) {
  T sum = T(0);
  if (!t.reduction.eliminates()) return sum;
  for (int k = t.term_start[coupling]; k < t.term_start[coupling + 1]; ++k) {
    const int f = t.reduction.follower_of[t.term_joint[k]];
    if (f >= 0) sum = fma(x.couplings.coefficient[k], x.couplings.correction[f], sum);
  }
  return sum;
}

/// (M58) as a row of its own, which may give way to the joint's other bounds.
template <class T>
void drive_row(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int r, Phase phase,
               const StepTime<T>& at, T moved, Tile<T>& x) {
  const Member member = t.bounds.member[t.bounds.member_start[r]];
  const int i = phase * t.bounds.rows.count + r, j = member.joint;
  const T correction = phase == position_phase && member.follower >= 0 ? x.couplings.correction[member.follower] : T(0);
  const Interval<T> own = joint_interval(t, batch, x, j, at, moved);
  x.bounds.lo[i] = x.bounds.hi[i] =
      clamp(kinematic_velocity(t, batch, x, j, x.state.q[j]), own.lo, own.hi) - correction;
  x.bounds.centre[i] = x.bounds.force[r] = T(0);
}

/// (M63) as a box: the servo and its effort, at most the limit, as a spring and a damper that reach the end of the
/// step. A servo without gains is a force, which a compliance this large makes of it to rounding.
template <class T>
void servo_row(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int r, Phase phase,
               const StepTime<T>& at, T moved, Tile<T>& x) {
  using S = ScalarOf<T>;
  const Member member = t.bounds.member[t.bounds.member_start[r]];
  const int i = phase * t.bounds.rows.count + r, j = member.joint;
  const T far = T(S(unlimited)), h = at.sub_step ? T(S(1) / at.inverse) : T(t.dt);
  const Servo<T> own = servo_of_solve<T>(t, batch, x, j);
  const T gain = larger(h * fma(h, own.kp, own.kd), T::by_precision(1e-16, 1e-20));
  const T correction = phase == position_phase && member.follower >= 0 ? x.couplings.correction[member.follower] : T(0);
  // The force at the speed u is that at rest less gain u / h.
  const T at_rest = own.force(h, x.state.q[j] + moved, correction) + feed_forward<T>(t, batch, j);
  x.bounds.lo[i] = -far, x.bounds.hi[i] = far;
  x.bounds.cfm[r] = T(1) / gain;
  x.bounds.centre[i] = -(h * at_rest) * x.bounds.cfm[r];
  x.bounds.force[r] = T(t.dt) * effort_limit<T>(t, batch, j);
}

/// A soft limit, a soft kinematic drive, or a coupling with a force limit.
template <class T>
void soft_row(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int r, Phase phase,
              const StepTime<T>& at, T moved, Tile<T>& x) {
  using S = ScalarOf<T>;
  const Bounds<S>& b = t.bounds;
  const int i = phase * b.rows.count + r;
  const T zero = T(0), far = T(S(unlimited)), rate = T(at.sub_step ? b.rows.softness[r].rate : b.soft_rate[r]);

  // No interval and no bias yet.
  x.bounds.lo[i] = -far;
  x.bounds.hi[i] = far;
  x.bounds.centre[i] = zero;

  // A coupling: a box with its bias, which hard ones drop in the velocity phase (M33).
  if (b.kind[r] == BoundKind::coupling) {
    const int c = b.rows.coupling[r];
    const bool drops = at.in_velocity_phase && b.rows.softness[r].cfm == 0 && b.rows.softness[r].cfm_per_response == 0;
    const T bias = drops ? zero : rate * (x.couplings.error[c] + moved);
    x.bounds.centre[i] = phase == position_phase ? bias + correction_speed(t, x, c) : bias;
    x.bounds.force[r] = T(t.dt) * T(b.force_limit[c]);
    if (t.declares(Parameter::coupling_switch)) x.bounds.force[r] *= switched_on<T>(batch, c);
    return;
  }

  // A soft limit (M56), or a soft drive: an unlimited box (M58).
  const Member member = b.member[b.member_start[r]];
  const int j = member.joint;
  const T correction = phase == position_phase && member.follower >= 0 ? x.couplings.correction[member.follower] : zero;
  const T q = x.state.q[j] + moved;
  if (b.kind[r] == BoundKind::soft_limit) {
    const Interval<T> range = position_limits<T>(t, batch, j);
    const T below = range.lo - q, above = range.hi - q, inside = T(at.inverse);
    x.bounds.lo[i] = fnma(T(1), correction, below * select(less(zero, below), rate, inside));
    x.bounds.hi[i] = fnma(T(1), correction, above * select(less(above, zero), rate, inside));
    x.bounds.force[r] = zero;
  } else {
    const std::ptrdiff_t row = t.dof[j] * batch.stride;
    const T target = without_whole_turns(t, x, j, T::load(batch.position_target + row)),
            speed = T::load(batch.velocity_target + row);
    const ScalarOf<T> left = t.solves_midpoint ? t.dt * ScalarOf<T>(0.5) : t.dt - at.elapsed;
    x.bounds.centre[i] = fma(rate, fma(T(left), speed, q - target), correction - speed);
    x.bounds.force[r] = far;
  }
}

/// (M177): the range of a ball, along its rotation vector at the start of the step. Sets the row's values.
template <class T>
void ball_range_row(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int r, Phase phase,
                    const StepTime<T>& at, T moved, Tile<T>& x) {
  using S = ScalarOf<T>;
  const Bounds<S>& b = t.bounds;
  int n = 0;
  while (t.balls[n].row != r) ++n;
  const BallJoint& ball = t.balls[n];
  const int i = phase * b.rows.count + r, j = ball.joint;
  const T zero = T(0), one = T(1), far = T(S(unlimited));
  const auto length = [](const Vec3<T>& vector) LOCKSTEP_INLINED { return sqrt(dot(vector, vector)); };

  // The direction, and the speed along it.
  const Vec3<T> vector = at_ball(ball, x.state.q), velocity = spin_of_ball(ball.velocity, x.state.v);
  const T start = length(vector);
  const auto turned = less(zero, start);
  const T inverse = one / select(turned, start, one);
  const Vec3<T> along = {select(turned, vector[0] * inverse, one), vector[1] * inverse, vector[2] * inverse};
  const T speed = dot(along, velocity);
  for (int k = 0; k < 3; ++k) x.bounds.value[ball.value[k]] = along[k];

  // What the velocity across it adds to the angle on the way to the end of the step.
  const T left = T(t.solves_midpoint ? t.step * S(0.5) : t.step);
  const Vec3<T> across = scaled(fma(along, -speed, velocity), left);
  const T angle = length(vector_of(product(turn_by(vector), turn_by(across)))) + moved;

  // An angle never passes pi, so an end there or beyond holds nothing.
  const T end = position_limits<T>(t, batch, j).hi;
  const Interval<T> range{-far, select(less(end, T(S(half_turn))), end, far)};
  x.bounds.centre[i] = x.bounds.force[r] = zero;
  x.bounds.lo[i] = -far;
  if (b.rows.softness[r].soft) {
    const T above = range.hi - angle;
    x.bounds.hi[i] =
        above * select(less(above, zero), T(at.sub_step ? b.rows.softness[r].rate : b.soft_rate[r]), T(at.inverse));
  } else {
    const T began = at.start ? length(at_ball(ball, at.start)) : zero;
    x.bounds.hi[i] = range_interval(b, j, range, angle, began, speed, at).hi;
  }
}

/// The interval and box of row r in one phase.
template <class T>
void bounded_row(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int r, Phase phase,
                 const StepTime<T>& at, T moved, Tile<T>& x) {
  if (t.bounds.kind[r] == BoundKind::joint)
    joint_row(t, batch, r, phase, at, moved, x);
  else if (t.bounds.kind[r] == BoundKind::drive)
    drive_row(t, batch, r, phase, at, moved, x);
  else if (t.bounds.kind[r] == BoundKind::servo)
    servo_row(t, batch, r, phase, at, moved, x);
  else if (t.bounds.kind[r] == BoundKind::ball_range)
    ball_range_row(t, batch, r, phase, at, moved, x);
  else
    soft_row(t, batch, r, phase, at, moved, x);
}

}  // namespace lockstep::kernels
