// What plans record over the steps of a call: efforts of drives, accelerations, history of contacts.
// SPDX-License-Identifier: Apache-2.0
//
// Rows of a batch: by dof the effort of the last step, the largest and the mean of the call; by contact a
// ContactHistory, in which the sum of the forces has become their mean; by dof, then by floating root, accelerations,
// and by contact the wrench about the world's origin, of the last step.
#pragma once

#include "kernels/contacts/wrenches.h"
#include "kernels/couplings/drive_efforts.h"

namespace lockstep::kernels {

/// (M147) for a step of euler, before check().
template <class T>
void euler_efforts(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  each_drive_effort(t, batch, x, 0, x.next.v, [&](int j, T effort) LOCKSTEP_INLINED { x.records.effort[j] = effort; });
}

/// (M149): what a step adds to the history of a contact, in the lanes `good`. Forces are on its second collider in the
/// order of PairKind, means over the whole step.
template <class T>
void add_contact(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int contact, typename T::Mask good,
                 ContactHistory<T>& history) {
  const T zero = T(0), one = T(1);
  const auto presses = less(zero, x.records.contact_pressed[contact]);
  const auto touches = good & presses, flies = good & ~presses;
  const auto lands = touches & less(zero, history.flying), leaves = flies & less(zero, history.touching);
  history.last_flying = select(lands, history.flying, history.last_flying);
  history.last_touching = select(leaves, history.touching, history.last_touching);
  history.first_touch = select(lands, one, history.first_touch);
  history.touching = select(touches, history.touching + one, select(flies, zero, history.touching));
  history.flying = select(flies, history.flying + one, select(touches, zero, history.flying));
  const Vec3<T> mean = scaled(x.records.contact_force[contact], T(ScalarOf<T>(1) / t.step));
  const Vec3<T> force = select<T>(touches, mean, Vec3<T>::zero());
  history.peak = larger(history.peak, sqrt(dot(force, force)));
  history.sum = history.sum + force;
}

/// Where the step begins.
template <class T>
void keep_velocities(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int k = 0; k < t.velocities; ++k) x.records.before[k] = x.state.v[k];
}

/// (M150), and the wrenches of the contacts that acted, in the lanes `good`.
template <class T>
void add_accelerations(const Tables<ScalarOf<T>>& t, typename T::Mask good, Tile<T>& x) {
  const T rate = T(ScalarOf<T>(1) / t.step), zero = T(0);
  for (int k = 0; k < t.velocities; ++k)
    x.records.acceleration[k] = select(good, (x.next.v[k] - x.records.before[k]) * rate, zero);
  const auto mean = [&](Vec3<T>& sum) LOCKSTEP_INLINED { sum = select<T>(good, scaled(sum, rate), Vec3<T>::zero()); };
  for (int c = 0; c < t.contacts.contacts.count; ++c)
    mean(x.records.contact_force[c]), mean(x.records.contact_moment[c]);
}

/// After check(): a step that failed does not count.
template <class T>
void add_records(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const auto good = ~x.frozen;
  x.records.steps += select(good, T(1), T(0));
  for (int j = 0; t.record_efforts && j < t.joints; ++j) {
    const T effort = select(good, x.records.effort[j], T(0));
    x.records.effort[j] = effort;
    x.records.peak_effort[j] = larger(x.records.peak_effort[j], absolute(effort));
    x.records.effort_sum[j] += effort;
  }
  for (int c = 0; t.record_contacts && c < t.contacts.contacts.count; ++c)
    add_contact(t, x, c, good, x.records.contact[c]);
  if (t.record_accelerations) add_accelerations(t, good, x);
}

/// act(number, row) for what is recorded of accelerations.
template <class T, class Act>
LOCKSTEP_INLINE void each_acceleration(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch,
                                       const Tile<T>& x, Act&& act) {
  if (!t.record_accelerations) return;
  const std::ptrdiff_t stride = batch.stride;
  for (int j = 0; j < t.joints; ++j)
    act(x.records.acceleration[t.velocity_of(j)], batch.acceleration + t.dof[j] * stride);
  for (int r = 0; r < t.roots.count; ++r)
    for (int i = 0; i < 6; ++i)
      act(x.records.acceleration[t.roots[r].velocity + i], batch.acceleration + (t.joints + 6 * r + i) * stride);
  for (int p = 0; p < t.contacts.contacts.count; ++p)
    for (int i = 0; i < 3; ++i) {
      act(x.records.contact_force[p][i], batch.contact_wrench + (6 * p + i) * stride);
      act(x.records.contact_moment[p][i], batch.contact_wrench + (6 * p + 3 + i) * stride);
    }
}

/// At the start of a call.
template <class T>
void load_records(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  x.records.steps = T(0);
  for (int j = 0; t.record_efforts && j < t.joints; ++j)
    x.records.effort[j] = x.records.peak_effort[j] = x.records.effort_sum[j] = T(0);
  const ScalarOf<T>* row = batch.contact_history;
  for (int p = 0; t.record_contacts && p < t.contacts.contacts.count; ++p) {
    int k = 0;
    x.records.contact[p].each([&](T& number) LOCKSTEP_INLINED {
      number = k++ < kept_contact_rows ? T::load(row) : T(0);
      row += batch.stride;
    });
  }
  each_acceleration(t, batch, x, [&](T& number, const ScalarOf<T>* from) LOCKSTEP_INLINED { number = T::load(from); });
}

template <class T>
void store_records(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x) {
  const T share = T(1) / larger(x.records.steps, T(1));
  for (int j = 0; t.record_efforts && j < t.joints; ++j) {
    const T numbers[drive_effort_rows] = {x.records.effort[j], x.records.peak_effort[j],
                                          share * x.records.effort_sum[j]};
    for (int k = 0; k < drive_effort_rows; ++k)
      store(batch.drive_effort + (drive_effort_rows * t.dof[j] + k) * batch.stride, numbers[k]);
  }
  ScalarOf<T>* row = batch.contact_history;
  for (int p = 0; t.record_contacts && p < t.contacts.contacts.count; ++p) {
    ContactHistory<T> history = x.records.contact[p];
    history.sum = scaled(history.sum, share);
    history.each([&](const T& number) LOCKSTEP_INLINED {
      store(row, number);
      row += batch.stride;
    });
  }
  each_acceleration(t, batch, x, [&](T number, ScalarOf<T>* to) LOCKSTEP_INLINED { store(to, number); });
}

}  // namespace lockstep::kernels
