// Error, softness, bias and speed of each row, before it is solved. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "responses.h"

namespace lockstep::kernels {

/// A row that is absent in some lanes (kp = kd = 0) yields to everything there.
template <class T>
LOCKSTEP_INLINE T yields_to_everything() {
  return T(ScalarOf<T>(1e30));
}
template <class T>
LOCKSTEP_INLINE T smallest() {
  return T(ScalarOf<T>(1e-30));
}

/// 1 where the coupling is on, 0 where it is off; no number stays none, for check() to find.
template <class T>
LOCKSTEP_INLINE T switched_on(const Lanes<ScalarOf<T>>& lanes, int coupling) {
  const T value = T::load(lanes.field[8] + coupling * lanes.stride);
  return select(less(T(0), value) | less(value, T(0)), T(1), value);
}

/// (M36) 1 - (1 - erp)^(1/N), and by (M29) mixing as the spring that it is, for a sub-step: lane by lane, since only
/// tgs with a softness per environment asks for it.
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

/// rate and cfm from this tile's own softness: (M27), (M28); (22), (23), (26) to (29) of the note.
template <class T>
void follow_softness(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, int row, T response, Tile<T>& x) {
  const int coupling = t.rows.coupling[row], kind = t.rows.softness[row].kind;
  const T first = T::load(lanes.field[2] + 2 * coupling * lanes.stride);
  const T second = T::load(lanes.field[2] + (2 * coupling + 1) * lanes.stride);
  const T h = t.renewed ? T(t.dt) / T(ScalarOf<T>(t.iterations)) : T(t.dt);
  if (kind <= 1) {
    if (t.renewed) return share_out(t, first, second, x.row_rate[row], x.row_cfm[row]);
    x.row_rate[row] = first / h;
    x.row_cfm[row] = second;
    return;
  }
  const bool spring = kind == 2;
  const T yielding = spring ? fma(h, first, second) : fma(h, first, second + second);
  const auto absent = less(spring ? yielding : first, smallest<T>());
  const T cfm = spring ? T(1) / (h * yielding) : response / (h * first * yielding);
  x.row_rate[row] = select(absent, T(0), first / yielding);
  x.row_cfm[row] = select(absent, yields_to_everything<T>(), cfm);
}

/// rate and cfm of each row, for as long as the matrix stays.
template <class T>
void row_softness(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  const Rows<ScalarOf<T>>& rows = t.rows;
  const bool factored = rows.columns.n > 0;
  for (int r = 0; r < rows.count; ++r) {
    const T response = x.coupled[factored ? rows.columns.offset[r] : r * rows.count + r];
    const T natural = t.natural_row[r] < 0 ? response : x.natural_compliance[t.natural_row[r]];
    if (declared<T>(t, 2)) {
      follow_softness(t, lanes, r, natural, x);
    } else {
      const RowSoftness<ScalarOf<T>>& softness = rows.softness[r];
      x.row_rate[r] = T(softness.rate);
      x.row_cfm[r] = fma(T(softness.cfm_per_response), natural, T(softness.cfm));
    }
    if (declared<T>(t, 8)) {
      const T on = switched_on<T>(lanes, rows.coupling[r]);
      x.row_rate[r] *= on;
      x.row_cfm[r] = select(less(on, T(1)), yields_to_everything<T>(), x.row_cfm[r]);
    }
  }
}

/// The bias of the velocity phase (M33): hard rows drop theirs, soft ones keep it (they are springs).
template <class T>
LOCKSTEP_INLINE T closing_bias(const Tile<T>& x, int r) {
  return select(less(x.row_cfm[r], smallest<T>()), T(0), x.row_bias[r]);
}

/// Error, bias and speeds of each row, as the free motion leaves it.
template <class T>
void row_terms(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Rows<ScalarOf<T>>& rows = t.rows;
  const int n = t.solver.n;
  const bool one_motion = !x.solves_twice || x.free_velocity == x.free_position;
  for (int r = 0; r < rows.count; ++r) {
    x.row_error[r] = x.coupling_error[rows.coupling[r]];
    x.row_bias[r] = x.row_rate[r] * x.row_error[r];
    if (!x.corrects) x.row_bias[r] = closing_bias(x, r);

    // J v now, and J v* (M20) as the free motion leaves it.
    T now = T(0);
    for (int k = rows.term_start[r]; k < rows.term_start[r + 1]; ++k)
      now = fma(x.row_value[k], x.start[rows.term_index[k]], now);
    const T free = supported_dot(rows, r, x.response + r * n, x.free_position);
    const T closed = one_motion ? free : supported_dot(rows, r, x.response + r * n, x.free_velocity);
    x.row_start[r] = now;
    x.row_speed[r] = now + free;
    x.row_speed_closed[r] = now + closed;
    if (!t.reduction.eliminates()) continue;
    const int coupling = rows.coupling[r];
    for (int k = t.term_start[coupling]; k < t.term_start[coupling + 1]; ++k) {
      const int f = t.reduction.follower_of[t.term_joint[k]];
      if (f < 0) continue;
      const T pushed = x.coefficient[k] * x.correction[f];
      x.row_speed[r] += pushed;
      if (!x.solves_twice) x.row_speed_closed[r] += pushed;
    }
  }
}

}  // namespace lockstep::kernels
