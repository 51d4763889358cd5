// How fast contacts slide, which their normals see. SPDX-License-Identifier: Apache-2.0
//
// (M105), (M114). A solve assumes the slip of each slot. It is renewed from what the solve finds, until both agree.
#pragma once

#include "law.h"

namespace lockstep::kernels {

constexpr double slip_tolerance = 1e-5;     ///< m: by how much the slip of a step may differ from the one assumed
constexpr double most_slip_error = 2.4e-3;  ///< m/s: the same for short steps of a leapfrog, where errors add up
constexpr double most_slip_gain = 3.0;      ///< (M114), where the friction is at most 1
constexpr double most_slip_slope = 0.9;

/// Slips of the speeds at z.
template <class T>
void begin_slips(const Tables<ScalarOf<T>>& t, const T* z, Tile<T>& x) {
  slot_speeds(t, z, &ContactSlot<T>::speed, x);
  each_slot(t, x, [&](const auto& pair, const ContactPatch<T>& patch, ContactSlot<T>& slot) LOCKSTEP_INLINED {
    slot.slip = first_slip(t, patch.friction, sliding_speed(slot, turning_of(pair, slot, x)));
    slot.target = slot.bias + slot.slip;
  });
}

/// Recomputes the slip of all slots in the lanes of `open` in which it has changed by more than the tolerance: by a
/// secant (M114) where it has been renewed `before`. Returns them.
template <class T>
typename T::Mask renew_slips(const Tables<ScalarOf<T>>& t, typename T::Mask open, typename T::Mask before, Tile<T>& x) {
  using S = ScalarOf<T>;
  const T zero = T(0), one = T(1);
  const double tolerance = slip_tolerance / static_cast<double>(t.dt);
  const T allowed = T(S(t.solves_midpoint && tolerance > most_slip_error ? most_slip_error : tolerance));
  typename T::Mask differs = T::none();
  each_slot(t, x, [&](const auto& pair, const ContactPatch<T>& patch, ContactSlot<T>& slot) LOCKSTEP_INLINED {
    const T found = patch.friction * sliding_speed(slot, turning_of(pair, slot, x));
    // A slip that is too large lets a slot through that ought to press.
    auto acts = less(zero, slot.force.impulse[0]);
    const auto sinks = less(slot.speed[0] + slot.bias, -allowed) & slot.live;
    acts = acts | (t.solves_midpoint ? sinks : sinks & less(one, patch.friction));
    differs = differs | (less(allowed, absolute(found - slot.slip)) & acts & ~slot.given);
  });
  differs = differs & open;
  if (!any(differs)) return differs;
  each_slot(t, x, [&](const auto& pair, const ContactPatch<T>& patch, ContactSlot<T>& slot) LOCKSTEP_INLINED {
    TurningFriction<T>* const turning = turning_of(pair, slot, x);
    const T found = patch.friction * sliding_speed(slot, turning), assumed = slot.slip, step = found - assumed;
    const T moved = assumed - slot.slip_before;
    const auto comparable = before & less(zero, absolute(moved));
    const T slope = (found - slot.found_before) / select(comparable, moved, one);
    // Of one body that slides, what is found rises with what is assumed by mu^2 / (1 + mu^2).
    const T rises = fma(patch.friction, patch.friction, one);
    const auto rough = less(one, patch.friction);
    const T most = select(rough, T(S(2)) * rises, T(S(most_slip_gain)));
    const auto converges = comparable & less(slope, select(rough, one - one / most, T(S(most_slip_slope))));
    const T usual = select(rough, rises, one);
    const T gain = select(converges, smaller(one / select(converges, one - slope, one), most), usual);
    slot.slip_before = select(differs, assumed, slot.slip_before);
    slot.found_before = select(differs, found, slot.found_before);
    slot.slip = select(differs, larger(fma(gain, step, assumed), zero), assumed);
    slot.target = slot.bias + slot.slip;
    contact_force(patch.friction, slot, turning);
  });
  return differs;
}

}  // namespace lockstep::kernels
