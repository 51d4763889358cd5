// From solved velocities to new positions and a new root pose. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/bounds/bounded_rows.h"
#include "kernels/couplings/functions.h"
#include "kernels/dynamics/balls.h"
#include "simd/sincos.h"

namespace lockstep::kernels {

/// v += X impulse, for one group of rows.
template <int N, class T>
LOCKSTEP_INLINE void apply_group(const Rows<ScalarOf<T>>& rows, const RowGroup& group, const T* response, int n,
                                 const T* impulse, T* v) {
  const T* const first = response + group.first * n;
  T own[N];
  for (int i = 0; i < N; ++i) own[i] = impulse[group.first + i];
  for (int r = group.run_first; r < group.run_last; ++r)
    for (int z = rows.group_runs[r].first, last = rows.group_runs[r].last; z < last; ++z) {
      T sum = v[z];
      for (int i = 0; i < N; ++i) sum = fma(first[i * n + z], own[i], sum);
      v[z] = sum;
    }
}

/// v = share free + D^-1 X impulse over the solver's velocities: (M21) without its L^-1.
template <class T>
void apply_impulses(const Tables<ScalarOf<T>>& t, const Tile<T>& x, Phase phase, const T* free, T share,
                    const T* impulse, T* v) {
  const Rows<ScalarOf<T>>& rows = t.rows;
  const int n = t.solver.n;
  const auto each_of = [](const Span<SupportRun> runs, const auto& act) LOCKSTEP_INLINED {
    for (int r = 0; r < runs.count; ++r)
      for (int z = runs[r].first, last = runs[r].last; z < last; ++z) act(z);
  };
  if (rows.count == 0 || rows.all_known) {  // impulses of known rows move no other velocities
    for (int z = 0; z < n; ++z) v[z] = free[z] * share;
  } else {
    each_of(rows.moved, [&](int z) LOCKSTEP_INLINED { v[z] = T(0); });
    for (int g = 0; g < rows.groups.count; ++g) {
      const RowGroup& group = rows.groups[g];
      with_count(group, [&](auto count) LOCKSTEP_INLINED {
        apply_group<count.value>(rows, group, x.rows.response, n, impulse, v);
      });
    }
    each_of(rows.moved, [&](int z) LOCKSTEP_INLINED { v[z] = fma(free[z], share, x.dynamics.inverse[z] * v[z]); });
    each_of(rows.unmoved, [&](int z) LOCKSTEP_INLINED { v[z] = free[z] * share; });
  }
  if (t.bounds.rows.count > 0 && !t.rounds.used()) add_bounds(t, x, phase, v);  // rounds need no responses
}

/// v <- L^-1 v for one or two vectors. Constraint velocities that are known are set, not solved (M79).
template <class T>
void solve_downwards(const Tables<ScalarOf<T>>& t, const Tile<T>& x, T* first, T* second) {
  if (t.articulated.used()) solve_outwards(t, x, first, second);
  const Span<int> known = t.rows.known;
  const auto set_known = [&](int j) LOCKSTEP_INLINED {
    const int r = known.count > 0 ? known[j] : -1;
    if (r < 0) return;
    first[j] = x.rows.speed[r] - x.dynamics.start[j];
    if (second) second[j] = x.rows.velocity_phase_speed[r] - x.dynamics.start[j];
  };
  for (int r = 0; r < t.factored.count; ++r)
    second ? solve_downwards(t.solver, t.factored[r], x.dynamics.reduced, first, second, set_known)
           : solve_downwards(t.solver, t.factored[r], x.dynamics.reduced, first, set_known);
}

/// (M21): changes of the velocities, L^-1 (share y + D^-1 X impulse). Both phases go down the tree together.
template <class T>
void solved_changes(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  apply_impulses(t, x, position_phase, x.dynamics.half_solved_position, T(t.free_share), x.rows.position_impulse,
                 x.dynamics.solution);
  T* const second = x.solves_twice ? x.dynamics.velocity_solution : nullptr;
  if (second)
    apply_impulses(t, x, velocity_phase, x.dynamics.half_solved_velocity, T(1), x.rows.velocity_impulse, second);
  solve_downwards(t, x, x.dynamics.solution, second);
}

/// The velocities themselves. Constraint velocities that are known are copied.
template <class T>
void solved_velocities(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  solved_changes(t, x);
  for (int z = 0; z < t.solver.n; ++z) x.dynamics.solution[z] += x.dynamics.start[z];
  for (int z = 0; x.solves_twice && z < t.solver.n; ++z) x.dynamics.velocity_solution[z] += x.dynamics.start[z];
  for (int z = 0; z < t.rows.known.count; ++z) {
    if (t.rows.known[z] < 0) continue;
    x.dynamics.solution[z] = x.rows.speed[t.rows.known[z]];
    if (x.solves_twice) x.dynamics.velocity_solution[z] = x.rows.velocity_phase_speed[t.rows.known[z]];
  }
}

/// All velocities from the solver's. A follower gets finish(f, its row of S times z).
template <class T, class Finish>
void expand(const Tables<ScalarOf<T>>& t, const Tile<T>& x, const T* z, T* v, Finish&& finish) {
  const Reduction<ScalarOf<T>>& r = t.reduction;
  if (!r.used()) {
    for (int i = 0; i < t.velocities; ++i) v[i] = z[i];
    return;
  }
  for (int i = 0; i < t.solver.n; ++i) v[r.independent[i]] = z[i];
  for (int f = 0; f < r.followers; ++f) v[t.velocity_of(r.follower[f])] = finish(f, followed(t, x, f, z));
}

/// The same in a step. A follower's constraint velocity is added to that, or its correction if `corrected`.
template <class T>
void expand(const Tables<ScalarOf<T>>& t, const Tile<T>& x, const T* z, bool corrected, T* v) {
  const int* const speed = t.reduction.constraint_velocity.data;
  if (t.reduction.has_constraint_velocities())
    expand(t, x, z, v, [&](int f, T following) { return following + z[speed[f]]; });
  else
    expand(t, x, z, v,
           [&](int f, T following) { return corrected ? following + x.couplings.correction[f] : following; });
}

/// The same for changes from x.state.v, in which followers lose their velocity errors.
template <class T>
void expand_changes(const Tables<ScalarOf<T>>& t, const Tile<T>& x, const T* z, T* change) {
  expand(t, x, z, change, [&](int f, T following) { return following - x.couplings.velocity_error[f]; });
}

/// number + change. All parts of the change are summed before this. Added one by one, each would be rounded as the
/// number is, which in single precision costs half of the accuracy.
template <class T>
LOCKSTEP_INLINE T changed_by(T number, T change) {
  return number + change;
}

template <class T>
LOCKSTEP_INLINE T squared_length(const T* quaternion) {
  T sum = quaternion[0] * quaternion[0];
  for (int k = 1; k < 4; ++k) sum = fma(quaternion[k], quaternion[k], sum);
  return sum;
}

/// Normalises a quaternion that is close to a unit one, such as an integrator's sum of changes.
template <class T>
LOCKSTEP_INLINE void make_unit(const T* quaternion, T* unit) {
  const T scale = T(1) / sqrt(squared_length(quaternion));
  for (int k = 0; k < 4; ++k) unit[k] = quaternion[k] * scale;
}

/// x.next is x.state with the change of the step, x.stages.total_change.
template <class T>
void add_total_change(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  each_part<T>(t, [&](T* State<T>::*part, int count) LOCKSTEP_INLINED {
    for (int i = 0; i < count; ++i)
      (x.next.*part)[i] = changed_by((x.state.*part)[i], (x.stages.total_change.*part)[i]);
  });
  for (int r = 0; r < t.roots.count; ++r) make_unit(x.next.pose + 7 * r + 3, x.next.pose + 7 * r + 3);
}

/// The root's pose after it has moved with its twist for the time h: q <- q exp(h w / 2), p <- p + h R v, (M46). Also
/// writes the half turn exp(h w / 2).
template <class T>
void move_root(ScalarOf<T> time, const T* twist, const T* pose, T* half_turn, T* next) {
  using S = ScalarOf<T>;
  const T h = T(time);
  const Mat3<T> rotation = rotation_of_quaternion(pose + 3);
  const Vec3<T> w = {twist[0], twist[1], twist[2]}, v = {twist[3], twist[4], twist[5]};
  const Vec3<T> moved = multiply(rotation, v);
  for (int k = 0; k < 3; ++k) next[k] = fma(h, moved[k], pose[k]);

  // exp of u = h w / 2 is cos |u|, sin |u| / |u| u. At rest the ratio is 1.
  const T half = h * T(S(0.5));
  const T squared = dot(w, w) * half * half;
  const T angle = sqrt(squared);
  T sine, cosine;
  sincos(angle, sine, cosine);
  const auto tiny = less(squared, T(S(1e-12)));
  const T ratio = select(tiny, T(1), sine / select(tiny, T(1), angle)) * half;
  const T a = pose[3], b = pose[4], c = pose[5], d = pose[6];
  const T e = w[0] * ratio, f = w[1] * ratio, g = w[2] * ratio;
  half_turn[0] = cosine, half_turn[1] = e, half_turn[2] = f, half_turn[3] = g;
  const T turned[4] = {fnma(b, e, fnma(c, f, fnma(d, g, a * cosine))), fma(a, e, fma(c, g, fnma(d, f, b * cosine))),
                       fma(a, f, fma(d, e, fnma(b, g, c * cosine))), fma(a, g, fma(b, f, fnma(c, e, d * cosine)))};
  // (M47) One Newton step towards 1 / |q| keeps q unit: rounding changes its length by far less than that corrects.
  const T scale = fnma(T(S(0.5)), squared_length(turned), T(S(1.5)));
  for (int k = 0; k < 4; ++k) next[3 + k] = turned[k] * scale;
}

/// (M48) Rotates the root's new twist from its axes before the move to those after it, by the inverse of the half turn
/// with the parts c and s: a + 2 s x (s x a - c a). So only the small change is rounded.
template <class T>
void turn_root_twist(const T* half_turn, T* twist) {
  const T c = half_turn[0], two = T(ScalarOf<T>(2));
  const Vec3<T> s = {half_turn[1], half_turn[2], half_turn[3]};
  for (T* part = twist; part < twist + 6; part += 3) {
    const Vec3<T> a = {part[0], part[1], part[2]};
    const Vec3<T> turned = fma(cross(s, cross_add(s, a, {-c * a[0], -c * a[1], -c * a[2]})), two, a);
    for (int k = 0; k < 3; ++k) part[k] = turned[k];
  }
}

/// Moves all floating roots with their parts of `v`, from `pose` to `next`. Leaves the half turns in x.half_turn.
template <class T>
LOCKSTEP_INLINE void move_roots(const Tables<ScalarOf<T>>& t, const Tile<T>& x, ScalarOf<T> time, const T* v,
                                const T* pose, T* next) {
  for (int r = 0; r < t.roots.count; ++r)
    move_root(time, v + t.roots[r].velocity, pose + 7 * r, x.half_turn + 4 * r, next + 7 * r);
}

/// Turns the twists of all floating roots in `v` to the axes that their roots have now.
template <class T>
LOCKSTEP_INLINE void turn_root_twists(const Tables<ScalarOf<T>>& t, const Tile<T>& x, T* v) {
  for (int r = 0; r < t.roots.count; ++r) turn_root_twist(x.half_turn + 4 * r, v + t.roots[r].velocity);
}

/// Semi-implicit Euler (M45), with followers by (M76).
template <class T>
void integrate(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  expand(t, x, x.dynamics.solution, true, x.next.v);
  for (int j = 0; j < t.joints; ++j) x.next.q[j] = fma(T(t.dt), x.next.v[t.velocity_of(j)], x.state.q[j]);
  if (t.balls.count > 0) move_balls(t, t.dt, x.next.v, x.state.q, x.next.q);
  place_followers(t, x);
  if (t.functions.used()) place_curved_positions(t, x, x.next.q);
  move_roots(t, x, t.dt, x.next.v, x.state.pose, x.next.pose);
  for (int i = 0; t.record_diagnostics && i < t.velocities; ++i) x.diagnostics.moved_velocity[i] = x.next.v[i];
  if (!x.solves_twice) return;
  expand(t, x, x.dynamics.velocity_solution, false, x.next.v);
}

}  // namespace lockstep::kernels
