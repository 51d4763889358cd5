// Arrays of what a plan records of the steps of a call: efforts of drives, accelerations, history of contacts.
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynamics_arrays.h"

namespace lockstep::kernels {

/// What a pair of colliders has done. Times are counts of steps.
template <class T>
struct ContactHistory {
  T touching, flying;            // of the present contact, of the present flight
  T last_touching, last_flying;  // of those before
  T first_touch;                 // 1 if a flight has ended in this call
  T peak;                        // largest force in this call
  Vec3<T> sum;                   // of the forces in this call, in the world

  /// act(number) in the order of the rows of a Batch. What is kept over calls comes first.
  template <class Act>
  LOCKSTEP_INLINE void each(Act&& act) {
    T* const numbers[contact_history_rows] = {&touching, &flying, &last_touching, &last_flying, &first_touch,
                                              &peak,     &sum[0], &sum[1],        &sum[2]};
    for (T* number : numbers) act(*number);
  }
};

template <class T>
struct Records {
  T* effort;                   // [joints] of drives, mean over the step
  T* solved_effort;            // [joints] the same over the leapfrog that was made last
  typename T::Mask* searched;  // [limited servos] lanes in which its stages have left the servo to the search
  T* peak_effort;              // [joints] largest size in this call
  T* effort_sum;               // [joints] over the steps of this call
  ContactHistory<T>* contact;  // [contacts]
  T* before;                   // [velocities] at the start of the step
  T* acceleration;             // [velocities] mean over the step
  Vec3<T>* contact_force;      // [contacts] of contact, over the step, in the world
  Vec3<T>* contact_moment;     // [contacts] the same about the world's origin, beside accelerations
  T* contact_pressed;          // [contacts] normal impulses over the step, added up
  T steps;                     // good ones of this call

  template <class Take>
  void arrays(const Tables<ScalarOf<T>>& t, Take& take) {
    const int joints = t.record_efforts ? t.joints : 0, solved = t.integrator == Integrator::euler ? 0 : joints;
    take("records.effort", effort, joints, Lifetime::state);
    take("records.solved_effort", solved_effort, solved);
    take("records.searched", searched, solved > 0 ? t.limited_servos.count : 0);
    take("records.peak_effort", peak_effort, joints, Lifetime::state);
    take("records.effort_sum", effort_sum, joints, Lifetime::state);
    take("records.contact", contact, t.record_contacts ? t.contacts.contacts.count : 0, Lifetime::state);
    const int velocities = t.record_accelerations ? t.velocities : 0;
    const int contacts = t.sums_contacts() ? t.contacts.contacts.count : 0;
    take("records.before", before, velocities);
    take("records.acceleration", acceleration, velocities, Lifetime::state);
    take("records.contact_force", contact_force, contacts, Lifetime::state);
    take("records.contact_moment", contact_moment, t.record_accelerations ? contacts : 0, Lifetime::state);
    take("records.contact_pressed", contact_pressed, contacts);
  }
};

}  // namespace lockstep::kernels
