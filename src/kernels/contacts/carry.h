// Friction's memory from step to step: a pair keeps it while slots come and go. SPDX-License-Identifier: Apache-2.0
//
// Corners of two faces appear, merge and change places by rounding while a hand turns. If each slot had its memory for
// itself, what such a slot held would be lost, and a held object would creep by a little each time.
#pragma once

#include "shapes.h"

namespace lockstep::kernels {

/// Gives the slots the tangential impulses that they start from. Slots that go on keep theirs, along the axes of the
/// contact, which moved with the bodies, or turned to the present ones if it is another point or face. What slots had
/// that have ended is shared by those that go on. Returns the lanes in which some slot goes on.
template <class T>
typename T::Mask carry_memory(int count, typename T::Mask kept, const ContactPatch<T>& patch, ContactSlot<T>* slots,
                              TurningFriction<T>* turning) {
  const T zero = T(0), one = T(1);
  const Vec3<T> other = cross(patch.kept_normal, patch.kept_tangent);
  T turn[2][2];
  for (int i = 0; i < 2; ++i)
    turn[i][0] = dot(patch.axes[1 + i], patch.kept_tangent), turn[i][1] = dot(patch.axes[1 + i], other);
  typename T::Mask held = T::none();
  T lost[2] = {zero, zero}, going_on = zero;
  Vec3<T> lost_turning = Vec3<T>::zero();
  for (int s = 0; s < count; ++s) {
    ContactSlot<T>& slot = slots[s];
    const auto pressed = kept & less(zero, slot.pressed),
               turned = less(slot.face, slot.kept_face) | less(slot.kept_face, slot.face);
    slot.goes_on = pressed & slot.live;
    held = held | slot.goes_on;
    going_on += select(slot.goes_on, one, zero);
    for (int i = 0; i < 2; ++i) {
      const T along = select(turned, fma(turn[i][0], slot.memory[0], turn[i][1] * slot.memory[1]), slot.memory[i]);
      slot.carried[i] = select(slot.goes_on, along, zero);
      lost[i] += select(pressed & ~slot.live, along, zero);
    }
    if (!turning) continue;
    Vec3<T> rows = turning[s].memory;
    for (int i = 0; i < 2; ++i)
      rows[1 + i] = select(turned, fma(turn[i][0], turning[s].memory.y, turn[i][1] * turning[s].memory.z), rows[1 + i]);
    turning[s].carried = select<T>(slot.goes_on, rows, Vec3<T>::zero());
    lost_turning = lost_turning + select<T>(pressed & ~slot.live, rows, Vec3<T>::zero());
  }
  const T share = one / larger(going_on, one);
  for (int s = 0; s < count; ++s)
    for (int i = 0; i < 2; ++i)
      slots[s].carried[i] = select(slots[s].goes_on, fma(share, lost[i], slots[s].carried[i]), zero);
  for (int s = 0; turning && s < count; ++s)
    turning[s].carried = select<T>(slots[s].goes_on, fma(lost_turning, share, turning[s].carried), Vec3<T>::zero());
  return held;
}

}  // namespace lockstep::kernels
