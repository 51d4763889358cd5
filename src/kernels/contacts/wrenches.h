// Impulse and moment of each contact in a step, for records. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "readback.h"

namespace lockstep::kernels {

/// act(pair, patch, slot) for all slots of a contact.
template <class T, class Act>
LOCKSTEP_INLINE void each_slot_of(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int contact, Act&& act) {
  const PairRange& pairs = t.contacts.contacts[contact];
  for (int p = pairs.first; p < pairs.last; ++p) {
    const TouchingPair<ScalarOf<T>>& pair = t.contacts.pairs[p];
    for (int s = pair.slot; s < pair.slot + pair.slots; ++s) act(pair, x.contacts.patch[p], x.contacts.slot[s]);
  }
}

/// The impulses of all solves of a step, which may be taken in parts; beside accelerations, their moments about the
/// world's origin.
template <class T>
void clear_contact_impulses(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int c = 0; c < t.contacts.contacts.count; ++c) {
    x.records.contact_force[c] = Vec3<T>::zero(), x.records.contact_pressed[c] = T(0);
    if (t.record_accelerations) x.records.contact_moment[c] = Vec3<T>::zero();
  }
}
template <class T>
void add_contact_impulses(const Tables<ScalarOf<T>>& t, typename T::Mask lanes, Tile<T>& x) {
  for (int c = 0; c < t.contacts.contacts.count; ++c) {
    each_slot_of(t, x, c,
                 [&](const auto& pair, const ContactPatch<T>& patch, const ContactSlot<T>& slot) LOCKSTEP_INLINED {
                   const auto acts = lanes & less(T(0), slot.pressed);  // elsewhere a point may be that of another tile
                   const Vec3<T> own = impulse_of_slot(patch, slot);
                   Vec3<T>& sum = x.records.contact_force[c];
                   sum = select<T>(acts, sum + own, sum);
                   x.records.contact_pressed[c] += select(acts, slot.pressed, T(0));
                   if (!t.record_accelerations) return;
                   Vec3<T>& moment = x.records.contact_moment[c];
                   const Vec3<T> turning = moment_of_slot(pair, patch, slot, x);
                   moment = select<T>(acts, cross_add(point_of_slot(patch, slot), own, moment + turning), moment);
                 });
  }
}

}  // namespace lockstep::kernels
