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

/// What the audit of energy keeps (audit.h).
template <class T>
struct Audit {
  Motion<T> motion;
  typename T::Mask fast;  // lanes that it is for
  T kinetic, potential;   // of the state
  bool known;             // these two are
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
