// Bounds within a leapfrog step. SPDX-License-Identifier: Apache-2.0
//
// Section 19. The step is made without bounds first. Lanes where they act take the prediction and the stages again,
// with bounds on the impulses since the start of the step, and then one solve for the positions. All solves share the
// matrix of the step, in which held velocities are masked.
#pragma once

#include "kernels/bounds/stage_bounds.h"
#include "solve_bounds.h"
#include "stage.h"

namespace lockstep::kernels {

/// Lanes in which a limited servo is beyond its limit in one of the stages first to last - 1 (M86).
template <class T>
typename T::Mask beyond_effort(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x,
                               int i, int first, int last, int time) {
  using A = Alexander<ScalarOf<T>>;
  const int j = t.limited_servos[i], k = t.velocity_of(j), n = t.velocities;
  typename T::Mask found = T::none();
  for (int s = first; s < last; ++s) {
    T q = x.stages.begin.q[j];
    for (int earlier = 0; earlier < s; ++earlier)
      q = fma(T(t.step * A::before[s][earlier]), x.stages.velocity[earlier * n + k], q);
    const T force = servo<T>(t, batch, x, j, time + s).force(T(t.dt), q, x.stages.velocity[s * n + k]) +
                    feed_forward<T>(t, batch, j, time + s);
    const T side = saturated(force, effort_limit<T>(t, batch, j));
    found = found | less(T(0), side) | less(side, T(0));
  }
  return found;
}

/// Lanes in which the stages first to last - 1 exceed a limit of velocity or effort, or after the last stage their mean
/// that of velocity.
template <class T>
typename T::Mask stages_exceed(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x,
                               int first, int last, int time) {
  const Bounds<ScalarOf<T>>& b = t.bounds;
  typename T::Mask found = T::none();
  for (int i = 0; i < b.watched.count; ++i) {
    const Watched& joint = b.watched[i];
    if (!joint.has_way) continue;
    T fastest = last == leapfrog_stages ? x.stages.mean_velocity[t.velocity_of(joint.joint)] : T(0);
    for (int s = first; s < last; ++s)
      fastest = farther(fastest, x.stages.velocity[s * t.velocities + t.velocity_of(joint.joint)]);
    found = found | less(speed_limit<T>(t, batch, joint.joint), absolute(fastest));
  }
  for (int i = 0; i < t.limited_servos.count; ++i) found = found | beyond_effort(t, batch, x, i, first, last, time);
  return found;
}

/// Lanes in which a joint is at an end of its range or beyond, at the positions `q_of(joint)`, or within `slack` of
/// one.
template <class T, class Positions>
typename T::Mask at_end_of_range(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, T slack,
                                 Positions&& q_of) {
  typename T::Mask found = T::none();
  for (int i = 0; i < t.bounds.watched.count; ++i) {
    if (!t.bounds.watched[i].ranged) continue;
    const int j = t.bounds.watched[i].joint;
    const Interval<T> range = position_limits<T>(t, batch, j);
    const T q = q_of(j);
    found = found | ~less(up_to_rounding(range.lo - q, range.lo), -slack) |
            ~less(up_to_rounding(q - range.hi, range.hi), -slack);
  }
  return found;
}

/// Lanes in which bounds act on the prediction: at the start of the step a joint is at an end of its range, or the
/// first stage exceeds a limit.
template <class T>
typename T::Mask bounds_act_on_prediction(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch,
                                          const Tile<T>& x, int time) {
  if (t.bounds.always) return ~T::none();
  const auto begin = [&](int j) LOCKSTEP_INLINED { return x.stages.begin.q[j]; };
  return stages_exceed(t, batch, x, 0, 1, time) | at_end_of_range(t, batch, at_rest<T>(), begin);
}

/// Lanes in which the stages exceed a limit, or the step leaves a range.
template <class T>
typename T::Mask violated_by_stages(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch,
                                    const Tile<T>& x, int time) {
  const auto end = [&](int j) LOCKSTEP_INLINED {
    return fma(T(t.step), x.stages.mean_velocity[t.velocity_of(j)], x.stages.begin.q[j]);
  };
  return stages_exceed(t, batch, x, 0, leapfrog_stages, time) | at_end_of_range(t, batch, T(0), end);
}

template <class T>
typename T::Mask bounds_act_on_stages(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch,
                                      const Tile<T>& x, int time) {
  return t.bounds.always ? ~T::none() : violated_by_stages(t, batch, x, time);
}

/// Takes the servo's gains out of the matrix in these lanes: the search adds what is left of them.
template <class T>
void leave_servo_to_search(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int i,
                           typename T::Mask lanes, Tile<T>& x) {
  const LimitedServo& servo = t.rounds.servos[i];
  const Gains<T> own = gains<T>(t, batch, t.limited_servos[i]);
  const T share = servo.share < 0 ? T(1) : x.couplings.share[servo.share], h = T(t.dt);
  T& diagonal = x.held.matrix[t.rounds.columns.offset[servo.velocity]];
  diagonal -= select(lanes & ~x.servos.bounded[i], share * share * (h * fma(h, own.kp, own.kd)), T(0));
  x.servos.bounded[i] = x.servos.bounded[i] | lanes;
}

/// What a servo that is left to the search adds to the momentum of stage i beside the search: its effort since the
/// start instead of all that the stage has of it.
template <class T>
LOCKSTEP_INLINE T effort_since_start(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch,
                                     const Tile<T>& x, int i, T duration, int time) {
  const LimitedServo& servo = t.rounds.servos[i];
  const int j = t.limited_servos[i];
  const T effort = feed_forward<T>(t, batch, j, time), share = servo.share < 0 ? T(1) : x.couplings.share[servo.share];
  const T linear = kernels::servo<T>(t, batch, x, j, time).force(T(t.dt), x.state.q[j], x.state.v[t.velocity_of(j)]);
  return select(x.servos.bounded[i], share * fnma(T(t.dt), linear + effort, duration * effort), T(0));
}

/// Searches from where the last search of this step has ended. (The subroutine reads the servos' inputs of the time at
/// which it is traced: it is for plans with one time of inputs.)
template <class T>
void go_on_searching(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, typename T::Mask lanes,
                     Tile<T>& x) {
  const auto singular = x.singular;
  x.search.open = lanes, x.search.going_on = x.stage_bounds.searched & lanes;
  subroutine(t, x, "search", [&] { search_held_velocities(t, batch, 1, ~x.stage_bounds.factored, x); });
  x.singular = singular;
  x.stage_bounds.factored = ~T::none();
  x.stage_bounds.searched = x.stage_bounds.searched | lanes;
}

/// Stage i with bounds (M86). Lanes that are not in `lanes` keep the stage that they have.
template <class T>
void bounded_stage(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, typename T::Mask lanes, int i,
                   int time, Tile<T>& x) {
  using A = Alexander<ScalarOf<T>>;
  const int n = t.solver.n, all = t.velocities, rows = t.bounds.rows.count;
  const T chi = T(A::time[i]), duration = T(A::time[i] * t.step);

  // Momenta of the stage without bounds (M68).
  begin_stage(t, batch, x, i, time);
  share_momenta(t, x);
  momenta_to_gain(t, x);
  const bool twice = x.solves_twice && x.dynamics.half_solved_velocity != x.dynamics.half_solved_position;
  const T* const momentum = twice ? x.dynamics.half_solved_velocity : x.dynamics.half_solved_position;
  T *const own = x.stage_bounds.impulse + i * n, *const change = x.stages.change + i * all,
           *const velocity = x.stages.velocity + i * all;

  // (M86): what has acted since the start, and the momentum of corrections apart from the rest.
  if (t.rounds.renumbered) to_rounds(t, x.dynamics.start, x.held.start);
  for (int s = 0; s < n; ++s) {
    const int z = t.rounds.place[s];
    T before = T(0);
    for (int k = 0; k < i; ++k) before = fma(T(A::before[i][k] / A::gamma), x.stage_bounds.impulse[k * n + z], before);
    own[z] = -before;  // of the stage alone: what has acted since the start less this
    x.held.momentum[z] = momentum[s] - before;
    if (x.corrects_positions)
      x.stage_bounds.correction[z] = twice ? x.dynamics.half_solved_position[s] - momentum[s] : T(0);
  }

  // What each row asks at this time, with the friction that is known.
  for (int r = 0; r < rows; ++r) {
    const int z = t.rounds.velocity[r];
    const T known = set_interval(t, r, chi, x);
    x.held.momentum[z] += known;
    own[z] += known;
  }

  // Servos that are left to the search act since the start, too.
  x.servos.duration = duration, x.servos.from = x.stages.begin.q, x.servos.time = time + i, x.servos.corrected = false;
  for (int s = 0; s < t.limited_servos.count; ++s)
    if (any(x.servos.bounded[s]))
      x.held.momentum[t.rounds.servos[s].velocity] += effort_since_start(t, batch, x, s, duration, time + i);

  // The search, and in `own` the impulses of this stage alone.
  go_on_searching(t, batch, lanes, x);
  for (int r = 0; r < rows; ++r) {
    const int z = t.rounds.velocity[r];
    const Branch<T>& branch = x.search.branch[r];
    const T impulse = select(held(branch), x.held.impulse[z], branch.impulse);
    own[z] += impulse;
    x.bounds.invalid = x.bounds.invalid | (beyond(impulse, largest<T>()) & lanes);
  }
  for (int s = 0; s < t.limited_servos.count; ++s) {
    if (!any(x.servos.bounded[s])) continue;
    const LimitedServo& limited = t.rounds.servos[s];
    const int j = t.limited_servos[s], z = limited.velocity;
    const T share = limited.share < 0 ? T(1) : x.couplings.share[limited.share], most = effort_limit<T>(t, batch, j);
    const T force = servo_force(t, x, servo<T>(t, batch, x, j, time + i), s, position_phase,
                                feed_forward<T>(t, batch, j, time + i), x.held.velocity[z]);
    own[z] += select(x.servos.bounded[s], share * duration * clamp(force, -most, most), T(0));
  }

  // Change and velocity of the stage, in these lanes.
  for (int z = 0; z < n; ++z) x.dynamics.solution[z] = found_change(x, t.rounds.place[z]);
  expand(t, x, x.dynamics.solution, x.dynamics.scratch,
         [&](int f, T following) LOCKSTEP_INLINED { return following - x.couplings.velocity_error[f]; });
  for (int k = 0; k < all; ++k) change[k] = select(lanes, x.dynamics.scratch[k], change[k]);
  from_rounds(t, x.held.velocity, x.dynamics.solution);
  expand(t, x, x.dynamics.solution, x.dynamics.scratch, [](int, T following) LOCKSTEP_INLINED { return following; });
  for (int k = 0; k < all; ++k) velocity[k] = select(lanes, x.dynamics.scratch[k], velocity[k]);
}

/// Nothing has landed yet but what was at an end.
template <class T>
void open_stage_bounds(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  const int* const independent = t.reduction.followers > 0 ? t.reduction.independent.data : nullptr;
  for (int z = 0; z < t.solver.n; ++z)
    x.stage_bounds.start[t.rounds.place[z]] = x.stages.midpoint.v[independent ? independent[z] : z];
  open_rows(t, batch, x);
  x.stage_bounds.opened = ~T::none();
  x.stage_bounds.factored = T::none();
  x.stage_bounds.searched = T::none();
  for (int i = 0; i < t.limited_servos.count; ++i) x.servos.bounded[i] = T::none();
}

/// The prediction (M67) with bounds.
template <class T>
void predict_with_bounds(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x, int time) {
  const auto lanes = x.bounds.candidate;
  for (int i = 0; i < t.limited_servos.count; ++i)
    leave_servo_to_search(t, batch, i, beyond_effort(t, batch, x, i, 0, 1, time) & lanes, x);
  bounded_stage(t, batch, lanes, 0, time, x);
  typename T::Mask stops = T::none();
  for (int r = 0; r < t.bounds.rows.count; ++r) {
    const int z = t.rounds.velocity[r];
    StageRow<T>& row = x.stage_bounds.row[r];
    const T speed = x.stage_bounds.start[z];
    const T reached = fma(T(ScalarOf<T>(1) / Alexander<ScalarOf<T>>::gamma), x.held.velocity[z] - speed, speed);
    const auto own = less(row.direction * reached, T(0)) & less(T(0), row.force) & lanes;
    row.reversal = select(own, time_of_stop(speed, reached), row.reversal);
    stops = stops | own;
  }
  when(x, stops, [&] { bounded_stage(t, batch, lanes, 0, time, x); });
}

/// What becomes different when the stages are taken again: rows that stop or land, servos that reach their limit. Each
/// does so once. Returns the lanes.
template <class T>
typename T::Mask stages_differ(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch,
                               typename T::Mask lanes, int time, Tile<T>& x) {
  typename T::Mask differ = T::none();
  for (int i = 0; i < t.limited_servos.count; ++i) {
    const auto reaches = beyond_effort(t, batch, x, i, 0, leapfrog_stages, time) & lanes & ~x.servos.bounded[i];
    leave_servo_to_search(t, batch, i, reaches, x);
    differ = differ | reaches;
  }
  for (int r = 0; r < t.bounds.rows.count; ++r) {
    const int z = t.rounds.velocity[r];
    StageRow<T>& row = x.stage_bounds.row[r];
    const T speed = x.stage_bounds.start[z], reached = x.stage_bounds.end[z];
    const auto stops = less(row.direction * reached, T(0)) & less(T(0), row.force) & ~less(row.reversal, T(1)) & lanes;
    row.reversal = select(stops, time_of_stop(speed, reached), row.reversal);
    differ = differ | stops;
  }
  return differ | (find_landings(t, x) & lanes);
}

/// The stages and the positions with bounds. Sets the velocities that move the positions and the final ones.
template <class T>
void stages_with_bounds(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x, int time) {
  using A = Alexander<ScalarOf<T>>;
  const auto lanes = x.bounds.candidate;
  const int n = t.solver.n, rows = t.bounds.rows.count;
  T *const mean = x.stage_bounds.mean, *const end = x.stage_bounds.end;

  // The stages, until nothing more lands, stops or reaches its limit.
  auto differ = lanes;
  repeat_while(x, differ, 1 + 3 * rows + t.limited_servos.count, [&] {
    for (int z = 0; z < n; ++z) mean[z] = T(0);
    for (int i = 0; i < leapfrog_stages; ++i) {
      bounded_stage(t, batch, lanes, i, time, x);
      for (int z = 0; z < n; ++z) mean[z] = fma(T(A::weight[i]), x.held.velocity[z], mean[z]);
    }
    for (int z = 0; z < n; ++z) end[z] = x.held.velocity[z];
    differ = stages_differ(t, batch, lanes, time, x);
  });

  // Positions: followers' corrections move the masses, and rows that hold have to be at their ends.
  const T h = T(t.step), weight = T(A::gamma);
  for (int r = 0; r < rows; ++r) {
    const auto correction = [&](const Member& member) LOCKSTEP_INLINED {
      return member.follower < 0 ? T(0) : h * weight * x.couplings.correction[member.follower];
    };
    if (t.reduction.followers > 0) read_row(t, batch, r, x.stages.begin.q, correction, x);
    set_mean_interval(t, r, x.search.branch[r], end[t.rounds.velocity[r]], x);
  }
  for (int i = 0; i < t.limited_servos.count; ++i) {
    if (t.record_efforts) x.records.searched[i] = x.servos.bounded[i];
    x.servos.bounded[i] = T::none();
  }
  for (int z = 0; z < n; ++z) {
    x.held.start[z] = mean[z];
    x.held.momentum[z] = weight * x.stage_bounds.correction[z];
  }
  go_on_searching(t, batch, lanes, x);

  // The mean velocity, and the velocity at the end, in these lanes.
  from_rounds(t, x.held.velocity, x.dynamics.solution);
  expand(t, x, x.dynamics.solution, x.dynamics.scratch,
         [&](int f, T following) LOCKSTEP_INLINED { return fma(weight, x.couplings.correction[f], following); });
  for (int k = 0; k < t.velocities; ++k)
    x.stages.mean_velocity[k] = select(lanes, x.dynamics.scratch[k], x.stages.mean_velocity[k]);
  from_rounds(t, end, x.dynamics.solution);
  expand(t, x, x.dynamics.solution, x.dynamics.scratch, [](int, T following) LOCKSTEP_INLINED { return following; });
  for (int k = 0; k < t.velocities; ++k) x.next.v[k] = select(lanes, x.dynamics.scratch[k], x.next.v[k]);
}

/// After the first stage: takes the prediction again in lanes where bounds act on it.
template <class T>
LOCKSTEP_INLINE void bound_prediction(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x,
                                      int time) {
  x.bounds.candidate = bounds_act_on_prediction(t, batch, x, time) & ~x.frozen;
  x.stage_bounds.opened = T::none();
  when(x, x.bounds.candidate, [&] {
    open_stage_bounds(t, batch, x);
    predict_with_bounds(t, batch, x, time);
  });
}

/// Whether all lanes take the stages with bounds, so that nobody needs them without.
template <class T>
LOCKSTEP_INLINE bool all_bounded(const Tables<ScalarOf<T>>& t, const Tile<T>& x) {
  return t.rounds.in_stages && !any(~x.bounds.candidate & ~x.frozen);
}

/// After the last stage: takes the stages again in lanes where bounds act.
template <class T>
LOCKSTEP_INLINE void bound_stages(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x,
                                  int time) {
  x.bounds.candidate = (x.bounds.candidate | bounds_act_on_stages(t, batch, x, time)) & ~x.frozen;
  for (int i = 0; t.record_efforts && i < t.limited_servos.count; ++i) x.records.searched[i] = T::none();
  when(x, x.bounds.candidate, [&] {
    when(x, ~x.stage_bounds.opened, [&] { open_stage_bounds(t, batch, x); });
    stages_with_bounds(t, batch, x, time);
  });
}

/// Joints that are at an end but for rounding are put there, and lanes with a fault show it. No end hides a NaN, which
/// may stand in the position alone: a hinge along gravity is nothing's angle.
template <class T>
void settle_candidates(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  for (int i = 0; i < t.bounds.watched.count; ++i) {
    const int j = t.bounds.watched[i].joint;
    if (!t.bounds.watched[i].ranged || (t.reduction.followers > 0 && t.reduction.follower_of[j] >= 0)) continue;
    const Interval<T> range = position_limits<T>(t, batch, j);
    T& q = x.next.q[j];
    const T ends[2] = {range.lo, range.hi};
    for (const T& end : ends) {
      const T far = farther(end, x.stages.begin.q[j]) * (T(ScalarOf<T>(4)) * T::rounding());
      const auto apart = beyond(q - end, absolute(far)) | beyond(q, T(largest_number<ScalarOf<T>>));
      q = select(apart | ~x.bounds.candidate, q, end);
    }
  }
  x.bounds.invalid = x.bounds.invalid & x.bounds.candidate;
  mark_invalid(t, x);
  T fastest = T(0);
  for (int z = 0; z < t.solver.n; ++z) fastest = farther(fastest, x.stage_bounds.start[z]);
  T& last = x.next.v[t.velocities - 1];
  last = select(beyond(fastest, T(t.velocity_bound)) & x.bounds.candidate, farther(largest<T>(), fastest), last);
}

/// After the positions, in lanes where bounds have acted.
template <class T>
LOCKSTEP_INLINE void settle(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  when(x, x.stage_bounds.opened, [&] { settle_candidates(t, batch, x); });
}

}  // namespace lockstep::kernels
