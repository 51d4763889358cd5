// What keeps methods, integrators and parts of a step from applying to a plan. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "lockstep/plan.h"

namespace lockstep {

/// What an obstacle stands in the way of.
enum class Axis {
  per_environment,  ///< a field per environment, whatever the method
  method,
  sub_steps,  ///< the method tgs, by what its sub-steps cannot do
  integrator,
  stages,   ///< bounds in the stages of a leapfrog
  folding,  ///< soft couplings in the matrix
  audit
};

/// An obstacle as the stages of compile() ask for it.
struct PlanObstacle : Obstacle {
  Axis axis;
};

// compile() asks for these at the stage from which on they are known, and Program::obstacles lists what stands there.

/// To fields per environment and to methods, and to integrators by the method, in the order in which compile() refuses:
/// when redundant couplings are known.
void find_method_obstacles(Program& program);
/// The first obstacle to folding any soft coupling: when rows are laid out.
std::optional<PlanObstacle> obstacle_to_folding(const Program& program);
/// Whether this row, with its share (M97), keeps those of its component from being folded.
std::optional<PlanObstacle> obstacle_to_folding(const Program& program, int row, double share);
/// Why bounds cannot be held as single velocities alone: when bounds are laid out.
std::optional<PlanObstacle> obstacle_to_single_velocities(const Program& program);
/// What may bring energy that the audit does not know of (M93): when contacts are laid out.
void find_audit_obstacles(Program& program);
/// To integrators by all but the method: at the end.
void find_integrator_obstacles(Program& program);

/// The first of this axis, and of this name if one is given; null if there is none.
const PlanObstacle* find_obstacle(const Program& program, Axis axis, const char* applies_to = nullptr);

/// Throws the SettingsError of a plan that was asked for what the obstacle stands against.
[[noreturn]] void refuse(const PlanObstacle& obstacle);

}  // namespace lockstep
