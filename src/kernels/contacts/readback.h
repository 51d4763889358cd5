// What users ask of contacts: points, normals, forces, gaps, slip. SPDX-License-Identifier: Apache-2.0
//
// Not part of a step. Shapes are those of the present state, impulses those that the last step left.
#pragma once

#include "collide.h"

namespace lockstep::kernels {

/// Numbers of one slot: point, normal, force on the second collider, gap, speed along the surface, all in the world.
/// The normal is that of the force where there is one.
constexpr int contact_numbers = 11;

/// Impulses times this are forces of the last step.
template <class T>
LOCKSTEP_INLINE T per_second(const Tables<ScalarOf<T>>& t, const Tile<T>& x) {
  return T(ScalarOf<T>(1)) / (t.guarded ? x.contacts.length : T(t.step));
}

/// v along the axes of the last step, in the world: the contact may have other ones by now, or be over.
template <class T>
LOCKSTEP_INLINE Vec3<T> along_kept_axes(const ContactPatch<T>& patch, const Vec3<T>& v) {
  const Vec3<T> other = cross(patch.kept_normal, patch.kept_tangent);
  return fma(patch.kept_normal, v.x, fma(patch.kept_tangent, v.y, scaled(other, v.z)));
}

/// What the last step has found.
template <class T>
LOCKSTEP_INLINE Vec3<T> impulse_of_slot(const ContactPatch<T>& patch, const ContactSlot<T>& slot) {
  return along_kept_axes(patch, {slot.pressed, slot.memory[0], slot.memory[1]});
}

/// Of friction that resists turning, about the slot.
template <class T>
LOCKSTEP_INLINE Vec3<T> moment_of_slot(const TouchingPair<ScalarOf<T>>& pair, const ContactPatch<T>& patch,
                                       const ContactSlot<T>& slot, const Tile<T>& x) {
  const TurningFriction<T>* const turning = turning_of(pair, slot, x);
  return turning ? along_kept_axes(patch, by_radii(pair, turning->memory)) : Vec3<T>::zero();
}

/// Where it acts, in the world, while the patch is as collide() has found it.
template <class T>
LOCKSTEP_INLINE Vec3<T> point_of_slot(const ContactPatch<T>& patch, const ContactSlot<T>& slot) {
  const Vec3<T>& v = slot.arm;
  return fma(patch.axes[0], v.x, fma(patch.axes[1], v.y, scaled(patch.axes[2], v.z))) + patch.point;
}

/// Of all slots of a tile that has been loaded; `numbers` has contact_numbers rows of T::lanes for each, and one row
/// behind them for the solves that ended at their cap. Normals are from the first collider to the second in the order
/// of PairKind.
template <class T>
void read_contacts(const Tables<ScalarOf<T>>& t, ScalarOf<T>* numbers, Tile<T>& x) {
  using S = ScalarOf<T>;
  const T none = T(S(__builtin_inf())), zero = T(0), share = per_second(t, x);

  // Contacts of the present state, in all lanes.
  x.frozen = T::none();
  kinematics(t, x);
  collide(t.midpoint ? *t.midpoint : t, x);
  for (int p = 0; p < t.contacts.pairs.count; ++p) {
    const TouchingPair<S>& pair = t.contacts.pairs[p];
    const ContactPatch<T>& patch = x.contacts.patch[p];
    const bool near = any(patch.near);
    const int bodies[2] = {t.contacts.colliders[pair.first].body, t.contacts.colliders[pair.second].body};
    const bool parts = pair.slots == 1 && bodies[0] >= 0 && bodies[1] >= 0;
    for (int s = 0; s < pair.slots; ++s) {
      const ContactSlot<T>& slot = x.contacts.slot[pair.slot + s];
      S* row = numbers + (pair.slot + s) * contact_numbers * T::lanes;
      const auto put = [&](T number) LOCKSTEP_INLINED {
        store(row, number);
        row += T::lanes;
      };
      const auto put_vector = [&](const Vec3<T>& v) LOCKSTEP_INLINED {
        for (int k = 0; k < 3; ++k) put(select(slot.live, v[k], zero));
      };
      const auto pressed = x.contacts.kept & less(zero, slot.pressed);
      const Vec3<T> impulse = impulse_of_slot(patch, slot);
      const auto put_force = [&] {
        const Vec3<T> force = select<T>(pressed, scaled(impulse, share), Vec3<T>::zero());
        for (int k = 0; k < 3; ++k) put(force[k]);
      };
      const auto put_normal = [&](const Vec3<T>& now) {
        const Vec3<T> normal = select<T>(pressed, patch.kept_normal, now);
        for (int k = 0; k < 3; ++k) put(normal[k]);
      };

      // Where no lane is near, only what the step has found.
      if (!near) {
        for (int k = 0; k < 3; ++k) put(zero);
        put_normal(Vec3<T>::zero());
        put_force();
        put(none), put(zero);
        continue;
      }

      // The point, and the motion along the surface there. Two moving bodies with one slot have a point each (M102).
      const Vec3<T> point = point_of_slot(patch, slot);
      const Vec3<T> to_end = scaled(patch.axes[0], T(S(parts ? 0.5 : 0.0)) * slot.gap);
      const Vec3<T> moves = x.contacts.collider[pair.second].velocity_at(point + to_end) -
                            x.contacts.collider[pair.first].velocity_at(point - to_end),
                    along = fma(patch.axes[0], -dot(moves, patch.axes[0]), moves);
      put_vector(point);
      put_normal(select<T>(slot.live, patch.axes[0], Vec3<T>::zero()));
      put_force();
      put(select(slot.live, slot.gap, none));
      put(select(slot.live, sqrt(dot(along, along)), zero));
    }
  }
  store(numbers + t.contacts.slots * contact_numbers * T::lanes, x.contacts.unfinished);
}

}  // namespace lockstep::kernels
