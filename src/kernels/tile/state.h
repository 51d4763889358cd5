// Positions and velocities: where a step starts, where it ends, and where its stages are.
// SPDX-License-Identifier: Apache-2.0
//
// Each part of a Tile declares its arrays once, and right below gives their names to `take`: take(name, pointer, count,
// lifetime).
#pragma once

#include "lifetime.h"
#include "plan/tables.h"
#include "simd/vec3.h"

namespace lockstep::kernels {

using simd::ScalarOf;

constexpr int leapfrog_stages = 3;

template <class T>
struct State {
  T* q;     // [joints]
  T* v;     // [velocities] tree by tree: a floating root's twist, then the joints
  T* pose;  // [7] by floating root

  template <class Take>
  void arrays(const Tables<ScalarOf<T>>& t, const char* q_name, const char* v_name, const char* pose_name, Take& take,
              Lifetime lifetime = Lifetime::step, bool used = true) {
    take(q_name, q, used ? t.joints : 0, lifetime);
    take(v_name, v, used ? t.velocities : 0, lifetime);
    take(pose_name, pose, used ? 7 * t.roots.count : 0, lifetime);
  }
};

/// act(part, count) for the parts of a State: q, v, and the poses of floating roots.
template <class T, class Act>
LOCKSTEP_INLINE void each_part(const Tables<ScalarOf<T>>& t, Act&& act) {
  act(&State<T>::q, t.joints);
  act(&State<T>::v, t.velocities);
  act(&State<T>::pose, 7 * t.roots.count);
}

/// Copies `from` to `to`.
template <class T>
LOCKSTEP_INLINE void copy_state(const Tables<ScalarOf<T>>& t, const State<T>& from, const State<T>& to) {
  each_part<T>(t, [&](T* State<T>::*part, int count) LOCKSTEP_INLINED {
    for (int i = 0; i < count; ++i) (to.*part)[i] = (from.*part)[i];
  });
}

/// Sets all numbers to zero.
template <class T>
LOCKSTEP_INLINE void clear_state(const Tables<ScalarOf<T>>& t, const State<T>& state) {
  each_part<T>(t, [&](T* State<T>::*part, int count) LOCKSTEP_INLINED {
    for (int i = 0; i < count; ++i) (state.*part)[i] = T(0);
  });
}

/// What integrators with several stages keep.
template <class T>
struct Stages {
  State<T> begin;         // of the step; Tile::state is that of the stage
  State<T> midpoint;      // without poses; v is that of the beginning, roots' parts along the midpoint's axes
  State<T> first;         // where the first of several steps began
  State<T> total_change;  // of the step
  State<T> kept;          // where the step ends in lanes that are not taken again
  T* velocity;            // [stages][velocities]
  T* change;              // [stages][velocities]
  T* mean_velocity;       // [velocities] that moves the positions
  T* gained_velocity;     // [velocities] what a leapfrog adds to the velocities, along the midpoint's axes
  T* rate;                // [joints] of the positions, in a stage of Runge-Kutta
  T* pose;                // [7] by floating root, of a stage: its quaternion is not normalised
  T* pose_rate;           // [7] by floating root

  template <class Take>
  void arrays(const Tables<ScalarOf<T>>& t, Take& take) {
    const bool classical = t.integrator == Integrator::runge_kutta, twice = t.integrator == Integrator::extrapolated;
    const int velocities = classical ? 0 : t.velocities, root_pose = classical ? 7 * t.roots.count : 0;
    begin.arrays(t, "stages.begin.q", "stages.begin.v", "stages.begin.pose", take);
    take("stages.midpoint.q", midpoint.q, classical ? 0 : t.joints);
    take("stages.midpoint.v", midpoint.v, velocities);
    midpoint.pose = nullptr;
    take("stages.velocity", velocity, leapfrog_stages * velocities);
    take("stages.change", change, classical ? t.velocities : leapfrog_stages * velocities);
    take("stages.mean_velocity", mean_velocity, velocities);
    take("stages.gained_velocity", gained_velocity, velocities);
    take("stages.rate", rate, classical ? t.joints : 0);
    take("stages.pose", pose, root_pose);
    take("stages.pose_rate", pose_rate, root_pose);
    first.arrays(t, "stages.first.q", "stages.first.v", "stages.first.pose", take, Lifetime::step, twice);
    kept.arrays(t, "stages.kept.q", "stages.kept.v", "stages.kept.pose", take, Lifetime::step,
                t.integrator == Integrator::leapfrog);
    total_change.arrays(t, "stages.total_change.q", "stages.total_change.v", "stages.total_change.pose", take,
                        Lifetime::step, classical || twice);
  }
};

/// What the guard keeps (guard.h).
template <class T>
struct Guard {
  T* bias;                                          // [velocities] at the start's velocity
  T* change;                                        // [velocities] of the prediction
  T* velocity;                                      // [solver]
  T* product;                                       // [solver]
  State<T> begin[guard_depth], end[guard_depth];    // of the steps that are taken in halves
  T *remembered[guard_depth], *found[guard_depth];  // of contacts, in the same way
  T eta;                                            // squared, of the last step
  T size;                                           // v^T A v, which eta is relative to
  typename T::Mask coarse;                          // lanes in which it was too large
  typename T::Mask halved;                          // lanes for which a half is taken

  template <class Take>
  void arrays(const Tables<ScalarOf<T>>& t, Take& take) {
    take("guard.bias", bias, t.velocities);
    take("guard.change", change, t.velocities);
    take("guard.velocity", velocity, t.solver.n, Lifetime::stage);
    take("guard.product", product, t.solver.n, Lifetime::stage);
    for (int d = 0; d < guard_depth; ++d) {
      begin[d].arrays(t, "guard.begin.q", "guard.begin.v", "guard.begin.pose", take, Lifetime::stage);
      end[d].arrays(t, "guard.end.q", "guard.end.v", "guard.end.pose", take, Lifetime::stage);
      const int contacts = t.contacts.used() ? t.contacts.remembered_state(t) + 4 : 0;  // each_of_contacts()
      take("guard.remembered", remembered[d], contacts, Lifetime::stage);
      take("guard.found", found[d], contacts, Lifetime::stage);
    }
  }
};

}  // namespace lockstep::kernels
