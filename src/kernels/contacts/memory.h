// What a step remembers of contacts: views of a batch do not show it, save points hold it. SPDX-License-Identifier:
// Apache-2.0
//
// Rows of an environment: for each slot its face, the tangential and the normal impulse; for those that resist turning
// the impulses of that; for each pair where its second collider is expected, and the axes of its impulses; for convex
// pairs how they were apart; the velocities at the start of the last step; the pieces that bounds and servos ended it
// on; its length, if the guard may take steps in halves; the state that all this belongs to; the count of steps that
// ended at a cap. An environment that was reset begins without memory: a state that is NaN says so. Where an
// application has written another state, impulses go on in contacts that still touch; nothing is expected of places,
// and nothing is guessed of velocities.
#pragma once

#include "place_collider.h"

namespace lockstep::kernels {

/// act(number, row) for the state's numbers, and places of colliders where these may differ.
template <class T, class Act>
LOCKSTEP_INLINE void each_state_row(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int row, Act&& act) {
  for (int j = 0; j < t.joints; ++j) act(x.state.q[j], row++);
  for (int k = 0; k < t.velocities; ++k) act(x.state.v[k], row++);
  for (int i = 0; i < 7 * t.roots.count; ++i) act(x.state.pose[i], row++);
  for (int i = 0; i < t.contacts.places(t); ++i) act(x.contacts.own_place[i], row++);
}

/// act(number) for what a slot remembers.
template <class S, class Slot, class Act>
LOCKSTEP_INLINE void each_kept(const ContactTables<S>&, Slot& slot, Act&& act) {
  const auto all = [&](auto&... numbers) LOCKSTEP_INLINED {
    static_assert(sizeof...(numbers) == ContactTables<S>::rows_of_slot);
    (act(numbers), ...);
  };
  all(slot.kept_face, slot.memory[0], slot.memory[1], slot.pressed);
}

/// act(number) for what a pair remembers.
template <class S, class Patch, class Act>
LOCKSTEP_INLINE void each_expected(const ContactTables<S>&, Patch& patch, Act&& act) {
  const auto all = [&](auto&... vectors) LOCKSTEP_INLINED {
    static_assert(3 * sizeof...(vectors) == ContactTables<S>::rows_of_pair);
    ((act(vectors[0]), act(vectors[1]), act(vectors[2])), ...);
  };
  all(patch.expected_place, patch.expected_axis, patch.expected_other_axis, patch.kept_normal, patch.kept_tangent);
}

/// act(number) for all that a tile remembers but the state that it belongs to and the count, in the order of the rows.
template <class S, class AnyTile, class Act>
LOCKSTEP_INLINE void each_remembered(const Tables<S>& t, AnyTile& x, Act&& act) {
  for (int s = 0; s < t.contacts.slots; ++s) each_kept(t.contacts, x.contacts.slot[s], act);
  for (int i = 0; i < t.contacts.turning_frictions; ++i)
    for (int k = 0; k < 3; ++k) act(x.contacts.turning_friction[i].memory[k]);
  for (int p = 0; p < t.contacts.pairs.count; ++p) each_expected(t.contacts, x.contacts.patch[p], act);
  for (int c = 0; c < t.contacts.convex; ++c) {
    for (int k = 0; k < 3; ++k) act(x.contacts.convex[c].normal[k]);
    for (int k = 0; k < 3; ++k) act(x.contacts.convex[c].corners[k]);
  }
  for (int k = 0; k < t.rounds.columns.n; ++k) act(x.contacts.previous[k]);
  for (int r = 0; r < t.bounds.single; ++r) act(x.contacts.piece[r]);
  for (int i = 0; i < t.limited_servos.count; ++i) act(x.contacts.saturation[i]);
  if (t.guarded) act(x.contacts.length);
}

template <class T>
void load_contacts(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  const ScalarOf<T>* const rows = batch.contact_memory;
  const auto number = [&](int row) LOCKSTEP_INLINED { return T::load(rows + row * batch.stride); };
  load_colliders(t, batch, x);
  int row = 0;
  each_remembered(t, x, [&](T& kept) LOCKSTEP_INLINED { kept = number(row++); });
  typename T::Mask other = T::none(), forgotten = T::none();
  each_state_row(t, x, row, [&](T now, int at) {
    const T before = number(at);
    other = other | beyond(now - before, T(0));
    forgotten = forgotten | beyond(before, T(largest_number<ScalarOf<T>>));
  });
  x.contacts.kept = ~forgotten;
  x.contacts.known = ~(other | forgotten);
  x.contacts.unfinished = number(t.contacts.remembered(t) - 1);
}

template <class T>
void store_contacts(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x) {
  ScalarOf<T>* const rows = batch.contact_memory;
  const auto put = [&](int row, T number) LOCKSTEP_INLINED { store(rows + row * batch.stride, number); };
  int row = 0;
  each_remembered(t, x, [&](const T& kept) LOCKSTEP_INLINED { put(row++, kept); });
  each_state_row(t, x, row, [&](T now, int at) { put(at, now); });
  put(t.contacts.remembered(t) - 1, x.contacts.unfinished);
}

template <class T>
void store_counts(const StatePointers<ScalarOf<T>>& batch, SolveCounts<T> counts) {
  ScalarOf<T>* row = batch.solve_counts;
  counts.each([&](const T& number) LOCKSTEP_INLINED {
    store(row, number);
    row += batch.stride;
  });
}

/// (M125): impulses of a step of another length become those of this one.
template <class T>
void scale_memory(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const auto lanes = x.contacts.kept & ~x.frozen;
  const T scale = select(lanes, T(t.step) / select(lanes, x.contacts.length, T(1)), T(1));
  for (int s = 0; s < t.contacts.slots; ++s) {
    ContactSlot<T>& slot = x.contacts.slot[s];
    slot.pressed *= scale, slot.memory[0] *= scale, slot.memory[1] *= scale;
  }
  for (int i = 0; i < t.contacts.turning_frictions; ++i) {
    TurningFriction<T>& turning = x.contacts.turning_friction[i];
    turning.memory = scaled(turning.memory, scale);
  }
}

}  // namespace lockstep::kernels
