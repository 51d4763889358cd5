// The energy of contacts: where a solve would add some, what it does instead, and what the audit allows.
// SPDX-License-Identifier: Apache-2.0
//
// (M116), (M126), (M127). Impulses that solves begin with, restored impacts and push-outs can push along the motion.
#pragma once

#include "kernels/contacts/collide.h"
#include "solve_rounds.h"

namespace lockstep::kernels {

constexpr double energy_tolerance = 0.01;  ///< (M116)
constexpr double rounding_of_work = 0.1;   ///< of jammed contacts: large impulses whose work cancels

/// Lanes in which hard contacts have added energy beyond what slow push-outs may: sum lambda . u > sum lambda_n v
/// (M116).
template <class T>
typename T::Mask push_ahead(const Tables<ScalarOf<T>>& t, typename T::Mask open, double part, Tile<T>& x) {
  T work = T(0);
  each_slot(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>& slot) LOCKSTEP_INLINED {
    if (pair.soft) return;
    const T *const impulse = slot.force.impulse, *const u = slot.speed;
    T slow = fma(impulse[0], fnma(T(ScalarOf<T>(part)), slot.slow, u[0]), work);
    if (const TurningFriction<T>* const turning = turning_of(pair, slot, x))
      slow += dot(turning->force.impulse, turning->speed);
    work = select(slot.live, fma(impulse[1], u[1], fma(impulse[2], u[2], slow)), work);
  });
  return open & less(T(0), work);
}

/// What solves begin with adds energy where an impulse of the step before is carried to a lever that has little use for
/// it. Such lanes solve once more without.
template <class T>
void forget_impulses(const Tables<ScalarOf<T>>& t, typename T::Mask lanes, Tile<T>& x) {
  each_slot(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>& slot) LOCKSTEP_INLINED {
    slot.push = select(lanes, T(0), slot.push);
    if (TurningFriction<T>* const turning = turning_of(pair, slot, x)) {
      turning->carried = select<T>(lanes, Vec3<T>::zero(), turning->carried);
      turning->drift = select<T>(lanes, Vec3<T>::zero(), turning->drift);
    }
    for (int i = 0; i < 2; ++i) {
      slot.carried[i] = select(lanes, T(0), slot.carried[i]);
      slot.drift[i] = select(lanes, T(0), slot.drift[i]);
    }
  });
}

/// Lanes in which the contacts have added energy to the step without them, beyond what single slots ask for whose
/// restored share is above 1 (M116).
template <class T>
typename T::Mask gains_energy(const Tables<ScalarOf<T>>& t, typename T::Mask open, Tile<T>& x) {
  const T zero = T(0), one = T(1);
  T gain = zero, allowed = zero;
  each_slot(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>& slot) LOCKSTEP_INLINED {
    for (int i = 0; i < 3; ++i)
      gain = select(slot.live, fma(slot.force.impulse[i], slot.speed[i] + slot.free[i], gain), gain);
    if (const TurningFriction<T>* const turning = turning_of(pair, slot, x))
      gain = select(slot.live, gain + dot(turning->force.impulse, turning->speed + turning->free), gain);
    const T share = larger(slot.restored, one) - T(ScalarOf<T>(1 - energy_tolerance));
    allowed = select(slot.given, fma(slot.normal * absolute(slot.free[0]), share, allowed), allowed);
  });
  return open & less(allowed, gain);
}

/// What lanes restore that would gain energy: at first one share for all slots, which cannot unless something else
/// presses, and then nothing.
template <class T>
void restore_less(const Tables<ScalarOf<T>>& t, typename T::Mask open, bool nothing, Tile<T>& x) {
  T least = T(nothing ? 0 : 1);
  each_slot(t, x, [&](const auto&, const ContactPatch<T>&, ContactSlot<T>& slot) LOCKSTEP_INLINED {
    least = select(slot.given, smaller(least, slot.restored), least);
  });
  each_slot(t, x, [&](const auto&, const ContactPatch<T>&, ContactSlot<T>& slot) LOCKSTEP_INLINED {
    slot.restored = select(open, least, slot.restored);
    slot.normal = fma(slot.restored, slot.stopping, slot.stopping);
  });
}

/// v^T A v with the matrix of the rounds.
template <class T>
T form_of_rounds(const Tables<ScalarOf<T>>& t, const Tile<T>& x, const T* v) {
  const Columns& columns = t.rounds.columns;
  T sum = T(0);
  for (int j = 0; j < columns.n; ++j) {
    const T* const own = x.held.matrix + columns.offset[j];
    T below = T(0);
    for (int k = 1; k < columns.size[j]; ++k) below = fma(own[k], v[j + k], below);
    sum = fma(v[j], fma(own[0], v[j], below + below), sum);
  }
  return sum;
}

/// Lanes in which contacts may have pushed along the motion that stays: the first of (M116) says so, with the impulses
/// that are remembered, or the kinetic energy has risen and the work of jammed contacts, whose large impulses cancel,
/// may be positive. A solve of other lanes has evaluated the slots beside these.
template <class T>
typename T::Mask pushes_along(const Tables<ScalarOf<T>>& t, typename T::Mask open, Tile<T>& x) {
  using S = ScalarOf<T>;
  T work = T(0), size = T(0), slow = T(0);
  slot_speeds(t, x.rounds.z, &ContactSlot<T>::speed, x);
  each_slot(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>& slot) LOCKSTEP_INLINED {
    if (pair.soft) return;
    const auto add = [&](T part) LOCKSTEP_INLINED {
      work = select(slot.live, work + part, work);
      size = select(slot.live, size + absolute(part), size);
    };
    add(slot.pressed * slot.speed[0]), add(slot.memory[0] * slot.speed[1]), add(slot.memory[1] * slot.speed[2]);
    if (const TurningFriction<T>* const turning = turning_of(pair, slot, x)) add(dot(turning->memory, turning->speed));
    slow = select(slot.live, fma(slot.pressed, slot.slow, slow), slow);
  });
  const auto pushes = open & less(slow, work), unclear = open & ~pushes & less(-T(S(rounding_of_work)) * size, work);
  auto gains = T::none();
  if (any(unclear)) {
    const T gain =
        fnma(T(S(1 + 0.5 * energy_tolerance)), form_of_rounds(t, x, x.held.start), form_of_rounds(t, x, x.rounds.z));
    gains = less(T(0), gain) & less(gain, size + size);  // or it cannot be theirs
  }
  return pushes | (unclear & gains);
}

/// (M127): in these lanes contacts have pushed along the motion. What stays then is no more than what has the energy of
/// the start, or of the step without contacts, on the line from the latter to the solution.
template <class T>
void keep_energy(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, typename T::Mask lanes,
                 Tile<T>& x) {
  using S = ScalarOf<T>;
  const int n = t.rounds.columns.n;
  T *const z = x.rounds.z, *const ended = x.rounds.ended;
  for (int k = 0; k < n; ++k) ended[k] = z[k], z[k] = x.held.start[k];
  set_contacts_aside(x);
  open_row_slots(t, batch, velocity_phase, x);
  exchange_phases(t, x);
  begin_newton(t, batch, lanes, x);
  newton(t, batch, lanes, 1, x);
  exchange_phases(t, x);
  bring_contacts_back(x);
  const T before = form_of_rounds(t, x, x.held.start), free = form_of_rounds(t, x, z),
          after = form_of_rounds(t, x, ended), most = T(S(1 + 0.5 * energy_tolerance)) * larger(before, free);
  const auto gains = lanes & less(most, after);
  for (int k = 0; k < n; ++k) x.rounds.step[k] = ended[k] - z[k];
  const T curve = form_of_rounds(t, x, x.rounds.step), slope = T(S(0.5)) * ((after - free) - curve);
  const T root = sqrt(larger(fma(curve, most - free, slope * slope), T(0)));
  const T share = select(gains, (root - slope) / select(gains, curve, T(1)), T(1));
  for (int k = 0; k < n; ++k) z[k] = select(gains, fma(share, x.rounds.step[k], z[k]), ended[k]);
  for (int s = 0; s < t.contacts.slots; ++s) {
    ContactSlot<T>& slot = x.contacts.slot[s];
    slot.pressed *= share, slot.memory[0] *= share, slot.memory[1] *= share;
  }
  each_turning(t, x, [&](const ContactSlot<T>&, TurningFriction<T>& turning) LOCKSTEP_INLINED {
    turning.memory = scaled(turning.memory, share);
  });
  x.contacts.unfinished += select(gains, T(1), T(0));
}

/// (M126): the work of overlaps that are pushed out, and of soft pairs.
template <class T>
T work_of_push_outs(const Tables<ScalarOf<T>>& t, typename T::Mask acting, Tile<T>& x) {
  T work = T(0);
  each_slot(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>& slot) LOCKSTEP_INLINED {
    const T *const impulse = slot.force.impulse, *const u = slot.speed;
    const auto pushes = slot.live & ~slot.bounces & less(slot.bias, T(0));
    work = select(pushes, fma(impulse[0], larger(u[0], T(0)), work), work);
    if (!pair.soft) return;  // the memory of a soft pair is a spring along the surface
    T along = fma(impulse[1], u[1], impulse[2] * u[2]);
    if (const TurningFriction<T>* const turning = turning_of(pair, slot, x))
      along += dot(turning->force.impulse, turning->speed);
    work = select(slot.live, work + larger(along, T(0)), work);
  });
  return select(acting, work, T(0));
}

}  // namespace lockstep::kernels
