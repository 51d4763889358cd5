// Joints that turn for ever: whole turns are kept apart from the angle. SPDX-License-Identifier: Apache-2.0
//
// (M80), (M81). All stages see angles. Turns matter in couplings, whose offsets take them up, and in targets. They
// change at the end of a step in which an angle has left [-pi, pi], which is rare.
#pragma once

#include "kernels/tile/lay_out.h"
#include "simd/turns.h"

namespace lockstep::kernels {

/// The largest of `most`, which is not negative, and the magnitudes of the numbers. NaN is larger than any number.
template <class T>
LOCKSTEP_INLINE T farthest(const T* numbers, int count, T most) {
  for (int i = 0; i < count; ++i) most = farther(most, numbers[i]);
  return most;
}
template <class T>
LOCKSTEP_INLINE T farthest(const T* numbers, Span<SupportRun> runs, T most) {
  for (int r = 0; r < runs.count; ++r) most = farthest(numbers + runs[r].first, runs[r].last - runs[r].first, most);
  return most;
}

/// The target of joint j less its whole turns, to be compared with its angle.
template <class T>
LOCKSTEP_INLINE T without_whole_turns(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int j, T target) {
  if (t.turns.count == 0 || !t.turns[j]) return target;
  return fnma(T(ScalarOf<T>(6.28318530717958647693)), x.couplings.turns[j], target);
}

/// The ratio of a coupling's term in this environment.
template <class T>
LOCKSTEP_INLINE T ratio_of(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int term) {
  const ScalarOf<T>* const own = batch.field(Parameter::gear_ratio);
  return own && t.term_gear[term] >= 0 ? T::load(own + t.term_gear[term] * batch.stride) : T(t.term_value[term]);
}

/// (M81): offsets of couplings with the turns of their joints. Turns of joints that are coupled nearly cancel, so the
/// sum is taken in double.
template <class T>
void offsets_with_turns(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  using S = ScalarOf<T>;
  const S *const ratios = batch.field(Parameter::gear_ratio), *const offsets = batch.field(Parameter::offset);
  for (int i = 0; i < t.turning_couplings.count; ++i) {
    const int c = t.turning_couplings[i];
    for (int lane = 0; lane < T::lanes; ++lane) {
      double turns = 0.0;
      for (int k = t.term_start[c]; k < t.term_start[c + 1]; ++k) {
        const int j = t.term_joint[k], gear = t.term_gear[k];
        if (!t.turns[j]) continue;
        const double ratio =
            ratios && gear >= 0 ? static_cast<double>(ratios[gear * batch.stride + lane]) : t.exact_ratio[k];
        turns = __builtin_fma(ratio, static_cast<double>(x.couplings.turns[j].lane(lane)), turns);
      }
      const double offset = offsets ? static_cast<double>(offsets[c * batch.stride + lane]) : t.exact_offset[c];
      x.couplings.offset[c].set_lane(lane, static_cast<S>(__builtin_fma(6.28318530717958647693, turns, offset)));
    }
  }
}

/// The same where no joint has turned.
template <class T>
LOCKSTEP_INLINE void no_turns(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  for (int i = 0; i < t.turning.count; ++i) x.couplings.turns[t.turning[i]] = T(0);
  for (int i = 0; i < t.turning_couplings.count; ++i) {
    const int c = t.turning_couplings[i];
    x.couplings.offset[c] = field<T>(batch, Parameter::offset, t.offset.data).at(c, c);
  }
}

/// Takes positions apart, after load() has read them.
template <class T>
LOCKSTEP_INLINE void load_turns(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  using S = ScalarOf<T>;
  const bool turned_before = x.turned;
  x.turned = any(beyond(farthest(x.state.q, t.turning_runs, T(0)), T(S(simd::surely_within))));
  if (!x.turned) {
    if (turned_before) no_turns(t, batch, x);
    return;
  }
  for (int i = 0; i < t.turning.count; ++i) {
    const int j = t.turning[i];
    const simd::Turned<T> joint = simd::turned(x.state.q[j], T::load(batch.angle + t.dof[j] * batch.stride));
    x.state.q[j] = joint.angle;
    x.couplings.turns[j] = joint.turns;
  }
  offsets_with_turns(t, batch, x);
}

/// Writes positions and, where there are turns, angles, after store() has written the angles as positions.
template <class T>
LOCKSTEP_INLINE void store_turns(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch,
                                 const Tile<T>& x) {
  using S = ScalarOf<T>;
  if (!x.turned && !any(beyond(farthest(x.state.q, t.turning_runs, T(0)), T(S(simd::surely_within))))) return;
  for (int i = 0; i < t.turning.count; ++i) {
    const int j = t.turning[i];
    const std::ptrdiff_t row = t.dof[j] * batch.stride;
    store(batch.position + row, simd::position_of(simd::Turned<T>{x.state.q[j], x.couplings.turns[j]}));
    store(batch.angle + row, x.state.q[j]);
  }
}

/// Puts followers of these lanes back on their couplings where only the rounding of angles and offsets has moved them
/// away, so that consistent followers stay consistent (M76).
template <class T>
void place_turned_followers(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x,
                            typename T::Mask turned, T* q) {
  for (int i = 0; i < t.turning_placed.count; ++i) {
    const int c = t.turning_placed[i], first = t.term_start[c];
    T others = x.couplings.offset[c], size = farther(T(0), others);  // in the order of others_of()
    for (int k = t.term_start[c + 1] - 1; k > first; --k) {
      const T ratio = ratio_of<T>(t, batch, k), other = q[t.term_joint[k]];
      others = fma(ratio, other, others);
      size = farther(size, ratio * other);
    }
    T& follower = q[t.term_joint[first]];
    const auto off = beyond(follower + others, size * (T(ScalarOf<T>(8)) * T::rounding()));
    follower = select(turned & ~off, -others, follower);
  }
}

/// Takes whole turns off the angles of `next`, after a step in which one of them has left [-pi, pi]. A lane whose turns
/// cannot be counted, or whose angle is no number, keeps its last state, with a fault.
template <class T>
void take_turns(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x,
                const State<T>& next) {
  using S = ScalarOf<T>;
  typename T::Mask countless = T::none(), turn = T::none();
  for (int i = 0; i < t.turning.count; ++i) {
    const T angle = next.q[t.turning[i]];
    turn = turn | beyond(angle, T(S(simd::most_angle)));
    countless = countless | beyond(x.couplings.turns[t.turning[i]] + simd::whole_turns(angle), T(simd::most_turns<S>));
  }
  if (!any(turn)) return;
  if (any(countless)) {
    for (int i = 0; i < T::lanes; ++i) {
      if (!lane(countless, i) || batch.fault[i] != Fault::none) continue;
      bool finite = true;
      for (int k = 0; k < t.turning.count; ++k) {
        const S angle = next.q[t.turning[k]].lane(i);
        finite = finite && angle - angle == S(0);
      }
      batch.fault[i] = finite ? Fault::diverged : Fault::not_finite;
    }
    each_part<T>(t, [&](T* State<T>::*part, int count) LOCKSTEP_INLINED {
      for (int i = 0; i < count; ++i) (next.*part)[i] = select(countless, (x.state.*part)[i], (next.*part)[i]);
    });
    x.frozen = x.frozen | countless;
  }
  x.turned = true;
  set_consistent(t, x, false);
  for (int i = 0; i < t.turning.count; ++i) {
    const int j = t.turning[i];
    const auto over = beyond(next.q[j], T(S(simd::most_angle))) & ~countless;
    const T whole = select(over, simd::whole_turns(next.q[j]), T(0));
    next.q[j] = simd::without_turns(next.q[j], whole);
    x.couplings.turns[j] += whole;
  }
  offsets_with_turns(t, batch, x);
  place_turned_followers(t, batch, x, turn & ~countless, next.q);
}

}  // namespace lockstep::kernels
