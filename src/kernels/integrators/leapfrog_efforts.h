// Efforts of drives in a leapfrog, for plans that record them. SPDX-License-Identifier: Apache-2.0
//
// (M147), (M148). The mean over the step, by what made the lane's step: the stages, a search in the stages, or a solve
// at the midpoint.
#pragma once

#include "kernels/couplings/drive_efforts.h"
#include "stage.h"

namespace lockstep::kernels {

/// Mean efforts of the leapfrog that has just been made, in x.records.solved_effort. Overwrites x.state.
template <class T>
void leapfrog_efforts(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x, int time) {
  using S = ScalarOf<T>;
  using A = Alexander<S>;
  const int n = t.velocities;
  T* const mean = x.records.solved_effort;

  // The stages. Each ends with the velocities that its momentum makes.
  for (int j = 0; j < t.joints; ++j) mean[j] = T(0);
  for (int i = 0; i < leapfrog_stages; ++i) {
    for (int j = 0; j < t.joints; ++j) x.state.q[j] = x.stages.begin.q[j];
    for (int k = 0; k < n; ++k) x.state.v[k] = x.stages.midpoint.v[k] + x.stages.change[i * n + k];
    for (int earlier = 0; earlier < i; ++earlier) {
      const T duration = T(t.step * A::before[i][earlier]), share = T(A::before[i][earlier] / A::gamma);
      for (int j = 0; j < t.joints; ++j)
        x.state.q[j] = fma(duration, x.stages.velocity[earlier * n + t.velocity_of(j)], x.state.q[j]);
      for (int k = 0; k < n; ++k) x.state.v[k] = fma(share, x.stages.change[earlier * n + k], x.state.v[k]);
    }
    if (t.balls.count > 0) turn_along_ways(t, x.stages.begin.q, x.state.q);
    each_drive_effort(t, batch, x, time + i, x.state.v,
                      [&](int j, T effort) LOCKSTEP_INLINED { mean[j] = fma(T(A::weight[i]), effort, mean[j]); });
  }

  // Servos that the search has held to their limit act over the whole step (M86).
  constexpr int last = leapfrog_stages - 1;
  for (int i = 0; t.rounds.in_stages && i < t.limited_servos.count; ++i) {
    const int j = t.limited_servos[i];
    const T most = effort_limit<T>(t, batch, j);
    const T effort = servo<T>(t, batch, x, j, time + last)
                         .force(T(t.step), x.stages.begin.q[j], x.stages.velocity[last * n + t.velocity_of(j)]) +
                     feed_forward<T>(t, batch, j, time + last);
    mean[j] = select(x.records.searched[i], clamp(effort, -most, most), mean[j]);
  }

  // Lanes that were solved at the midpoint (M122).
  if (!t.rounds.at_midpoint) return;
  for (int j = 0; j < t.joints; ++j) x.state.q[j] = x.stages.midpoint.q[j];
  for (int k = 0; k < n; ++k) x.state.v[k] = x.stages.midpoint.v[k];
  each_drive_effort(*t.midpoint, batch, x, time, x.next.v,
                    [&](int j, T effort) LOCKSTEP_INLINED { mean[j] = select(x.midpoint.acts, effort, mean[j]); });
}

/// Adds `share` of these efforts to those of the whole step, in these lanes.
template <class T>
void add_efforts(const Tables<ScalarOf<T>>& t, typename T::Mask lanes, ScalarOf<T> share, Tile<T>& x) {
  for (int j = 0; j < t.joints; ++j)
    x.records.effort[j] =
        select(lanes, fma(T(share), x.records.solved_effort[j], x.records.effort[j]), x.records.effort[j]);
}

}  // namespace lockstep::kernels
