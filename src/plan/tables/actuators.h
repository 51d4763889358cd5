// Actuators: drives that are late, and motors whose effort limit falls with speed. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "spans.h"

namespace lockstep {

/// What a drive is told: position target, velocity target and feed-forward effort.
constexpr int drive_inputs = 3;

/// Rows that a lag keeps of itself: its time constant, and the two numbers of (M154) that follow from it.
constexpr int lag_rows = 3;

struct DelayedDrive {
  int joint;
  int most;  ///< steps
};

struct ActuatorStructure {
  Span<DelayedDrive> delayed;
  Span<int> lagged;  ///< joints
  Span<int> motors;  ///< joints
  int waiting = 0;   ///< rows of the inputs that are on their way
  /// Whether drives apply other inputs than a Batch shows.
  inline __attribute__((always_inline)) bool is_late() const { return delayed.count + lagged.count > 0; }
  inline __attribute__((always_inline)) bool used() const { return is_late() || motors.count > 0; }
};
template <class S>
struct ActuatorTables : ActuatorStructure {
  Span<S> curve;  ///< by motor: stall effort and no-load speed

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.curve, to.curve);
  }
};

}  // namespace lockstep
