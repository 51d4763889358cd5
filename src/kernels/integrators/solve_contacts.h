// Contacts in a step: found, solved together with the bounds, remembered. SPDX-License-Identifier: Apache-2.0
//
// Section 23. Lanes in which a contact has pressed in the step before are solved by newton.h. In the others, lanes in
// which some slot would act at the result of the step without contacts are solved again, and the rest keep theirs to
// the last bit. Slip passes (M105) let the normals see how fast contacts slide. The first solve moves the positions. A
// second one, for the velocity that stays, runs in lanes that push an overlap out, stop an impact or whose bounds ask
// for it; a third one gives back what impacts restore (M109).

#pragma once

#include "contact_energy.h"
#include "kernels/contacts/collide.h"
#include "kernels/contacts/pieces.h"
#include "solve_rounds.h"

namespace lockstep::kernels {

constexpr double most_let_through = 1.01;  ///< (M109): of what the compliance lets through while an impact is stopped

/// Newton and slip passes from x.rounds.z, which becomes the solution.
template <class T>
void solve_contact_phase(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Phase phase,
                         typename T::Mask open, Tile<T>& x) {
  open_row_slots(t, batch, phase, x);
  if (phase == velocity_phase) exchange_phases(t, x);
  begin_newton(t, batch, open, x);
  typename T::Mask unfinished = T::none();
  const auto open_first = open;
  if (t.method == Method::pgs) {
    const bool first = phase == position_phase;
    unfinished = sweep(t, batch, first ? t.iterations : t.velocity_iterations, first, open, x);
    open = T::none();
  }
  if (any(open)) {
    begin_on_pieces(t, phase == position_phase ? open & x.contacts.known : open, x);
    x.counts.passes += select(open, T(1), T(0));
    unfinished = newton(t, batch, open, t.contacts.passes, x);
    if (phase == position_phase) keep_pieces(t, open, x);
  }
  clamp_unfinished(t, unfinished, x);
  if (phase == velocity_phase) exchange_phases(t, x);
  keep_impulses(t, phase, open_first, x);
  x.contacts.unfinished += select(unfinished, T(1), T(0));
}

/// Prepares the second solve, for the velocity that stays (M109). Returns its lanes: those of `asked`, and those in
/// which a slot stops an impact or removes an overlap fast. What overlaps or bounces has no target for the gap there,
/// so that no speed of a push-out stays. Soft pairs keep theirs: it is their force.
template <class T>
typename T::Mask begin_relaxing(const Tables<ScalarOf<T>>& t, typename T::Mask open, typename T::Mask asked,
                                Tile<T>& x) {
  const T zero = T(0);
  typename T::Mask lanes = asked;
  each_slot(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>& slot) LOCKSTEP_INLINED {
    const auto pushed = less(zero, slot.force.impulse[0]) & less(slot.bias, -slot.slow);
    lanes = lanes | slot.bounces | (pair.soft ? T::none() : slot.live & pushed);
  });
  lanes = lanes & open;
  if (!any(lanes)) return lanes;
  each_slot(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>& slot) LOCKSTEP_INLINED {
    const auto overlaps = pair.soft ? T::none() : ~less(zero, slot.gap) & ~slot.bounces;
    slot.push = select(lanes & overlaps, smaller(slot.load, slot.force.impulse[0]), zero);
    slot.bias = select(lanes & (overlaps | slot.bounces), zero, slot.bias);
    slot.target = slot.bias + slot.slip;
    slot.relaxes = lanes;
    const auto goes_on = slot.goes_on & ~slot.bounces;
    for (int i = 0; i < 2; ++i) {
      const T begins = pair.soft ? slot.carried[i] : slot.force.impulse[1 + i];
      slot.carried[i] = select(lanes, select(goes_on, begins, zero), slot.carried[i]);
    }
    if (TurningFriction<T>* const turning = turning_of(pair, slot, x)) {
      const Vec3<T>& begins = pair.soft ? turning->carried : turning->force.impulse;
      turning->carried = select<T>(lanes, select<T>(goes_on, begins, Vec3<T>::zero()), turning->carried);
    }
  });
  return lanes;
}

/// Gives what bounces the normal impulse that stops it and the restored share of that, (M109) and (M115). Returns the
/// lanes in which something comes back. Impulses are those remembered and speeds are renewed: a repeated solve has
/// evaluated them beside its lanes.
template <class T>
typename T::Mask begin_restoring(const Tables<ScalarOf<T>>& t, typename T::Mask open, Tile<T>& x) {
  using S = ScalarOf<T>;
  const T zero = T(0);
  typename T::Mask lanes = T::none();
  each_slot(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>& slot) LOCKSTEP_INLINED {
    if (!pair.bounces) return;
    lanes = lanes | (slot.bounces & less(zero, slot.restored) & less(zero, slot.pressed));
  });
  lanes = lanes & open;
  if (!any(lanes)) return lanes;
  slot_speeds(t, x.rounds.z, &ContactSlot<T>::speed, x);
  each_slot(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>& slot) LOCKSTEP_INLINED {
    if (!pair.bounces) return;
    const T arrives = larger(absolute(slot.free[0]), T(S(1e-6)));
    const T stopped = larger(arrives + smaller(slot.speed[0], zero), arrives * T(S(1 / most_let_through)));
    slot.given = lanes & slot.bounces;
    slot.stopping = select(slot.given, slot.pressed * (arrives / stopped), zero);
    slot.normal = fma(slot.restored, slot.stopping, slot.stopping);
  });
  return lanes;
}

/// What the next step is to know of this one: the impulses of the first solve, and where that moves the pairs.
template <class T>
void remember(const Tables<ScalarOf<T>>& t, typename T::Mask acting, Tile<T>& x) {
  forget_pieces(t, ~(acting | x.frozen), x);
  each_near(t, x, [&](const auto& pair, ContactPatch<T>& patch, const LiveSlots<T>& slots) LOCKSTEP_INLINED {
    auto lanes = T::none();
    for (const ContactSlot<T>& slot : slots) lanes = lanes | slot.live;
    lanes = lanes & acting & ~x.frozen;
    expect(t, pair, x.rounds.z, lanes, patch, x);
    patch.kept_normal = select<T>(lanes, patch.axes[0], patch.kept_normal);
    patch.kept_tangent = select<T>(lanes, patch.axes[1], patch.kept_tangent);
  });
  for (int s = 0; s < t.contacts.slots; ++s) {
    ContactSlot<T>& slot = x.contacts.slot[s];
    const auto acts = slot.live & acting;
    const auto keep = [&](T& kept, T now) LOCKSTEP_INLINED { kept = select(x.frozen, kept, select(acts, now, T(0))); };
    keep(slot.pressed, slot.force.impulse[0]);
    x.counts.pressing += select(acts & less(T(0), slot.pressed), T(1), T(0));
    keep(slot.memory[0], slot.force.impulse[1]), keep(slot.memory[1], slot.force.impulse[2]);
    keep(slot.kept_face, slot.face);
  }
  each_turning(t, x, [&](const ContactSlot<T>& slot, TurningFriction<T>& turning) LOCKSTEP_INLINED {
    const Vec3<T> now = select<T>(slot.live & acting, turning.force.impulse, Vec3<T>::zero());
    turning.memory = select<T>(x.frozen, turning.memory, now);
  });
}

/// The impulses of a later solve in its lanes alone: the others have been evaluated beside them, and differ by
/// rounding.
template <class T>
void remember_impulses(const Tables<ScalarOf<T>>& t, typename T::Mask lanes, Tile<T>& x) {
  for (int s = 0; s < t.contacts.slots; ++s) {
    ContactSlot<T>& slot = x.contacts.slot[s];
    const auto acts = slot.live & lanes;
    slot.pressed = select(acts, slot.force.impulse[0], slot.pressed);
    for (int i = 0; i < 2; ++i) slot.memory[i] = select(acts, slot.force.impulse[1 + i], slot.memory[i]);
  }
  each_turning(t, x, [&](const ContactSlot<T>& slot, TurningFriction<T>& turning) LOCKSTEP_INLINED {
    turning.memory = select<T>(slot.live & lanes, turning.force.impulse, turning.memory);
  });
}

/// The third solve, in lanes of `again` in which an impact gives something back (M109).
template <class T>
void restore_impacts(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, typename T::Mask again,
                     Tile<T>& x) {
  auto open = begin_restoring(t, again, x);
  for (int trial = 0; any(open); ++trial) {
    solve_contact_phase(t, batch, velocity_phase, open, x);
    remember_impulses(t, open, x);
    if (trial == 2) break;
    open = gains_energy(t, open, x);
    if (any(open)) restore_less(t, open, trial == 1, x);
  }
}

/// Both solves with contacts, from the matrix and the momenta of the rounds, in the lanes `acting`. Their results are
/// x.dynamics.solution, which moves the positions, and x.dynamics.velocity_solution, which stays.
template <class T>
void solve_contacts(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, typename T::Mask acting,
                    Tile<T>& x) {
  const T two = T(2);
  for (int k = 0; k < t.rounds.columns.n; ++k)
    x.rounds.z[k] = select(x.contacts.known, fma(two, x.held.start[k], -x.contacts.previous[k]), x.held.start[k]);
  begin_slips(t, x.rounds.z, x);

  // The speed that moves the positions.
  solve_contact_phase(t, batch, position_phase, acting, x);
  from_rounds(t, x.rounds.z, x.dynamics.solution);
  remember(t, acting, x);
  if (t.audited) x.contacts.work += work_of_push_outs(t, acting, x);
  if (!x.solves_twice) return;

  // The speed that stays.
  keep_impulses(t, velocity_phase, acting, x);
  const auto asked = rows_with_two_phases(t, x) | lanes_with_two_phases(t, batch, x) | push_ahead(t, acting, 1.0, x);
  const auto again = begin_relaxing(t, acting, asked, x);
  if (any(again)) {
    x.servos.corrected = false;
    solve_contact_phase(t, batch, velocity_phase, again, x);
    remember_impulses(t, again, x);
    const auto adding = push_ahead(t, again, carried_above, x) | pushes_along(t, again, x);
    if (any(adding)) {
      forget_impulses(t, adding, x);
      solve_contact_phase(t, batch, velocity_phase, adding, x);
      remember_impulses(t, adding, x);
    }
    if (t.contacts.bounces) restore_impacts(t, batch, again, x);
    const auto pushing = pushes_along(t, again, x);
    if (any(pushing)) keep_energy(t, batch, pushing, x);
  }
  from_rounds(t, x.rounds.z, x.dynamics.velocity_solution);
}

/// The law of all slots at the start of a solve. `free` are the velocities without contacts if they are `known`.
/// Returns the lanes in which some slot acts at these.
template <class T>
typename T::Mask open_contacts(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const T* free,
                               bool known, Tile<T>& x) {
  typename T::Mask acting = T::none();
  const ScalarOf<T>* const frictions = batch.field(Parameter::contact_friction);
  const ScalarOf<T>* const restitutions = batch.field(Parameter::contact_restitution);
  each_near(t, x, [&](const auto& pair, ContactPatch<T>& patch, const LiveSlots<T>& slots) LOCKSTEP_INLINED {
    const std::ptrdiff_t row = pair.contact * batch.stride;
    patch.friction = frictions ? T::load(frictions + row) : T(pair.friction);
    patch.restitution = restitutions ? T::load(restitutions + row) : T(pair.restitution);
    const RelativeTwist<T> start = twist_of(t, pair, x, x.held.start);
    const RelativeTwist<T> without = known ? twist_of(t, pair, x, free) : start;
    const PairResponse<T> response(t, pair, x);
    for (ContactSlot<T>& slot : slots) {
      slot_speed(slot, without, slot.free);
      if (t.solves_midpoint && pair.bounces) slot_speed(slot, twist_of(t, pair, x, x.midpoint.end), slot.speed);
      TurningFriction<T>* const turning = turning_of(pair, slot, x);
      begin_slot(t, pair, patch, start, response, slot, turning);
      if (!known) continue;
      if (turning) turning->free = by_radii(pair, without.turning);
      contact_force(slot, turning, patch.friction, slot.free, turning ? turning->free : Vec3<T>::zero(), slot.force,
                    turning ? &turning->force : nullptr);
      acting = acting | slot.force.sticks | slot.force.slides;
    }
  });
  return acting;
}

/// The velocities that the step began with, from which the next one guesses.
template <class T>
void remember_start(const Tables<ScalarOf<T>>& t, const T* start, Tile<T>& x) {
  for (int k = 0; k < t.rounds.columns.n; ++k)
    x.contacts.previous[k] = select(x.frozen, x.contacts.previous[k], start[k]);
  x.contacts.kept = x.contacts.known = ~T::none();
}

/// Turns them to the axes that the roots have now.
template <class T>
void turn_start(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int r = 0; r < t.roots.count; ++r) {
    T* const twist = x.contacts.previous + t.rounds.place[t.roots[r].solver];
    T turned[6];
    for (int k = 0; k < 6; ++k) turned[k] = twist[k];
    turn_root_twist(x.half_turn + 4 * r, turned);
    for (int k = 0; k < 6; ++k) twist[k] = select(x.frozen, twist[k], turned[k]);
  }
}

/// Finds contacts. Returns whether all lanes are solved with them at once, so that nothing asks for the step without.
/// A rebound asks for it.
template <class T>
bool find_contacts(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const auto held = collide(t, x);
  x.contacts.held = t.contacts.bounces ? T::none() : held;
  x.contacts.work = T(0);
  return !any(~(x.contacts.held | x.frozen));
}

/// Solves the step of euler with contacts in lanes where one acts. `solved` says whether the step without has been.
template <class T>
void touch(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, bool solved, Tile<T>& x) {
  if (solved) to_rounds(t, x.dynamics.solution, x.rounds.z);
  matrix_of_bodies(t, x);
  auto acting = open_contacts(t, batch, x.rounds.z, solved, x);
  acting = ((acting & ~x.singular) | x.contacts.held) & ~x.frozen;
  if (any(acting)) {
    begin_rounds(t, batch, x);
    const bool some_free = any(~(acting | x.frozen));
    T* kept = x.rounds.unbounded_result;
    if (some_free) each_result(t, x, [&](const T& number) { *kept++ = number; });
    solve_contacts(t, batch, acting, x);
    x.singular = (x.singular & ~x.contacts.held) | (x.rounds.weak & x.contacts.held);
    list_active_rows_of(t, acting, x);
    integrate(t, x);
    const T* restored = x.rounds.unbounded_result;
    if (some_free) each_result(t, x, [&](T& number) { number = select(acting, number, *restored++); });
    if (t.bounds.rows.count > 0) mark_invalid(t, x);
  } else {
    remember(t, T::none(), x);
  }
  remember_start(t, x.held.start, x);
  turn_start(t, x);
}

}  // namespace lockstep::kernels
