// Joints that turn for ever: whole turns are kept apart from the angle. SPDX-License-Identifier: Apache-2.0
//
// (M80), (M81). All stages see angles. Turns matter in couplings, whose offsets take them up, and in targets. They
// change at the end of a step in which an angle has left [-pi, pi], which is rare.
#pragma once

#include "kernels/tile/faults.h"
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
  const T far = farthest(x.state.q, t.turning_runs, T(0));
  x.turned = any(beyond(far, T(S(simd::surely_within))) & ~beyond(far, T(largest_number<S>)));  // NaN has no turns
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

/// Writes the positions and angles of joints that turn for ever. Frozen lanes that are as they were loaded keep the
/// bits of both.
template <class T>
LOCKSTEP_INLINE void store_turns(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch,
                                 const Tile<T>& x) {
  const bool some_frozen = any(x.frozen);
  for (int i = 0; i < t.turning.count; ++i) {
    const int j = t.turning[i];
    const std::ptrdiff_t row = t.dof[j] * batch.stride;
    T angle = x.state.q[j], position = angle;
    if (x.turned || some_frozen) {
      const T turns = x.turned ? x.couplings.turns[j] : T(0);
      position = select(beyond(turns, T(0)), simd::position_of(simd::Turned<T>{angle, turns}), angle);
      const T before = T::load(batch.position + row), kept = T::load(batch.angle + row);
      const simd::Turned<T> loaded = simd::turned(before, kept);
      const auto differs = beyond(loaded.angle - angle, T(0)) | beyond(loaded.turns - turns, T(0));
      const auto keep = x.frozen & (~differs | ~beyond(before - position, T(0)));
      position = select(keep, before, position), angle = select(keep, kept, angle);
    }
    store(batch.position + row, position);
    store(batch.angle + row, angle);
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

/// Lanes in which a joint has completed a turn.
template <class T>
LOCKSTEP_INLINE typename T::Mask has_turned(const Tables<ScalarOf<T>>& t, const Tile<T>& x, const State<T>& next) {
  return beyond(farthest(next.q, t.turning_runs, T(0)), T(ScalarOf<T>(simd::most_angle))) & ~x.frozen;
}

template <class T>
int dof_with_most_turns(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int lane) {
  using S = ScalarOf<T>;
  int worst = t.turning[0];
  const auto turns_of = [&](int j) {
    const S turns = x.couplings.turns[j].lane(lane) + simd::whole_turns(x.next.q[j]).lane(lane);
    return turns < S(0) ? -turns : turns;
  };
  for (int i = 1; i < t.turning.count; ++i)
    if (!(turns_of(t.turning[i]) <= turns_of(worst))) worst = t.turning[i];
  return t.dof[worst];
}

/// Lanes whose turns cannot be counted, or whose angle is no number, keep their last state, with a fault.
template <class T>
void freeze_countless(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  using S = ScalarOf<T>;
  typename T::Mask countless = T::none();
  for (int i = 0; i < t.turning.count; ++i)
    countless = countless | beyond(x.couplings.turns[t.turning[i]] + simd::whole_turns(x.next.q[t.turning[i]]),
                                   T(simd::most_turns<S>));
  countless = countless & ~x.frozen;
  if (!any(countless)) return;
  const auto infinite = beyond(farthest(x.next.q, t.turning_runs, T(0)), T(largest_number<S>));
  for (int i = 0; i < T::lanes; ++i)
    if (lane(countless, i))
      set_fault(batch, x, i, lane(infinite, i) ? Fault::not_finite : Fault::diverged,
                {FaultStage::state, dof_with_most_turns(t, x, i)});
  each_part<T>(t, [&](T* State<T>::*part, int count) LOCKSTEP_INLINED {
    for (int i = 0; i < count; ++i) (x.next.*part)[i] = select(countless, (x.state.*part)[i], (x.next.*part)[i]);
  });
  x.frozen = x.frozen | countless;
}

/// Takes whole turns off the angles of `next`, after a step in which one of them has left [-pi, pi].
template <class T>
void take_turns(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x,
                const State<T>& next) {
  const auto turned = has_turned(t, x, next);
  if (!any(turned)) return;
  x.turned = true;
  set_consistent(t, x, false);
  for (int i = 0; i < t.turning.count; ++i) {
    const int j = t.turning[i];
    const auto over = beyond(next.q[j], T(ScalarOf<T>(simd::most_angle))) & turned;
    const T whole = select(over, simd::whole_turns(next.q[j]), T(0));
    next.q[j] = simd::without_turns(next.q[j], whole);
    x.couplings.turns[j] += whole;
  }
  offsets_with_turns(t, batch, x);
  place_turned_followers(t, batch, x, turned, next.q);
}

}  // namespace lockstep::kernels
