// Leapfrog with an implicit linear part, and its extrapolation. SPDX-License-Identifier: Apache-2.0
//
// (M66) to (M71). One mass matrix and two bias forces at the midpoint; damping, drives and soft couplings by three
// stages of Alexander's (1977) diagonally implicit method, which share one factorisation.
#pragma once

#include "bias_forces.h"
#include "begin.h"
#include "coupling_error.h"
#include "joint_terms.h"
#include "kinematics.h"
#include "solve.h"

namespace lockstep::kernels {

/// (M69)
template <class S>
struct Alexander {
  static constexpr double g = alexander_gamma;
  static constexpr S gamma = S(g);
  static constexpr S weight[leapfrog_stages] = {S(-(6 * g * g - 16 * g + 1) / 4), S((6 * g * g - 20 * g + 5) / 4), S(g)};
  /// a_ik, k < i
  static constexpr S before[leapfrog_stages][2] = {{S(0), S(0)}, {S((1 - g) / 2), S(0)}, {weight[0], weight[1]}};
};

/// One stage of (M68), from x.begin_q and x.midpoint_v and the stages before it.
template <class T>
void stage(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x, int i, int time) {
  using S = ScalarOf<T>;
  using A = Alexander<S>;
  const int root = t.velocities - t.joints, n = t.velocities;
  for (int j = 0; j < t.joints; ++j) x.q[j] = x.begin_q[j];
  for (int k = 0; k < n; ++k) x.v[k] = x.midpoint_v[k];
  for (int earlier = 0; earlier < i; ++earlier) {
    const T way = T(t.step * A::before[i][earlier]), share = T(A::before[i][earlier] / A::gamma);
    for (int j = 0; j < t.joints; ++j) x.q[j] = fma(way, x.stage_v[earlier * n + root + j], x.q[j]);
    for (int k = 0; k < n; ++k) x.v[k] = fma(share, x.stage_change[earlier * n + k], x.v[k]);
  }
  const bool last = i == leapfrog_stages - 1;
  x.corrects = last;
  x.solves_twice = last && t.solve_twice;
  if (t.rows.count > 0 || (last && t.couplings > 0)) coupling_errors(t, x);
  if (t.reduction.followers > 0) follow(t, x);
  joint_forces(t, lanes, x, time + i);
  solve(t, x);
  T *change = x.stage_change + i * n, *velocity = x.stage_v + i * n;
  expand_changes(t, x, x.solution, change);
  for (int k = 0; k < n; ++k) velocity[k] = changed_by(x.v[k], change[k]);
  for (int f = 0; last && f < t.reduction.followers; ++f) velocity[root + t.reduction.follower[f]] += x.correction[f];
  if (x.solves_twice) expand_changes(t, x, x.closing_solution, change);
}

/// From x.begin_q, _v, _pose to x.next_q, _v, _root_pose; x.mean_v is what moved the positions, x.gained_v what was added
/// to the velocities, along the midpoint's axes. Leaves no other state.
template <class T>
void leapfrog(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x, int time) {
  using S = ScalarOf<T>;
  using A = Alexander<S>;
  const int root = t.velocities - t.joints, n = t.velocities;
  const S half = t.step * S(0.5);
  for (int j = 0; j < t.joints; ++j) x.q[j] = x.midpoint_q[j] = fma(T(half), x.begin_v[root + j], x.begin_q[j]);
  for (int k = 0; k < n; ++k) x.v[k] = x.begin_v[k];
  if (t.floating) {
    move_root(half, x.begin_v, x.begin_pose, x.half_turn, x.root_pose);
    turn_root_twist(x.half_turn, x.v);
  }
  for (int k = 0; k < n; ++k) x.midpoint_v[k] = x.v[k];

  kinematics(t, x);
  joint_inertias(t, lanes, x);
  inertia_matrix(t, x);
  factorise(t, lanes, x);

  bias_forces(t, lanes, x);
  stage(t, lanes, x, 0, time);
  for (int j = 0; j < t.joints; ++j) x.q[j] = x.midpoint_q[j];  // (M67)
  for (int k = 0; k < n; ++k) x.v[k] = fma(T(S(0.5) / A::gamma), x.stage_change[k], x.midpoint_v[k]);
  bias_forces(t, lanes, x);
  for (int i = 0; i < leapfrog_stages; ++i) stage(t, lanes, x, i, time);

  for (int k = 0; k < n; ++k) {
    T mean = T(0), change = T(0);
    for (int i = 0; i < leapfrog_stages; ++i) {
      mean = fma(T(A::weight[i]), x.stage_v[i * n + k], mean);
      change = fma(T(A::weight[i] / A::gamma), x.stage_change[i * n + k], change);
    }
    x.mean_v[k] = mean;
    x.gained_v[k] = change;
    x.next_v[k] = changed_by(x.midpoint_v[k], change);
  }
  for (int j = 0; j < t.joints; ++j) x.next_q[j] = fma(T(t.step), x.mean_v[root + j], x.begin_q[j]);
  if (!t.floating) return;
  for (int k = 0; k < root; ++k) x.v[k] = fma(T(S(2)), x.mean_v[k], -x.midpoint_v[k]);
  move_root(half, x.v, x.root_pose, x.half_turn, x.next_root_pose);
  turn_root_twist(x.half_turn, x.next_v);
}

template <class T>
void leapfrog_step(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  keep_begin(t, x);
  leapfrog(t, lanes, x, 0);
  return_to_begin(t, x);
}

/// Adds `share` of the change that the last leapfrog made to x.change_q, _v, _pose. A root's axes have turned meanwhile.
template <class T>
void add_change(const Tables<ScalarOf<T>>& t, Tile<T>& x, ScalarOf<T> step, ScalarOf<T> share) {
  const int root = t.velocities - t.joints;
  for (int j = 0; j < t.joints; ++j) x.change_q[j] = fma(T(share * step), x.mean_v[root + j], x.change_q[j]);
  for (int k = 0; k < t.velocities; ++k)
    x.change_v[k] = fma(T(share), k < root ? x.next_v[k] - x.begin_v[k] : x.gained_v[k], x.change_v[k]);
  for (int k = 0; t.floating && k < 7; ++k)
    x.change_pose[k] = fma(T(share), x.next_root_pose[k] - x.begin_pose[k], x.change_pose[k]);
}

/// (M71). t.half holds the tables of half the step.
template <class T>
void extrapolated_step(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  using S = ScalarOf<T>;
  const S minus_third = S(-1.0 / 3), four_thirds = S(4.0 / 3);
  keep_begin(t, x);
  for (int j = 0; j < t.joints; ++j) x.first_q[j] = x.q[j], x.change_q[j] = T(0);
  for (int k = 0; k < t.velocities; ++k) x.first_v[k] = x.v[k], x.change_v[k] = T(0);
  for (int k = 0; t.floating && k < 7; ++k) x.first_pose[k] = x.root_pose[k], x.change_pose[k] = T(0);

  leapfrog(t, lanes, x, 0);
  add_change(t, x, t.step, minus_third);
  auto singular = x.singular;
  for (int half = 1; half <= 2; ++half) {
    leapfrog(*t.half, lanes, x, half * leapfrog_stages);
    add_change(t, x, t.half->step, four_thirds);
    singular = singular | x.singular;
    for (int j = 0; j < t.joints; ++j) x.begin_q[j] = x.next_q[j];
    for (int k = 0; k < t.velocities; ++k) x.begin_v[k] = x.next_v[k];
    for (int k = 0; t.floating && k < 7; ++k) x.begin_pose[k] = x.next_root_pose[k];
  }
  x.singular = singular;

  for (int j = 0; j < t.joints; ++j) x.begin_q[j] = x.first_q[j], x.next_q[j] = changed_by(x.first_q[j], x.change_q[j]);
  for (int k = 0; k < t.velocities; ++k) x.begin_v[k] = x.first_v[k], x.next_v[k] = changed_by(x.first_v[k], x.change_v[k]);
  for (int k = 0; t.floating && k < 7; ++k)
    x.begin_pose[k] = x.first_pose[k], x.next_root_pose[k] = changed_by(x.first_pose[k], x.change_pose[k]);
  if (t.floating) make_unit(x.next_root_pose + 3, x.next_root_pose + 3);
  return_to_begin(t, x);
}

}  // namespace lockstep::kernels
