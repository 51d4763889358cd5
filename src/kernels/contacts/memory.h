// What a step remembers of contacts: views of a batch do not show it, save points hold it. SPDX-License-Identifier:
// Apache-2.0
//
// Rows of an environment: for each slot its face, the tangential and the normal impulse; for each pair where its second
// collider is expected, and the axes of its impulses; the velocities at the start of the last step; the state that all
// this belongs to; the count of steps that ended at a cap. An environment whose state is another one, because an
// application wrote to it or reset it, begins without memory.
#pragma once

#include "kernels/tile/tile.h"

namespace lockstep::kernels {

/// act(number, row) for the state's numbers.
template <class T, class Act>
LOCKSTEP_INLINE void each_state_row(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int row, Act&& act) {
  for (int j = 0; j < t.joints; ++j) act(x.state.q[j], row++);
  for (int k = 0; k < t.velocities; ++k) act(x.state.v[k], row++);
  for (int i = 0; i < 7 * t.roots.count; ++i) act(x.state.pose[i], row++);
}

/// act(number) for what a pair remembers.
template <class Patch, class Act>
LOCKSTEP_INLINE void each_expected(Patch& patch, Act&& act) {
  for (int k = 0; k < 3; ++k) act(patch.expected_place[k]);
  for (int k = 0; k < 3; ++k) act(patch.expected_axis[k]);
  for (int k = 0; k < 3; ++k) act(patch.expected_other_axis[k]);
  for (int k = 0; k < 3; ++k) act(patch.kept_normal[k]);
  for (int k = 0; k < 3; ++k) act(patch.kept_tangent[k]);
}

template <class T>
void load_contacts(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  const ScalarOf<T>* const rows = batch.contact_memory;
  const auto number = [&](int row) LOCKSTEP_INLINED { return T::load(rows + row * batch.stride); };
  int row = 0;
  for (int s = 0; s < t.contacts.slots; ++s, row += 4) {
    ContactSlot<T>& slot = x.contacts.slot[s];
    slot.kept_face = number(row), slot.memory[0] = number(row + 1), slot.memory[1] = number(row + 2);
    slot.pressed = number(row + 3);
  }
  for (int p = 0; p < t.contacts.pairs.count; ++p)
    each_expected(x.contacts.patch[p], [&](T& kept) { kept = number(row++); });
  for (int k = 0; k < t.solver.n; ++k) x.contacts.previous[k] = number(row++);
  typename T::Mask other = T::none();
  each_state_row(t, x, row, [&](T now, int at) { other = other | beyond(now - number(at), T(0)); });
  x.contacts.known = ~other;
  x.contacts.unfinished = number(t.contacts.remembered(t) - 1);
}

template <class T>
void store_contacts(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x) {
  ScalarOf<T>* const rows = batch.contact_memory;
  const auto put = [&](int row, T number) LOCKSTEP_INLINED { store(rows + row * batch.stride, number); };
  int row = 0;
  for (int s = 0; s < t.contacts.slots; ++s, row += 4) {
    const ContactSlot<T>& slot = x.contacts.slot[s];
    put(row, slot.kept_face), put(row + 1, slot.memory[0]), put(row + 2, slot.memory[1]), put(row + 3, slot.pressed);
  }
  for (int p = 0; p < t.contacts.pairs.count; ++p)
    each_expected(x.contacts.patch[p], [&](const T& kept) { put(row++, kept); });
  for (int k = 0; k < t.solver.n; ++k) put(row++, x.contacts.previous[k]);
  each_state_row(t, x, row, [&](T now, int at) { put(at, now); });
  put(t.contacts.remembered(t) - 1, x.contacts.unfinished);
}

}  // namespace lockstep::kernels
