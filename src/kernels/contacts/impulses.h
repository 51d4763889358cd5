// What the contacts of a step did: their impulses on all velocities, and their work. SPDX-License-Identifier:
// Apache-2.0
#pragma once

#include "assembly.h"
#include "kernels/dynamics/wrench.h"

namespace lockstep::kernels {

/// Subtracts J^T of the last solve's impulses from `sum`, over all velocities. Each body takes them at its own surface
/// where find_columns() does.
template <class T>
void subtract_contacts(const Tables<ScalarOf<T>>& t, const Tile<T>& x, T* sum) {
  using S = ScalarOf<T>;
  for (int p = 0; p < t.contacts.pairs.count; ++p) {
    const TouchingPair<S>& pair = t.contacts.pairs[p];
    const ContactPatch<T>& patch = x.contacts.patch[p];
    if (!any(patch.near)) continue;
    const int first = t.contacts.colliders[pair.first].body, second = t.contacts.colliders[pair.second].body;
    const bool parts = pair.slots == 1 && first >= 0 && second >= 0;
    const auto in_world = [&](const Vec3<T>& v) LOCKSTEP_INLINED {
      return fma(patch.axes[0], v.x, fma(patch.axes[1], v.y, scaled(patch.axes[2], v.z)));
    };
    for (int s = pair.slot; s < pair.slot + pair.slots; ++s) {
      const ContactSlot<T>& slot = x.contacts.slot[s];
      const auto acts = patch.near & slot.live;
      const Vec3<T> impulse =
          select<T>(acts, in_world({slot.pressed, slot.memory[0], slot.memory[1]}), Vec3<T>::zero());
      const Vec3<T> point = select<T>(acts, patch.point + in_world(slot.arm), Vec3<T>::zero());
      const Vec3<T> to_end = scaled(patch.axes[0], select(acts, T(S(parts ? 0.5 : 0.0)) * slot.gap, T(0)));
      Vec3<T> moment = Vec3<T>::zero();
      if (pair.turning_friction >= 0) {
        const Vec3<T>& rows = x.contacts.turning_friction[pair.turning_friction + s - pair.slot].memory;
        moment = select<T>(acts, in_world(by_radii(pair, rows)), moment);
      }
      subtract_impulse(t, x.contacts.motion, second, point + to_end, impulse, moment, sum);
      subtract_impulse(t, x.contacts.motion, first, point - to_end, impulse - scaled(impulse, T(S(2))),
                       moment - scaled(moment, T(S(2))), sum);
    }
  }
}

/// (M65): what contacts do at the speeds z that stay: `work` by soft pairs and by what pushes, `dissipated` by
/// friction.
template <class T>
void add_contact_work(const Tables<ScalarOf<T>>& t, const T* z, Tile<T>& x, T& work, T& dissipated) {
  const T zero = T(0);
  slot_speeds(t, z, &ContactSlot<T>::change, x);
  each_slot(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>& slot) LOCKSTEP_INLINED {
    const T normal = slot.pressed * slot.change[0];
    T along = fma(slot.memory[0], slot.change[1], slot.memory[1] * slot.change[2]);
    if (const TurningFriction<T>* const turning = turning_of(pair, slot, x))
      along += dot(turning->memory, turning->change);
    work += select(slot.live, pair.soft ? normal : larger(normal, zero), zero);
    dissipated -= select(slot.live, along, zero);
  });
}

}  // namespace lockstep::kernels
