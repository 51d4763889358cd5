// Contacts in a step: found, solved together with the bounds, remembered. SPDX-License-Identifier: Apache-2.0
//
// Section 23. Lanes in which a contact has pressed in the step before are solved by newton.h. In the others, lanes in
// which some slot would act at the result of the step without contacts are solved again, and the rest keep theirs to
// the last bit. Slip passes (M105) let the normals see how fast contacts slide. A second solve, for the velocity that
// stays, runs in lanes that push an overlap out or whose bounds ask for it.
#pragma once

#include "kernels/contacts/collide.h"
#include "kernels/contacts/newton.h"
#include "solve_bounds.h"

namespace lockstep::kernels {

constexpr double stiffer_bounce = 100.0;
constexpr double slip_tolerance = 1e-5;  ///< m: by how much the slip of a step may differ from the one assumed

/// Recomputes the slip of all slots. Returns the lanes in which it has changed by more than the tolerance.
template <class T>
typename T::Mask renew_slips(const Tables<ScalarOf<T>>& t, typename T::Mask open, Tile<T>& x) {
  const T allowed = T(ScalarOf<T>(slip_tolerance / static_cast<double>(t.dt)));
  typename T::Mask differs = T::none();
  each_near(t, x, [&](const auto& pair, const ContactPatch<T>& patch, ContactSlot<T>* slots) LOCKSTEP_INLINED {
    for (int s = 0; s < pair.slots; ++s) {
      const T* const u = slots[s].speed;
      const T slip = patch.friction * sqrt(fma(u[1], u[1], u[2] * u[2]));
      differs = differs | (less(allowed, absolute(slip - slots[s].slip)) & less(T(0), slots[s].force.impulse[0]));
    }
  });
  differs = differs & open;
  if (!any(differs)) return differs;
  each_near(t, x, [&](const auto& pair, const ContactPatch<T>& patch, ContactSlot<T>* slots) LOCKSTEP_INLINED {
    for (int s = 0; s < pair.slots; ++s) {
      const T* const u = slots[s].speed;
      const T slip = patch.friction * sqrt(fma(u[1], u[1], u[2] * u[2]));
      slots[s].slip = select(differs, slip, slots[s].slip);
      slots[s].target = slots[s].bias + slots[s].slip;
      contact_force(slots[s], patch.friction, slots[s].speed, slots[s].force);
    }
  });
  return differs;
}

/// Newton and slip passes from x.contacts.z, which becomes the solution.
template <class T>
void solve_contact_phase(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, typename T::Mask open,
                         Tile<T>& x) {
  begin_newton(t, batch, open, x);
  typename T::Mask unfinished = T::none();
  for (int pass = 0; pass < t.contacts.passes; ++pass) {
    unfinished = unfinished | newton(t, batch, open, x);
    if (pass + 1 == t.contacts.passes) break;
    open = renew_slips(t, open, x);
    if (!any(open)) break;
    momentum_of_contacts(t, x.contacts.momentum, x);
  }
  for (int r = 0; r < t.bounds.rows.count; ++r) {  // what is not finished may be beyond its interval
    T& speed = x.contacts.z[t.bounds.velocity[r]];
    speed = select(unfinished, clamp(speed, x.bounds.lo[r], x.bounds.hi[r]), speed);
  }
  x.contacts.unfinished += select(unfinished, T(1), T(0));
}

/// Exchanges the two phases' intervals and momenta: a solve takes those of the first.
template <class T>
void exchange_phases(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const int rows = t.bounds.rows.count, n = t.solver.n;
  const auto exchange = [](T& a, T& b) LOCKSTEP_INLINED {
    const T kept = a;
    a = b, b = kept;
  };
  for (int r = 0; r < rows; ++r)
    exchange(x.bounds.lo[r], x.bounds.lo[rows + r]), exchange(x.bounds.hi[r], x.bounds.hi[rows + r]);
  for (int k = 0; k < n; ++k) exchange(x.held.momentum[k], x.held.momentum[n + k]);
}

/// Lanes in which the speed that moved the positions must not stay (M109). Slots that remove an overlap fast keep the
/// first solve's impulse and have no target for the gap; those that bounce have their rebound as the target, and a
/// compliance that takes nothing of it.
template <class T>
typename T::Mask begin_relaxing(const Tables<ScalarOf<T>>& t, typename T::Mask open, Tile<T>& x) {
  using S = ScalarOf<T>;
  typename T::Mask lanes = T::none();
  each_near(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>* slots) LOCKSTEP_INLINED {
    for (int s = 0; s < pair.slots; ++s) {
      ContactSlot<T>& slot = slots[s];
      slot.relaxes =
          open & slot.live & ~slot.bounces & less(T(0), slot.force.impulse[0]) & less(slot.bias, T(S(-relaxed_above)));
      const auto bounces = open & slot.bounces;
      lanes = lanes | slot.relaxes | bounces;
      slot.push = select(slot.relaxes, slot.force.impulse[0], T(0));
      slot.stiffness = select(bounces, T(S(stiffer_bounce)) * slot.stiffness, slot.stiffness);
      slot.bias = select(slot.relaxes, T(0), select(bounces, slot.rebound, slot.bias));
      slot.target = slot.bias + slot.slip;
    }
  });
  return lanes;
}

/// Friction of the second solve starts from what the first has found.
template <class T>
void carry_on(const Tables<ScalarOf<T>>& t, typename T::Mask lanes, Tile<T>& x) {
  each_near(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>* slots) LOCKSTEP_INLINED {
    for (int s = 0; s < pair.slots; ++s)
      for (int i = 0; i < 2; ++i)
        slots[s].carried[i] = select(lanes, slots[s].force.impulse[1 + i], slots[s].carried[i]);
  });
}

/// What the next step is to know of this one.
template <class T>
void remember(const Tables<ScalarOf<T>>& t, typename T::Mask acting, Tile<T>& x) {
  each_near(t, x, [&](const auto& pair, ContactPatch<T>& patch, ContactSlot<T>*) LOCKSTEP_INLINED {
    const auto lanes = acting & ~x.frozen;
    expect(t, pair, x.dynamics.solution, lanes, patch, x);
    patch.kept_normal = select<T>(lanes, patch.axes[0], patch.kept_normal);
    patch.kept_tangent = select<T>(lanes, patch.axes[1], patch.kept_tangent);
  });
  for (int p = 0; p < t.contacts.pairs.count; ++p)
    for (int s = 0; s < t.contacts.pairs[p].slots; ++s) {
      ContactSlot<T>& slot = x.contacts.slot[t.contacts.pairs[p].slot + s];
      const auto acts = slot.live & acting;
      const auto keep = [&](T& kept, T now)
                            LOCKSTEP_INLINED { kept = select(x.frozen, kept, select(acts, now, T(0))); };
      keep(slot.pressed, slot.force.impulse[0]);
      keep(slot.memory[0], slot.force.impulse[1]), keep(slot.memory[1], slot.force.impulse[2]);
      keep(slot.kept_face, slot.face);
    }
}

template <class T>
void solve_contacts(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, typename T::Mask acting,
                    Tile<T>& x) {
  const int n = t.solver.n, rows = t.bounds.rows.count;
  x.servos.duration = T(t.dt), x.servos.from = x.state.q, x.servos.time = 0;
  x.bounds.invalid = T::none();
  open_intervals(t, batch, position_phase, x);
  if (t.solve_twice) open_intervals(t, batch, velocity_phase, x);
  const bool some_free = any(~(acting | x.frozen));
  T* kept = x.contacts.unbounded_result;
  if (some_free) each_result(t, x, [&](const T& number) { *kept++ = number; });

  const T two = T(2);
  for (int k = 0; k < n; ++k)
    x.contacts.z[k] =
        select(x.contacts.known, fma(two, x.dynamics.start[k], -x.contacts.previous[k]), x.dynamics.start[k]);
  x.servos.corrected = true;
  x.contacts.weak = T::none();
  solve_contact_phase(t, batch, acting, x);
  x.singular = (x.singular & ~x.contacts.held) | (x.contacts.weak & x.contacts.held);
  for (int k = 0; k < n; ++k) x.dynamics.solution[k] = x.contacts.z[k];
  remember(t, acting, x);
  if (x.solves_twice) {
    auto again = begin_relaxing(t, acting, x);
    again = again | (lanes_with_two_phases(t, batch, x) & acting);
    if (any(again)) {
      carry_on(t, again, x);
      exchange_phases(t, x);
      x.servos.corrected = false;
      solve_contact_phase(t, batch, again, x);
      exchange_phases(t, x);
    }
    for (int k = 0; k < n; ++k)
      x.dynamics.velocity_solution[k] = select(again, x.contacts.z[k], x.dynamics.solution[k]);
  }
  integrate(t, x);
  const T* restored = x.contacts.unbounded_result;
  if (some_free) each_result(t, x, [&](T& number) { number = select(acting, number, *restored++); });
  if (rows > 0) mark_invalid(t, x);
}

/// Finds contacts. Returns whether all lanes are solved with them at once, so that nothing asks for the step without.
/// A rebound asks for it.
template <class T>
bool find_contacts(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const auto held = collide(t, x);
  x.contacts.held = t.contacts.bounces ? T::none() : held;
  return !any(~(x.contacts.held | x.frozen));
}

/// Solves the step with contacts in lanes where one acts. `solved` says whether the step without has been.
template <class T>
void touch(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, bool solved, Tile<T>& x) {
  typename T::Mask acting = T::none();
  const ScalarOf<T>* const frictions = batch.field(Parameter::contact_friction);
  each_near(t, x, [&](const auto& pair, ContactPatch<T>& patch, ContactSlot<T>* slots) LOCKSTEP_INLINED {
    const std::ptrdiff_t row = (&pair - t.contacts.pairs.data) * batch.stride;
    patch.friction = frictions ? T::load(frictions + row) : T(pair.friction);
    const RelativeTwist<T> start = twist_of(t, pair, x, x.dynamics.start);
    const RelativeTwist<T> free = solved ? twist_of(t, pair, x, x.dynamics.solution) : start;
    const PairResponse<T> response(t, pair, x);
    for (int s = 0; s < pair.slots; ++s) {
      slot_speed(slots[s], free, slots[s].speed);
      begin_slot(t, pair, patch, start, response, slots[s]);
      if (!solved) continue;
      contact_force(slots[s], patch.friction, slots[s].speed, slots[s].force);
      acting = acting | slots[s].force.sticks | slots[s].force.slides;
    }
  });
  acting = ((acting & ~x.singular) | x.contacts.held) & ~x.frozen;
  if (any(acting))
    solve_contacts(t, batch, acting, x);
  else
    remember(t, T::none(), x);
  for (int k = 0; k < t.solver.n; ++k)
    x.contacts.previous[k] = select(x.frozen, x.contacts.previous[k], x.dynamics.start[k]);
  for (int r = 0; r < t.roots.count; ++r)  // to the axes that the next step starts in
    turn_root_twist(x.half_turn + 4 * r, x.contacts.previous + t.roots[r].solver);
  x.contacts.known = ~T::none();
}

}  // namespace lockstep::kernels
