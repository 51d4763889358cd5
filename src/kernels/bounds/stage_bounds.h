// Bounds in the stages of a step: what they ask of a stage, and when rows land and stop. SPDX-License-Identifier:
// Apache-2.0
//
// (M86) to (M90). A stage's velocity is that of a time within the step, so bounds ask it for what has acted until then:
// a range only after its row has landed, friction one way until the row stops and as a box from then on.
#pragma once

#include "held_velocities.h"

namespace lockstep::kernels {

/// Where nothing has happened yet.
template <class T>
LOCKSTEP_INLINE T never() {
  return T(ScalarOf<T>(2));
}

/// Distances and speeds below this are zero: a row is at its end, and does not slip.
template <class T>
LOCKSTEP_INLINE T at_rest() {
  return T::by_precision(1e-6, 1e-13);
}

/// A range has this gap at an end, by joint j.
template <class T>
LOCKSTEP_INLINE void narrow_range(const Bounds<ScalarOf<T>>& b, int j, T gap, RangeEnd<T>& end) {
  const auto first = less(end.gap, gap);
  end.gap = select(first, gap, end.gap);
  end.rate = select(first, T(b.limit_rate[j]), end.rate);
  end.restitution = select(first, T(b.restitution[j]), end.restitution);
}

/// (M59) in displacements: the range, limit and friction of row r at the positions `q`. `corrected_by` gives what a
/// member's follower moves besides.
template <class T, class Corrected>
void read_row(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int r, const T* q,
              Corrected&& corrected_by, Tile<T>& x) {
  using S = ScalarOf<T>;
  const Bounds<S>& b = t.bounds;
  const T zero = T(0), far = T(S(unlimited));
  StageRow<T>& row = x.stage_bounds.row[r];

  // No bound yet.
  row.low.gap = row.high.gap = -far;
  row.low.rate = row.high.rate = row.low.restitution = row.high.restitution = zero;
  row.most = far;
  row.force = row.prescribed = zero;
  int drives = 0;

  // What each member has, in terms of the row's velocity.
  for (int m = b.member_start[r]; m < b.member_start[r + 1]; ++m) {
    const Member member = b.member[m];
    const int j = member.joint, has = b.has[j];
    const T share = x.bounds.member_share[m], inverse = x.bounds.member_inverse[m], scale = absolute(inverse);
    const T also = corrected_by(member);
    if (has & has_range) {
      const Interval<T> range = position_limits<T>(t, batch, j);
      const T below = up_to_rounding(range.lo - q[j], range.lo) - also,
              above = also - up_to_rounding(range.hi - q[j], range.hi);
      const auto same_way = less(zero, share);
      narrow_range(b, j, select(same_way, below, above) * scale, row.low);
      narrow_range(b, j, select(same_way, above, below) * scale, row.high);
    }
    if (has & has_speed_limit) row.most = smaller(row.most, speed_limit<T>(t, batch, j) * scale);
    if (has & has_friction) row.force = fma(absolute(share), friction_impulse<T>(t, batch, j), row.force);
    if (has & has_kinematic_drive) {
      const T speed = fnma(T(S(1) / t.step), also, kinematic_velocity(t, batch, x, j, q[j]));
      row.prescribed = fma(speed, inverse, row.prescribed);
      ++drives;
    }
  }

  // Several drives take their mean. Ends that cross share the violation.
  if (drives > 1) row.prescribed *= T(S(1) / S(drives));
  const auto empty = less(-row.high.gap, row.low.gap);
  const T middle = T(S(0.5)) * (row.low.gap - row.high.gap);
  row.low.gap = select(empty, middle, row.low.gap);
  row.high.gap = select(empty, -middle, row.high.gap);
}

/// Speed of the row towards an end is negative.
template <class T>
LOCKSTEP_INLINE T seen_from(int side, T speed) {
  return side == 0 ? speed : -speed;
}

template <class T>
LOCKSTEP_INLINE RangeEnd<T>& end_of(StageRow<T>& row, int side) {
  return side == 0 ? row.low : row.high;
}

/// (M90): inertia without what is implicit, as a share of the diagonal of the matrix, for rows with friction.
template <class T>
T share_of_inertia(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x, int r) {
  const Bounds<ScalarOf<T>>& b = t.bounds;
  const T all = x.held.matrix[t.rounds.columns.offset[t.rounds.velocity[r]]], h = T(t.ahead);
  const Field<T> damping = field<T>(batch, Parameter::damping, t.damping.data);
  T implicit = T(0);
  for (int m = b.member_start[r]; m < b.member_start[r + 1]; ++m) {
    const int j = b.member[m].joint;
    const T share = x.bounds.member_share[m];
    const Gains<T> own = gains<T>(t, batch, j);
    const T rate = damping.at(j, t.dof[j]) + own.kd + h * (own.kp + stiffness<T>(t, batch, j));
    implicit = fma(share * share * h, rate, implicit);
  }
  return larger(all - implicit, T(0)) / all;
}

/// All rows at the start of a step. A row that is at an end of its range and does not leave has landed already.
template <class T>
void open_rows(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  const T zero = T(0), rest = at_rest<T>();
  x.bounds.invalid = T::none();
  for (int r = 0; r < t.bounds.rows.count; ++r) {
    read_row(
        t, batch, r, x.stages.begin.q, [](const Member&) LOCKSTEP_INLINED { return T(0); }, x);
    StageRow<T>& row = x.stage_bounds.row[r];
    const T speed = x.stage_bounds.start[t.rounds.velocity[r]];
    for (int side = 0; side < 2; ++side) {
      RangeEnd<T>& end = end_of(row, side);
      const T seen = seen_from(side, speed);
      const auto landed = ~less(end.gap, -rest) & ~less(rest, seen);
      end.time = select(landed, zero, never<T>());
      end.arrival = select(landed, smaller(seen, zero), zero);
      end.gained = zero;
    }
    row.direction = select(less(rest, speed), T(1), select(less(speed, -rest), T(-1), zero));
    row.reversal = absolute(row.direction);
    row.inertia_share = share_of_inertia(t, batch, x, r);
    const T demand = row.low.gap + row.high.gap + row.most + row.force + row.prescribed;
    x.bounds.invalid = x.bounds.invalid | beyond(demand, largest<T>());
  }
}

/// (M87): the interval of row r at the share `chi` of the step, and its box. Returns the part of friction that is
/// known.
template <class T>
LOCKSTEP_INLINE T set_interval(const Tables<ScalarOf<T>>& t, int r, T chi, Tile<T>& x) {
  const T zero = T(0);
  StageRow<T>& row = x.stage_bounds.row[r];
  T limit[2];
  for (int side = 0; side < 2; ++side) {
    const RangeEnd<T>& end = end_of(row, side);
    const auto landed = less(end.time, chi);
    const T back = fma(chi - end.time, smaller(zero, end.gained), -(end.restitution * end.arrival));
    limit[side] = select(landed, smaller(larger(back, zero), row.most), -row.most);
  }
  T lo = limit[0], hi = -limit[1];
  const auto empty = less(hi, lo);
  const T middle = T(ScalarOf<T>(0.5)) * (lo + hi);
  lo = select(empty, middle, lo), hi = select(empty, middle, hi);
  if (t.bounds.kinematic[r]) lo = hi = clamp(row.prescribed, lo, hi);
  x.bounds.lo[r] = lo, x.bounds.hi[r] = hi;
  x.bounds.force[r] = larger(zero, chi - row.reversal) * row.force;
  return -(row.direction * smaller(row.reversal, chi) * row.force);
}

/// The share of the step after which a row that slips stops, if it has the speed `reached` after one step: (M88).
template <class T>
LOCKSTEP_INLINE T time_of_stop(T speed, T reached) {
  return smaller(speed / (speed - reached), T(1) - T::rounding());
}

/// (M89): rows that the mean velocity takes past an end land. Returns the lanes with such a row.
template <class T>
typename T::Mask find_landings(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  using S = ScalarOf<T>;
  const T zero = T(0), one = T(1), h = T(t.step);
  const T *const mean = x.stage_bounds.mean, *const reached = x.stage_bounds.end;
  typename T::Mask any_landed = T::none();
  for (int r = 0; r < t.bounds.rows.count; ++r) {
    const int z = t.rounds.velocity[r];
    for (int side = 0; side < 2; ++side) {
      RangeEnd<T>& end = end_of(x.stage_bounds.row[r], side);
      const T w = seen_from(side, mean[z]), u = seen_from(side, x.stage_bounds.start[z]),
              a = seen_from(side, reached[z]) - u;
      const auto lands = less(one, end.time) & less(h * w, end.gap);
      const T rate = end.gap / h, root = fma(u, u, T(S(2)) * a * rate);
      T time = T(S(2)) * rate / (u - sqrt(larger(root, zero)));
      time = select(less(zero, time) & less(time, one) & ~less(root, zero), time, clamp(rate / w, zero, one));
      time = select(less(end.gap, zero), time, zero);
      T arrival = smaller(zero, fma(a, time, u));
      // It would be back within the step, so it rests.
      arrival = select(less(-a, -(end.restitution * arrival)), arrival, zero);
      end.time = select(lands, time, end.time);
      end.arrival = select(lands, arrival, end.arrival);
      end.gained = select(lands, a, end.gained);
      any_landed = any_landed | lands;
    }
  }
  return any_landed;
}

/// The share of the step after which the first row has landed in it, never() if none has.
template <class T>
T first_landing(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  T first = never<T>();
  for (int r = 0; r < t.bounds.rows.count; ++r)
    for (int side = 0; side < 2; ++side) {
      const T time = end_of(x.stage_bounds.row[r], side).time;
      first = select(less(T(0), time), smaller(first, time), first);
    }
  return first;
}

/// (M90): what the mean velocity of row r has to be, after a stage that ended with the velocity `ended` on `branch`.
template <class T>
LOCKSTEP_INLINE void set_mean_interval(const Tables<ScalarOf<T>>& t, int r, const Branch<T>& branch, T ended,
                                       Tile<T>& x) {
  using S = ScalarOf<T>;
  const T zero = T(0), half = T(S(0.5)), inverse = T(S(1) / t.step);
  StageRow<T>& row = x.stage_bounds.row[r];
  T limit[2];
  typename T::Mask holds[2];
  for (int side = 0; side < 2; ++side) {
    const RangeEnd<T>& end = end_of(row, side);
    const T to_end = end.gap * select(less(zero, end.gap), end.rate, inverse);
    holds[side] = (side == 0 ? branch.low : branch.high) & less(end.time, T(1));
    const T leaving = half * (T(1) - end.time) * fma(-end.restitution, end.arrival, seen_from(side, ended));
    limit[side] = clamp(select(holds[side], to_end + leaving, to_end), -row.most, row.most);
  }
  T lo = limit[0], hi = -limit[1];
  const auto empty = less(hi, lo);
  const T middle = half * (lo + hi);
  lo = select(empty, middle, lo), hi = select(empty, middle, hi);
  hi = select(holds[0], lo, hi), lo = select(holds[1], hi, lo);
  const T stopped = clamp(half * row.reversal * row.inertia_share * x.stage_bounds.start[t.rounds.velocity[r]], lo, hi);
  lo = select(branch.stuck, stopped, lo), hi = select(branch.stuck, stopped, hi);
  if (t.bounds.kinematic[r]) lo = hi = clamp(row.prescribed, lo, hi);
  x.bounds.lo[r] = lo, x.bounds.hi[r] = hi;
  x.bounds.force[r] = zero;
}

}  // namespace lockstep::kernels
