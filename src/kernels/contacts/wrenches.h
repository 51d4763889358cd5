// Impulse and moment of each contact in a step, for those who record accelerations. SPDX-License-Identifier: Apache-2.0
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

/// The impulses of all solves of a step and their moments about the world's origin, for add_accelerations().
template <class T>
void clear_contact_impulses(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int c = 0; c < t.contacts.contacts.count; ++c)
    x.records.contact_force[c] = x.records.contact_moment[c] = Vec3<T>::zero();
}
template <class T>
void add_contact_impulses(const Tables<ScalarOf<T>>& t, typename T::Mask lanes, Tile<T>& x) {
  for (int c = 0; c < t.contacts.contacts.count; ++c) {
    Vec3<T>&sum = x.records.contact_force[c], &moment = x.records.contact_moment[c];
    each_slot_of(t, x, c,
                 [&](const auto& pair, const ContactPatch<T>& patch, const ContactSlot<T>& slot) LOCKSTEP_INLINED {
                   const auto acts = lanes & less(T(0), slot.pressed);  // elsewhere a point may be that of another tile
                   const Vec3<T> own = impulse_of_slot(patch, slot), turning = moment_of_slot(pair, patch, slot, x);
                   moment = select<T>(acts, cross_add(point_of_slot(patch, slot), own, moment + turning), moment);
                   sum = select<T>(acts, sum + own, sum);
                 });
  }
}

}  // namespace lockstep::kernels
