// Error, softness, bias and speed of each row, before it is solved. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "responses.h"

namespace lockstep::kernels {

/// Compliance of a row in lanes where it is absent (kp = kd = 0).
template <class T>
LOCKSTEP_INLINE T infinite_compliance() {
  return T(ScalarOf<T>(1e30));
}
template <class T>
LOCKSTEP_INLINE T smallest() {
  return T(ScalarOf<T>(smallest_compliance));
}

/// 1 where the coupling is on, 0 where it is off. NaN stays NaN, for check() to find.
template <class T>
LOCKSTEP_INLINE T switched_on(const StatePointers<ScalarOf<T>>& batch, int coupling) {
  const T value = T::load(batch.field(Parameter::coupling_switch) + coupling * batch.stride);
  return select(less(T(0), value) | less(value, T(0)), T(1), value);
}

/// rate and cfm of a sub-step: (M36) for hard rows, otherwise those of the spring (M29) that erp and cfm are. This goes
/// lane by lane, because only tgs with a softness per environment needs it.
template <class T>
void share_out(const Tables<ScalarOf<T>>& t, T erp, T cfm, T& rate, T& row_cfm) {
  const double dt = double(t.dt), n = t.iterations, h = dt / n;
  for (int i = 0; i < T::lanes; ++i) {
    const double e = double(erp.lane(i)), c = double(cfm.lane(i));
    const double kp = e / (dt * dt * c), kd = (1 - e) / (dt * c);
    rate.set_lane(i, ScalarOf<T>(c > 0 ? kp / (h * kp + kd) : (1 - __builtin_pow(1 - e, 1 / n)) / h));
    row_cfm.set_lane(i, ScalarOf<T>(c > 0 ? 1 / (h * (h * kp + kd)) : c));
  }
}

/// rate and cfm from the softness of this tile: (M27), (M28); (22), (23), (26) to (29) of the note.
template <class T>
void follow_softness(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int row, T response,
                     Tile<T>& x) {
  const int coupling = t.rows.coupling[row];
  const SoftnessKind kind = t.rows.softness[row].kind;
  const T first = T::load(batch.field(Parameter::softness) + 2 * coupling * batch.stride);
  const T second = T::load(batch.field(Parameter::softness) + (2 * coupling + 1) * batch.stride);
  const T h = t.renewed ? T(t.dt) / T(ScalarOf<T>(t.iterations)) : T(t.dt);
  if (kind == SoftnessKind::hard || kind == SoftnessKind::erp_cfm) {
    if (t.renewed) return share_out(t, first, second, x.rows.rate[row], x.rows.cfm[row]);
    x.rows.rate[row] = first / h;
    x.rows.cfm[row] = second;
    return;
  }
  const bool spring = kind == SoftnessKind::spring;
  const T denominator = spring ? fma(h, first, second) : fma(h, first, second + second);
  const auto absent = less(spring ? denominator : first, smallest<T>());
  const T cfm = spring ? T(1) / (h * denominator) : response / (h * first * denominator);
  x.rows.rate[row] = select(absent, T(0), first / denominator);
  x.rows.cfm[row] = select(absent, infinite_compliance<T>(), cfm);
}

/// rate and cfm of a row from the plan's softness, for the response to which (M28) refers.
template <class T>
LOCKSTEP_INLINE void set_softness(const RowSoftness<ScalarOf<T>>& softness, T response, int row, Tile<T>& x) {
  x.rows.rate[row] = T(softness.rate);
  x.rows.cfm[row] = fma(T(softness.cfm_per_response), response, T(softness.cfm));
}

/// rate and cfm of each row. They hold as long as the matrix does.
template <class T>
void row_softness(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  const Rows<ScalarOf<T>>& rows = t.rows;
  const bool factored = rows.columns.n > 0;
  for (int r = 0; r < rows.count; ++r) {
    const T response = x.rows.delassus[factored ? rows.columns.offset[r] : r * rows.count + r];
    const T undamped = t.undamped_row[r] < 0 ? response : x.undamped.compliance[t.undamped_row[r]];
    if (t.declares(Parameter::softness))
      follow_softness(t, batch, r, undamped, x);
    else
      set_softness(rows.softness[r], undamped, r, x);
    if (t.declares(Parameter::coupling_switch)) {
      const T on = switched_on<T>(batch, rows.coupling[r]);
      x.rows.rate[r] *= on;
      x.rows.cfm[r] = select(less(on, T(1)), infinite_compliance<T>(), x.rows.cfm[r]);
    }
  }
}

/// The bias of the velocity phase (M33). Hard rows drop theirs; soft rows keep it, because it is their spring. If a row
/// is soft in all environments, both phases have the same terms, and a traced step sees that.
template <class T>
LOCKSTEP_INLINE T velocity_phase_bias(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int r) {
  if (!t.declares(Parameter::softness) && t.rows.softness[r].soft) return x.rows.bias[r];
  return select(less(x.rows.cfm[r], smallest<T>()), T(0), x.rows.bias[r]);
}

/// The speed of a coupling, with what the corrections of followers add to it.
template <class T>
LOCKSTEP_INLINE T with_corrections(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int coupling, T speed) {
  if (!t.reduction.eliminates()) return speed;
  for (int k = t.term_start[coupling]; k < t.term_start[coupling + 1]; ++k)
    if (const int f = t.reduction.follower_of[t.term_joint[k]]; f >= 0)
      speed += x.couplings.coefficient[k] * x.couplings.correction[f];
  return speed;
}

/// Error, bias and speeds of each row under the free motion.
template <class T>
void row_terms(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Rows<ScalarOf<T>>& rows = t.rows;
  const int n = t.solver.n;
  const bool one_motion = !x.solves_twice || x.dynamics.half_solved_velocity == x.dynamics.half_solved_position;
  for (int r = 0; r < rows.count; ++r) {
    x.rows.error[r] = x.couplings.error[rows.coupling[r]];
    x.rows.bias[r] = x.rows.rate[r] * x.rows.error[r];
    if (!x.corrects_positions) x.rows.bias[r] = velocity_phase_bias(t, x, r);

    // J v at the start, and J v* (M20).
    T now = T(0);
    for (int k = rows.term_start[r]; k < rows.term_start[r + 1]; ++k)
      now = fma(x.rows.value[k], x.dynamics.start[rows.term_index[k]], now);
    const T free = supported_dot(rows, r, x.rows.response + r * n, x.dynamics.half_solved_position);
    const T free_in_velocity_phase =
        one_motion ? free : supported_dot(rows, r, x.rows.response + r * n, x.dynamics.half_solved_velocity);
    x.rows.start[r] = now;
    x.rows.speed[r] = with_corrections(t, x, rows.coupling[r], now + free);
    x.rows.velocity_phase_speed[r] = now + free_in_velocity_phase;
    if (!x.solves_twice)
      x.rows.velocity_phase_speed[r] = with_corrections(t, x, rows.coupling[r], x.rows.velocity_phase_speed[r]);
  }
}

}  // namespace lockstep::kernels
