// Diagnostics of a step: residuals and states of its rows, and its energy balance. SPDX-License-Identifier: Apache-2.0
//
// (M64), (M65). Runs between the solve and check(), while everything that the solve used is still there.
#pragma once

#include "kernels/couplings/drive_efforts.h"
#include "kernels/dynamics/energies.h"
#include "kernels/integrators/solve_bounds.h"

namespace lockstep::kernels {

/// `code` of Batch::row_states() in the lanes where it applies.
template <class T>
LOCKSTEP_INLINE T state(typename T::Mask applies, float code) {
  return select(applies, T(code), T(0));
}

/// The impulse of a row that a force limit bounds; 0 where it is not active, as no solve has written one there. The
/// position phase of tgs has only the mean of the sub-steps, which is less.
template <class T>
LOCKSTEP_INLINE T whole_impulse(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int r) {
  return select(x.bounds.active[r], x.bounds.impulse[t.renewed ? t.bounds.rows.count + r : r], T(0));
}

template <class T>
void look_at_coupling(const Tables<ScalarOf<T>>& t, const Tile<T>& x, const Reported& row, T& residual, T& row_state) {
  const int c = row.index;
  const bool hard = row.member == 1;
  T rate = T(t.hard_rate[c]), cfm = T(0), impulse = T(0);
  auto present = ~T::none();
  row_state = hard ? T(1) : T(0);
  residual = T(0);

  // By its row, its bounded row, or neither: what (M64) needs, and the state.
  if (row.row >= 0) {
    cfm = x.rows.cfm[row.row];
    impulse = x.rows.position_impulse[row.row];
    if (!t.renewed) rate = x.rows.rate[row.row];
    present = less(cfm, infinite_compliance<T>());
    if (t.renewed) present = present & less(cfm, smallest<T>());  // the softness of a sub-step is not that of the step
    row_state = state<T>(less(cfm, infinite_compliance<T>()), 1);
  } else if (row.bounded >= 0) {
    const T force = x.bounds.force[row.bounded], slack = force * T(ScalarOf<T>(1e-5));
    impulse = whole_impulse(t, x, row.bounded);
    cfm = x.bounds.cfm[row.bounded];
    rate = T(t.bounds.soft_rate[row.bounded]);
    const auto up = less(force - slack, impulse), down = less(impulse, slack - force);
    present = ~(up | down);
    if (t.renewed) present = present & less(cfm, smallest<T>());
    row_state = select(up, T(2), select(down, T(-2), T(1)));
  } else if (!hard || t.follows[c]) {
    row_state = T(0);
    if (!hard) return;
  }

  // (M64), where the condition is that of an equality.
  T speed = fma(rate, x.couplings.error[c], cfm * impulse);
  for (int k = t.term_start[c]; k < t.term_start[c + 1]; ++k)
    speed = fma(x.couplings.coefficient[k], x.diagnostics.moved_velocity[t.velocity_of(t.term_joint[k])], speed);
  residual = select(present, T(t.dt) * larger(speed, -speed), T(0));
}

/// J z of row i of a loop.
template <class T>
LOCKSTEP_INLINE T loop_speed(const Tables<ScalarOf<T>>& t, const Tile<T>& x, const HeldLoop<ScalarOf<T>>& loop, int i,
                             const T* z) {
  T speed = T(0);
  for (int k = 0; k < loop.columns; ++k)
    speed = fma(x.loops.value[loop.value + i * loop.columns + k], z[t.loops.columns[loop.column + k].velocity], speed);
  return speed;
}

/// (M64) of the row that misses most, and whether some row is at its limit.
template <class T>
void look_at_loop(const Tables<ScalarOf<T>>& t, Tile<T>& x, const Reported& reported, T& residual, T& row_state) {
  residual = row_state = T(0);
  each_loop(t, x, [&](const auto& loop, int l, const ActingRow<T>* rows) {
    if (l != reported.index) return;
    for (int i = 0; i < loop.rows(); ++i) {
      const T impulse = x.loops.impulse[loop.row + i];
      const auto on = less(rows[i].cfm, infinite_compliance<T>()), limited = is_at_limit(loop, i, impulse);
      const T goal = fma(T(t.dt * ScalarOf<T>(0.5)), x.loops.bias[loop.row + i],
                         closing_speed(t, loop, i, x.loops.gap[loop.row + i]));
      const T speed = fma(rows[i].cfm, impulse, goal + loop_speed(t, x, loop, i, x.dynamics.solution));
      residual = larger(residual, select(on & ~limited, T(t.dt) * absolute(speed), T(0)));
      row_state = larger(row_state, select(on, select(limited, T(2), T(1)), T(0)));
    }
  });
}

template <class T>
void look_at_bound(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x,
                   const Reported& row, T& residual, T& row_state) {
  using S = ScalarOf<T>;
  const Bounds<S>& b = t.bounds;
  const int j = row.index, r = row.bounded;
  const T h = T(t.dt), zero = T(0), u = x.diagnostics.moved_velocity[t.velocity_of(j)];
  residual = row_state = zero;

  // An effort limit has no residual: the servo, its row, or the effort alone shows whether it is reached.
  if (row.kind == Reported::effort_limit) {
    const T most = effort_limit<T>(t, batch, j), effort = feed_forward<T>(t, batch, j);
    if (row.member >= 0)
      row_state = x.servos.saturation[row.member];
    else if (r >= 0)
      row_state = saturated(whole_impulse(t, x, r), x.bounds.force[r]);
    else
      row_state = saturated(effort, most);
    row_state = row_state + row_state;
    return;
  }

  // Whether the interval holds the row, beyond what friction does, and at which end.
  if (r < 0) return;
  const T impulse = whole_impulse(t, x, r), force = x.bounds.force[r];
  const auto held = x.bounds.active[r] & (less(force, impulse) | less(impulse, -force));
  const T slack = T(S(1e-5));
  const auto reaches = [&](T bound, T speed) {
    return held & ~less(fma(slack, T(1) + larger(speed, -speed), bound), speed);
  };
  const bool hard = b.kind[r] == BoundKind::joint || b.kind[r] == BoundKind::drive;
  const StepTime<T> at{false, S(1) / t.dt};
  switch (row.kind) {
    case Reported::position_limit: {
      if (!hard) {
        row_state = select(less(zero, impulse), T(1), select(less(impulse, zero), T(-1), zero));
        return;
      }
      // The range asks for no more than the velocity limit allows.
      const Interval<T> own = range_interval(t, batch, x, j, at, zero),
                        within = joint_interval(t, batch, x, j, at, zero);
      residual = h * larger(zero, larger(smaller(own.lo, within.lo) - u, u - larger(own.hi, within.hi)));
      row_state = select(reaches(own.lo, u), T(1), select(reaches(-own.hi, -u), T(-1), zero));
      return;
    }
    case Reported::velocity_limit: {
      const T most = speed_limit<T>(t, batch, j);
      residual = h * larger(zero, larger(u, -u) - most);
      row_state = select(reaches(-most, u), T(1), select(reaches(-most, -u), T(-1), zero));
      return;
    }
    case Reported::friction: {
      const auto up = ~less(impulse, force), down = ~less(-force, impulse);
      row_state = select(x.bounds.active[r], select(up, T(2), select(down, T(-2), T(1))), zero);
      return;
    }
    default:
      row_state = T(1);
      if (!hard) return;
      residual = kinematic_velocity(t, batch, x, j, x.state.q[j]) - u;
      residual = h * larger(residual, -residual);
  }
}

/// (M65) without the change of energy. `work` gets that of drives, springs, soft rows and bounces; `dissipated` gets
/// what damping and friction take.
template <class T>
void add_work(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x, T& work,
              T& dissipated) {
  const Bounds<ScalarOf<T>>& b = t.bounds;
  const Phase phase = t.solve_twice ? velocity_phase : position_phase;
  const T h = T(t.dt), zero = T(0);
  const Field<T> damping = field<T>(batch, Parameter::damping, t.damping.data);

  // Damping, efforts and servos.
  for (int j = 0; j < t.joints; ++j) {
    const T v = x.next.v[t.velocity_of(j)];
    dissipated = fma(damping.at(j, t.dof[j]) * v, h * v, dissipated);
  }
  each_drive_effort(t, batch, x, 0, x.next.v, [&](int j, T effort) LOCKSTEP_INLINED {
    work = fma(effort, h * x.next.v[t.velocity_of(j)], work);
  });

  // Springs.
  for (int i = 0; i < t.springs.count; ++i) {
    const int j = t.springs[i];
    const T displacement = h * x.next.v[t.velocity_of(j)],
            stretched = x.state.q[j] + displacement - without_whole_turns(t, x, j, T(t.rest[j]));
    work = fnma(stiffness<T>(t, batch, j) * stretched, displacement, work);
  }
  const auto moved = [&](int c) {
    T speed = zero;
    for (int k = t.term_start[c]; k < t.term_start[c + 1]; ++k)
      speed = fma(x.couplings.coefficient[k], x.next.v[t.velocity_of(t.term_joint[k])], speed);
    return speed;
  };
  const auto bounces = [&](int r) {
    for (int k = b.member_start[r]; k < b.member_start[r + 1]; ++k)
      if (b.has[b.member[k].joint] & has_restitution) return true;
    return false;
  };

  // Soft couplings.
  const T* solved = phase == velocity_phase ? x.rows.velocity_impulse : x.rows.position_impulse;
  for (int e = 0; e < t.impulse_coupling.count; ++e) {
    const T soft = select(less(smallest<T>(), x.rows.cfm[e]), solved[e], zero);
    work = fma(soft, moved(t.impulse_coupling[e]), work);
  }

  // Soft loops.
  if (t.loops.used())
    each_loop(t, x, [&](const auto& loop, int, const ActingRow<T>*) {
      for (int i = 0; i < loop.rows() && loop.soft; ++i)
        work = fma(x.loops.impulse[phase * t.loops.rows + loop.row + i],
                   loop_speed(t, x, loop, i, t.solve_twice ? x.dynamics.velocity_solution : x.dynamics.solution), work);
    });

  // Bounded rows: soft ones and drives do work, friction takes, bounces give.
  for (int i = 0; i < x.bounds.active_count; ++i) {
    const int r = x.bounds.active_rows[i], m = b.member_start[r];
    if (b.kind[r] == BoundKind::servo) continue;  // among the drives
    const T impulse = select(x.bounds.active[r], x.bounds.impulse[phase * b.rows.count + r], T(0));
    if (b.kind[r] == BoundKind::coupling) {
      work = fma(impulse, moved(b.rows.coupling[r]), work);
      continue;
    }
    T done = impulse * x.next.v[t.velocity_of(b.member[m].joint)] * x.bounds.member_inverse[m];
    if (b.kind[r] == BoundKind::ball_range) {
      done = impulse * bound_speed(t, x, r, t.solve_twice ? x.dynamics.velocity_solution : x.dynamics.solution);
      if (b.rows.softness[r].soft)
        work += done;
      else if (b.restitution[b.member[m].joint] > 0)
        work += larger(done, zero);
    } else if (b.kind[r] != BoundKind::joint || b.kinematic[r])
      work += done;
    else {
      dissipated -= select(less(zero, x.bounds.force[r]), smaller(done, zero), zero);
      if (bounces(r)) work += larger(done, zero);  // other limits do not move the way they push
    }
  }
}

/// Potential energy at `state`, with kinetic energy if `kinetic`.
template <class T>
T energy_at(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x,
            const State<T>& state, bool kinetic) {
  Tile<T> there = x;
  there.state = state;
  Motion<T>& motion = there.diagnostics.motion;
  motions(t, there, motion);
  const T potential = potential_energy(t, batch, there, motion);
  return kinetic ? potential + kinetic_energy(t, batch, there, motion) : potential;
}

template <class T>
void diagnose(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  folded_impulses(t, x);
  for (int i = 0; i < t.reported.count; ++i) {
    const Reported& row = t.reported[i];
    T residual, row_state;
    if (row.kind == Reported::coupling)
      look_at_coupling(t, x, row, residual, row_state);
    else if (row.kind == Reported::loop)
      look_at_loop(t, x, row, residual, row_state);
    else
      look_at_bound(t, batch, x, row, residual, row_state);
    x.diagnostics.residual[i] = residual;
    x.diagnostics.row_state[i] = row_state;
  }

  T work = T(0), dissipated = T(0), corrected = T(0);
  add_work(t, batch, x, work, dissipated);
  if (t.contacts.used()) add_contact_work(t, x.rounds.z, x, work, dissipated);
  const T before = energy_at(t, batch, x, x.state, true);
  const T after = energy_at(t, batch, x, x.next, true);
  if (t.solve_twice && !t.renewed) {  // tgs moves positions by a mean velocity, not by a correction
    expand(t, x, x.dynamics.velocity_solution, false, x.diagnostics.uncorrected.v);
    for (int j = 0; j < t.joints; ++j)
      x.diagnostics.uncorrected.q[j] = fma(T(t.dt), x.diagnostics.uncorrected.v[t.velocity_of(j)], x.state.q[j]);
    if (t.balls.count > 0) move_balls(t, t.dt, x.diagnostics.uncorrected.v, x.state.q, x.diagnostics.uncorrected.q);
    if (t.functions.used()) place_curved_positions(t, x, x.diagnostics.uncorrected.q);
    move_roots(t, x, t.dt, x.diagnostics.uncorrected.v, x.state.pose, x.diagnostics.uncorrected.pose);
    corrected = energy_at(t, batch, x, x.next, false) - energy_at(t, batch, x, x.diagnostics.uncorrected, false);
  }
  x.diagnostics.energy_change[0] = work;
  x.diagnostics.energy_change[1] = dissipated;
  x.diagnostics.energy_change[2] = corrected;
  x.diagnostics.energy_change[3] = after - before;
}

/// Runs after check(): a step that failed does not count.
template <class T>
void add_energies(Tile<T>& x) {
  for (int k = 0; k < 4; ++k) x.diagnostics.energy[k] += select(x.frozen, T(0), x.diagnostics.energy_change[k]);
}

}  // namespace lockstep::kernels
