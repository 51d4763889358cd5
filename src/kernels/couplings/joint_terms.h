// Damping, springs, drives, armatures and efforts: their forces, and what they add to the matrix.
// SPDX-License-Identifier: Apache-2.0
//
// (M13) to (M15). Terms that are linear in positions and velocities of the joints are implicit. So A = M + diag(a + h
// (d + kd) + h^2 (kp + k)), and they take no iterations.
#pragma once

#include "joint_inertia.h"
#include "turns.h"

namespace lockstep::kernels {

template <class T>
LOCKSTEP_INLINE T smaller(T a, T b) {
  return select(less(b, a), b, a);
}
template <class T>
LOCKSTEP_INLINE T larger(T a, T b) {
  return select(less(a, b), b, a);
}
template <class T>
LOCKSTEP_INLINE T absolute(T a) {
  return larger(a, -a);
}
template <class T>
LOCKSTEP_INLINE T clamp(T a, T lo, T hi) {
  return smaller(larger(a, lo), hi);
}

/// A joint's gains and its servo's targets. The target position is without whole turns, as the joint's angle is.
template <class T>
struct Servo : Gains<T> {
  using Gains<T>::kp, Gains<T>::kd;
  T position, velocity;
  /// The servo's force at the end of the step, where the joint has the speed v (M13).
  LOCKSTEP_INLINE T force(T h, T q, T v) const { return -fma(kp, fma(h, v, q) - position, kd * (v - velocity)); }
};

/// Row of the joint's target or effort at one of the step's times. Inputs that are held over the step have one row for
/// all times.
template <class S>
LOCKSTEP_INLINE std::ptrdiff_t input_row(const Tables<S>& t, int j, int time) {
  return t.dof[j] + (t.input_times > 1 ? time * t.joints : 0);
}

template <class T>
LOCKSTEP_INLINE Servo<T> servo(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x,
                               int j, int time = 0) {
  const std::ptrdiff_t input = input_row(t, j, time) * batch.stride;
  return {gains<T>(t, batch, j), without_whole_turns(t, x, j, T::load(batch.position_target + input)),
          T::load(batch.velocity_target + input)};
}

/// The share of the way from the first to the second of leapfrog's times at which the middle of the step is.
template <class S>
constexpr S middle_of_inputs = S((1 - 2 * alexander_gamma) / (1 - alexander_gamma));

/// (M121), (M122): the servo as a solve over the step sees it. At a leapfrog's midpoint, in the lanes where its mean
/// force acts, this is the servo of the end of the step that has this force: with kappa^2 kp and kappa kd.
template <class T>
LOCKSTEP_INLINE Servo<T> servo_of_solve(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch,
                                        const Tile<T>& x, int j, int time = 0) {
  using S = ScalarOf<T>;
  if (!t.solves_midpoint) return servo<T>(t, batch, x, j, time);
  Servo<T> own = servo<T>(t, batch, x, j), middle = own;
  const auto halved = x.midpoint.halved[j];
  const T half = T(S(0.5)), h = T(t.dt), q = x.state.q[j], v = x.state.v[t.velocity_of(j)];
  if (t.input_times > 1) {
    const Servo<T> second = servo<T>(t, batch, x, j, 1);
    const T share = T(middle_of_inputs<S>);
    middle.position = fma(share, second.position - own.position, own.position);
    middle.velocity = fma(share, second.velocity - own.velocity, own.velocity);
    own = servo<T>(t, batch, x, j, t.input_times - 1);
  } else {
    middle.position = fma(-half * h, own.velocity, own.position);  // what is held is the target of the step's end
  }
  own.position = fma(half * h, own.velocity, own.position);
  own.position = select(halved, fma(h, v, fma(T(S(4)), middle.position, T(S(-3)) * q)), own.position);
  own.velocity = select(halved, fma(T(S(2)), middle.velocity, -v), own.velocity);
  own.kp = select(halved, half * half * own.kp, own.kp);
  own.kd = select(halved, half * own.kd, own.kd);
  return own;
}

/// Servos act for the whole step from where it starts.
template <class T>
LOCKSTEP_INLINE void begin_servos(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  x.servos.duration = T(t.dt), x.servos.from = x.state.q, x.servos.time = 0, x.servos.corrected = true;
}

/// `own` are the rows of the field.
template <class T>
LOCKSTEP_INLINE T effort_limit(const Tables<ScalarOf<T>>& t, const ScalarOf<T>* own, std::ptrdiff_t stride, int j) {
  if (!own || !(t.effort_limit[j] < ScalarOf<T>(unlimited))) return T(t.effort_limit[j]);
  return smaller(T::load(own + t.dof[j] * stride), T(ScalarOf<T>(unlimited)));
}
template <class T>
LOCKSTEP_INLINE T effort_limit(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int j) {
  return effort_limit<T>(t, batch.field(Parameter::effort_limit), batch.stride, j);
}

template <class T>
LOCKSTEP_INLINE T feed_forward(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int j,
                               int time = 0) {
  const auto at = [&](int own) LOCKSTEP_INLINED { return T::load(batch.effort + input_row(t, j, own) * batch.stride); };
  if (!t.solves_midpoint || t.input_times == 1) return at(time);
  const T first = at(0);
  return fma(T(middle_of_inputs<ScalarOf<T>>), at(1) - first, first);
}

/// Turns the bias forces into dt times all forces (M15), with the inputs at one of the step's times. Runs after
/// joint_inertias(), whose result it reads, and before inertia_matrix(), which may overwrite that.
template <class T>
void joint_forces(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x, int time = 0) {
  const T h = T(t.dt), ahead = T(t.ahead);
  const Field<T> damping = field<T>(batch, Parameter::damping, t.damping.data);

  // Roots have nothing but bias forces.
  for (int r = 0; r < t.roots.count; ++r)
    for (int i = t.roots[r].velocity, last = i + 6; i < last; ++i) x.dynamics.rhs[i] = -(h * x.dynamics.bias[i]);

  // Joint by joint: effort and damping.
  const int *limited = t.limited_efforts.data, *const end = limited + t.limited_efforts.count;
  const int *searched = t.row_servos.data, *const searched_end = searched + t.row_servos.count;
  for (int j = 0; j < t.joints; ++j) {
    const T d = damping.at(j, t.dof[j]);
    T effort = feed_forward<T>(t, batch, j, time);
    if (searched != searched_end && *searched == j) effort = T(0), ++searched;  // it is in the servo's row
    if (limited != end && *limited == j) {                                      // (M63) without a servo
      const T most = effort_limit<T>(t, batch, j);
      effort = clamp(effort, -most, most);
      ++limited;
    }
    x.dynamics.rhs[t.velocity_of(j)] =
        h * (fnma(d, x.state.v[t.velocity_of(j)], effort) - x.dynamics.bias[t.velocity_of(j)]);
  }

  // Linear servos and springs, at the position that the joint reaches (M15).
  for (int i = 0; i < t.servos.count; ++i) {
    const int j = t.servos[i];
    const Servo<T> own = servo_of_solve<T>(t, batch, x, j, time);
    const T v = x.state.v[t.velocity_of(j)];
    const T reached = fma(ahead, v, x.state.q[j]) - own.position;  // kp acts on the position that the joint reaches
    x.dynamics.rhs[t.velocity_of(j)] =
        fnma(h * own.kp, reached, fnma(h * own.kd, v - own.velocity, x.dynamics.rhs[t.velocity_of(j)]));
  }
  for (int i = 0; i < t.springs.count; ++i) {
    const int j = t.springs[i], z = t.velocity_of(j);
    const T until = t.solves_midpoint ? select(x.midpoint.halved[j], T(0), ahead) : ahead;  // (M122)
    const T stretched = fma(until, x.state.v[z], x.state.q[j]) - without_whole_turns(t, x, j, T(t.rest[j]));
    x.dynamics.rhs[z] = fnma(h * stiffness<T>(t, batch, j), stretched, x.dynamics.rhs[z]);
  }

  if (t.reduction.removes_by_force)
    for (int f = 0; f < t.reduction.followers; ++f)
      remove_velocity_error(t, x, f, x.dynamics.joint_inertia[t.reduction.follower[f]]);
}

}  // namespace lockstep::kernels
