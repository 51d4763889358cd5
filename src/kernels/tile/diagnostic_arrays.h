// Arrays of the diagnostics of a step. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynamics_arrays.h"

namespace lockstep::kernels {

/// Positions and rotations of the bodies in the world, and their twists in their own axes.
template <class T>
struct Motion {
  Mat3<T>* world;
  Vec3<T>* place;
  Vec3<T>* angular;
  Vec3<T>* linear;

  template <class Take>
  void arrays(const Tables<ScalarOf<T>>& t, Take& take) {
    take("motion.world", world, t.bodies);
    take("motion.place", place, t.bodies);
    take("motion.angular", angular, t.bodies);
    take("motion.linear", linear, t.bodies);
  }
};

/// What the audit of energy knows (audit.h).
template <class T>
struct AuditState {
  T gained;                // energy from nowhere, in all steps
  T most;                  // the largest kinetic energy
  T kinetic, potential;    // of the state
  typename T::Mask known;  // these two are: all lanes or none, as control is data (control.h)
};

template <class T>
struct Audit {
  Motion<T> motion;
  AuditState<T>* state;   // [1]
  typename T::Mask fast;  // lanes that it is for

  template <class Take>
  void arrays(const Tables<ScalarOf<T>>& t, Take& take) {
    motion.arrays(t, take);
    take("audit.state", state, 1, Lifetime::state);
  }
};

template <class T>
struct Diagnostics {
  Motion<T> motion;
  T* moved_velocity;     // [velocities] of the position phase
  State<T> uncorrected;  // where the step ends without corrections of position
  T* residual;           // [reported]
  T* row_state;          // [reported]
  T* energy;             // [4] summed over the steps of a call
  T* energy_change;      // [4] of this step

  template <class Take>
  void arrays(const Tables<ScalarOf<T>>& t, Take& take) {
    motion.arrays(t, take);
    take("diagnostics.moved_velocity", moved_velocity, t.velocities);
    uncorrected.arrays(t, "diagnostics.uncorrected.q", "diagnostics.uncorrected.v", "diagnostics.uncorrected.pose",
                       take);
    take("diagnostics.residual", residual, t.reported.count, Lifetime::state);
    take("diagnostics.row_state", row_state, t.reported.count, Lifetime::state);
    take("diagnostics.energy", energy, 4, Lifetime::state);
    take("diagnostics.energy_change", energy_change, 4);
  }
};

}  // namespace lockstep::kernels
