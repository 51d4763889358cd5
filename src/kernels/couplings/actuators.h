// Before a step: what drives apply, if they are late, and what motors can do at their speed.
// SPDX-License-Identifier: Apache-2.0
//
// (M153) to (M155). The rest of the step reads what this writes, in place of the rows that a Batch shows.
#pragma once

#include "joint_terms.h"

namespace lockstep::kernels {

/// (M153): each input goes one place on, and the one that has waited long enough is applied.
template <class T>
void delay_inputs(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch) {
  using S = ScalarOf<T>;
  const S* const delays = batch.field(Parameter::drive_delay);
  S* waiting = batch.waiting_input;
  for (int i = 0; i < t.actuators.delayed.count; ++i) {
    const DelayedDrive& drive = t.actuators.delayed[i];
    const int dof = t.dof[drive.joint];
    const T delay = delays ? T::load(delays + dof * batch.stride) : T(S(drive.most));
    for (int input = 0; input < drive_inputs; ++input) {
      S* const applied = batch.applied_input + (input * t.joints + dof) * batch.stride;
      T newer = T::load(applied), result = newer;
      for (int steps = 1; steps <= drive.most; ++steps, waiting += batch.stride) {
        const T older = T::load(waiting);
        store(waiting, newer);
        result = select(less(delay, T(S(steps))), result, older);
        newer = older;
      }
      store(applied, result);
    }
  }
}

/// (M154)
template <class T>
void lag_inputs(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch) {
  using S = ScalarOf<T>;
  for (int i = 0; i < t.actuators.lagged.count; ++i) {
    const S* const lag = batch.lag + lag_rows * i * batch.stride;
    const T mean = T::load(lag + batch.stride), kept = T::load(lag + 2 * batch.stride);
    for (int input = 0; input < drive_inputs; ++input) {
      S* const applied = batch.applied_input + (input * t.joints + t.dof[t.actuators.lagged[i]]) * batch.stride;
      S* const lagged = batch.lagged_input + (drive_inputs * i + input) * batch.stride;
      const T target = T::load(applied), behind = T::load(lagged) - target;
      store(applied, fma(mean, behind, target));
      store(lagged, fma(kept, behind, target));
    }
  }
}

/// (M155): the way in which the servo pushes at the start of the step decides between driving and braking.
template <class T>
void limit_motors(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x) {
  using S = ScalarOf<T>;
  const auto put = [&](int j, T limit) { store(batch.applied_limit + t.dof[j] * batch.stride, limit); };
  for (int j = 0; j < t.joints; ++j) put(j, effort_limit<T>(t, batch.shown_limit, batch.stride, j));
  const Field<T> curve = field<T>(batch, Parameter::motor_curve, t.actuators.curve.data);
  for (int i = 0; i < t.actuators.motors.count; ++i) {
    const int j = t.actuators.motors[i];
    const T stall = curve.at(2 * i, 2 * t.dof[j]), no_load = curve.at(2 * i + 1, 2 * t.dof[j] + 1);
    const T v = x.state.v[t.velocity_of(j)], zero = T(0);
    const T wanted = servo<T>(t, batch, x, j).force(T(t.step), x.state.q[j], v) + feed_forward<T>(t, batch, j);
    const T along = select(less(wanted, zero), -v, v);
    put(j, clamp(stall * (T(S(1)) - along / no_load), zero, effort_limit<T>(t, batch.shown_limit, batch.stride, j)));
  }
}

template <class T>
void actuate(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x) {
  if (t.actuators.is_late()) {
    for (int input = 0; input < drive_inputs; ++input)
      for (int dof = 0; dof < t.joints; ++dof)
        store(batch.applied_input + (input * t.joints + dof) * batch.stride,
              T::load(batch.shown_input[input] + dof * batch.stride));
    delay_inputs<T>(t, batch);
    lag_inputs<T>(t, batch);
  }
  if (t.actuators.motors.count > 0) limit_motors(t, batch, x);
}

}  // namespace lockstep::kernels
