// The check before the state changes: an environment that fails keeps its last good state; joints that turn for ever
// lose their whole turns.
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/bounds/intervals.h"
#include "kernels/couplings/spatial_tendons.h"
#include "kernels/couplings/tendons.h"
#include "kernels/couplings/turns.h"

namespace lockstep::kernels {

/// Whether the audit (M94) has found too much energy from nowhere.
template <class T>
bool gains_energy(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int lane) {
  return t.audited && x.audit.state->gained.lane(lane) > t.most_gain * x.audit.state->most.lane(lane);
}

/// The farthest position of a joint that does not turn for ever, or number of a floating root's pose.
template <class T>
LOCKSTEP_INLINE T farthest_position(const Tables<ScalarOf<T>>& t, const Tile<T>& x) {
  T most = farthest(x.next.pose, 7 * t.roots.count, T(0));
  return t.turning.count == 0 ? farthest(x.next.q, t.joints, most) : farthest(x.next.q, t.other_runs, most);
}

/// (M182): whether spatial tendon i, beyond its hard range, would get still farther out.
template <class T>
LOCKSTEP_INLINE typename T::Mask runs_away(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch,
                                           const Tile<T>& x, int i) {
  using S = ScalarOf<T>;
  const int j = t.spatial.tendons[i].joint;
  if (t.bounds.rows.count == 0 || !(t.bounds.has[j] & has_range)) return T::none();
  const Interval<T> range = position_limits<T>(t, batch, j);
  const T before = x.state.q[j], after = x.next.q[j], length = larger(before, after);
  const T over = larger(range.lo - after, after - range.hi), was_over = larger(range.lo - before, before - range.hi);
  return less(T(S(0.1)) * length, over) & less(fma(T(S(1e-5)), length, was_over), over);
}

/// Whether spatial tendon i would move as none can.
template <class T>
LOCKSTEP_INLINE typename T::Mask strays(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch,
                                        const Tile<T>& x, int i) {
  return leaps(t, x, i) | runs_away(t, batch, x, i);
}

/// The dof to blame: a number beyond its bound, or else a spatial tendon that strays.
template <class T>
int diverged_dof(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x,
                 const State<T>& state, int place) {
  int dof = dof_beyond(t, state, place);
  for (int i = 0; i < t.spatial.tendons.count && dof < 0; ++i)
    if (lane(strays(t, batch, x, i), place)) dof = t.dof[t.spatial.tendons[i].joint];
  return dof;
}

/// Sets the fault of lanes that have just failed. A matrix that cannot be factored comes first,
/// because it explains any numbers that follow from it.
template <class T>
void flag(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x,
          typename T::Mask failed) {
  const T farthest_number = farthest(x.next.v, t.velocities, farthest_position(t, x));
  const typename T::Mask infinite = beyond(farthest_number, T(largest_number<ScalarOf<T>>));
  const typename T::Mask slow = ~beyond(farthest(x.next.v, t.velocities, farthest_position(t, x)),
                                        T(t.velocity_bound < t.position_bound ? t.velocity_bound : t.position_bound));
  // Stages overflow where a start is beyond its bound. That is the cause then.
  const T start = farthest(x.state.v, t.velocities, T(0));
  const typename T::Mask began_beyond =
      t.integrator == Integrator::euler
          ? T::none()
          : beyond(start, T(t.velocity_bound)) & ~beyond(start, T(largest_number<ScalarOf<T>>));
  for (int i = 0; i < T::lanes; ++i) {
    if (!lane(failed, i)) continue;
    if (lane(x.singular, i) && !lane(began_beyond, i))
      set_fault(batch, x, i, Fault::singular, {FaultStage::matrix, -1});
    else if (lane(infinite, i) && !lane(began_beyond, i))
      set_fault(batch, x, i, Fault::not_finite, {FaultStage::state, dof_beyond(t, x.next, i)});
    else if (lane(x.too_fast, i) && lane(slow, i) && !lane(began_beyond, i))
      set_fault(batch, x, i, Fault::too_fast,
                {gains_energy(t, x, i) ? FaultStage::energy : FaultStage::guard, fastest_dof(t, x.state, i)});
    else
      set_fault(batch, x, i, Fault::diverged,
                {FaultStage::state, diverged_dof(t, batch, x, lane(began_beyond, i) ? x.state : x.next, i)});
  }
}

/// Flags the lanes that have just failed. Frozen lanes get back the state in which the step began. Returns whether a
/// joint of another lane has completed a turn.
template <class T>
LOCKSTEP_INLINE bool hold_frozen(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x,
                                 typename T::Mask failed) {
  if (any(failed)) flag(t, batch, x, failed);
  each_part<T>(t, [&](T* State<T>::*part, int count) LOCKSTEP_INLINED {
    for (int i = 0; i < count; ++i) (x.next.*part)[i] = select(x.frozen, (x.state.*part)[i], (x.next.*part)[i]);
  });
  if (t.turning.count == 0 || !any(has_turned(t, x, x.next))) return false;
  freeze_countless(t, batch, x);
  return true;
}

/// The same, and in the other lanes joints lose their whole turns.
template <class T>
void hold(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x, typename T::Mask failed) {
  if (!hold_frozen(t, batch, x, failed)) return;
  take_turns(t, batch, x, x.next);
  if (t.audited) x.audit.state->known = T::none();
}

template <class T>
LOCKSTEP_INLINE void hold_if(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x,
                             typename T::Mask held, typename T::Mask failed) {
  if (any(held)) hold(t, batch, x, failed);
}

/// Freezes lanes that failed, and moves the others to their new state.
template <class T>
void check(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  if (x.routines.code && t.velocities > 0) {  // the tables multiply NaN by 0 and find NaN
    T& last = x.next.v[t.velocities - 1];
    last = select(beyond(x.unread_inputs, T(largest_number<float>)), x.unread_inputs, last);
  }
  const auto far = beyond(farthest_position(t, x), T(t.position_bound));
  const auto fast = beyond(farthest(x.next.v, t.velocities, T(0)), T(t.velocity_bound));
  typename T::Mask failed = x.singular | far | fast;
  if (t.guarded || t.audited) failed = failed | x.too_fast;
  for (int i = 0; i < t.spatial.tendons.count; ++i) failed = failed | strays(t, batch, x, i);
  failed = failed & ~x.frozen;
  x.frozen = x.frozen | failed;
  typename T::Mask held = x.frozen;
  if (t.turning.count > 0) held = held | has_turned(t, x, x.next);
  hold_if(t, batch, x, held, failed);

  copy_state(t, x.next, x.state);
  if (t.tendons.count > 0) put_back_tendons(t, x);
}

}  // namespace lockstep::kernels
