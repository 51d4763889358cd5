// The energy of contacts: where a solve would add some, what it does instead, and what the audit allows.
// SPDX-License-Identifier: Apache-2.0
//
// (M116), (M126), (M127). Impulses that solves begin with, restored impacts and push-outs can push along the motion.
#pragma once

#include "kernels/contacts/collide.h"
#include "solve_rounds.h"

namespace lockstep::kernels {

constexpr double energy_tolerance = 0.01;  ///< (M116)

/// Lanes in which hard contacts have added energy beyond what slow push-outs may: sum lambda . u > sum lambda_n v
/// (M116).
template <class T>
typename T::Mask push_ahead(const Tables<ScalarOf<T>>& t, typename T::Mask open, double part, Tile<T>& x) {
  T work = T(0);
  each_near(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>* slots) LOCKSTEP_INLINED {
    if (pair.soft) return;
    for (int s = 0; s < pair.slots; ++s) {
      const T *const impulse = slots[s].force.impulse, *const u = slots[s].speed;
      const T slow = fma(impulse[0], fnma(T(ScalarOf<T>(part)), slots[s].slow, u[0]), work);
      work = select(slots[s].live, fma(impulse[1], u[1], fma(impulse[2], u[2], slow)), work);
    }
  });
  return open & less(T(0), work);
}

/// What solves begin with adds energy where an impulse of the step before is carried to a lever that has little use for
/// it. Such lanes solve once more without.
template <class T>
void forget_impulses(const Tables<ScalarOf<T>>& t, typename T::Mask lanes, Tile<T>& x) {
  each_near(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>* slots) LOCKSTEP_INLINED {
    for (int s = 0; s < pair.slots; ++s) {
      slots[s].push = select(lanes, T(0), slots[s].push);
      for (int i = 0; i < 2; ++i) {
        slots[s].carried[i] = select(lanes, T(0), slots[s].carried[i]);
        slots[s].drift[i] = select(lanes, T(0), slots[s].drift[i]);
      }
    }
  });
}

/// Lanes in which the contacts have added energy to the step without them, beyond what single slots ask for whose
/// restored share is above 1 (M116).
template <class T>
typename T::Mask gains_energy(const Tables<ScalarOf<T>>& t, typename T::Mask open, Tile<T>& x) {
  const T zero = T(0), one = T(1);
  T gain = zero, allowed = zero;
  each_near(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>* slots) LOCKSTEP_INLINED {
    for (int s = 0; s < pair.slots; ++s) {
      const ContactSlot<T>& slot = slots[s];
      for (int i = 0; i < 3; ++i)
        gain = select(slot.live, fma(slot.force.impulse[i], slot.speed[i] + slot.free[i], gain), gain);
      const T share = larger(slot.restored, one) - T(ScalarOf<T>(1 - energy_tolerance));
      allowed = select(slot.given, fma(slot.normal * absolute(slot.free[0]), share, allowed), allowed);
    }
  });
  return open & less(allowed, gain);
}

/// What lanes restore that would gain energy: at first one share for all slots, which cannot unless something else
/// presses, and then nothing.
template <class T>
void restore_less(const Tables<ScalarOf<T>>& t, typename T::Mask open, bool nothing, Tile<T>& x) {
  T least = T(nothing ? 0 : 1);
  each_near(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>* slots) LOCKSTEP_INLINED {
    for (int s = 0; s < pair.slots; ++s) least = select(slots[s].given, smaller(least, slots[s].restored), least);
  });
  each_near(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>* slots) LOCKSTEP_INLINED {
    for (int s = 0; s < pair.slots; ++s) {
      slots[s].restored = select(open, least, slots[s].restored);
      slots[s].normal = fma(slots[s].restored, slots[s].stopping, slots[s].stopping);
    }
  });
}

/// The first of (M116) for what stays, with the impulses that are remembered: a solve of other lanes has evaluated the
/// slots beside these.
template <class T>
typename T::Mask pushes_along(const Tables<ScalarOf<T>>& t, typename T::Mask open, Tile<T>& x) {
  T work = T(0);
  slot_speeds(t, x.rounds.z, &ContactSlot<T>::speed, x);
  each_near(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>* slots) LOCKSTEP_INLINED {
    if (pair.soft) return;
    for (int s = 0; s < pair.slots; ++s) {
      const ContactSlot<T>& slot = slots[s];
      const T along = fma(slot.memory[0], slot.speed[1], slot.memory[1] * slot.speed[2]);
      work = select(slot.live, fma(slot.pressed, slot.speed[0] - slot.slow, work + along), work);
    }
  });
  return open & less(T(0), work);
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

/// (M127): in these lanes contacts have pushed along the motion. What stays then is no more than what has the energy of
/// the start, or of the step without contacts, on the line from the latter to the solution.
template <class T>
void keep_energy(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, typename T::Mask lanes,
                 Tile<T>& x) {
  using S = ScalarOf<T>;
  const int n = t.rounds.columns.n;
  T *const z = x.rounds.z, *const ended = x.rounds.ended;
  for (int k = 0; k < n; ++k) ended[k] = z[k], z[k] = x.held.start[k];
  set_contacts_aside(t, x);
  open_row_slots(t, velocity_phase, x);
  exchange_phases(t, x);
  begin_newton(t, batch, lanes, x);
  newton(t, batch, lanes, x);
  exchange_phases(t, x);
  bring_contacts_back(t, x);
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
  x.contacts.unfinished += select(gains, T(1), T(0));
}

/// (M126): the work of overlaps that are pushed out, and of soft pairs.
template <class T>
T work_of_push_outs(const Tables<ScalarOf<T>>& t, typename T::Mask acting, Tile<T>& x) {
  T work = T(0);
  each_near(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>* slots) LOCKSTEP_INLINED {
    for (int s = 0; s < pair.slots; ++s) {
      const T *const impulse = slots[s].force.impulse, *const u = slots[s].speed;
      const auto pushes = slots[s].live & ~slots[s].bounces & less(slots[s].bias, T(0));
      work = select(pushes, fma(impulse[0], larger(u[0], T(0)), work), work);
      if (!pair.soft) continue;  // the memory of a soft pair is a spring along the surface
      const T along = fma(impulse[1], u[1], impulse[2] * u[2]);
      work = select(slots[s].live, work + larger(along, T(0)), work);
    }
  });
  return select(acting, work, T(0));
}

}  // namespace lockstep::kernels
