// The order of a step with bounds: servos, phases, methods. SPDX-License-Identifier: Apache-2.0
#include "bounded.h"

#include <stdexcept>

#include "convex.h"
#include "lockstep/error.h"
#include "servos.h"

namespace lockstep::reference {
namespace {

using Eigen::VectorXd;

constexpr int most_guesses = 100;  // of which servos are at their limits

// In the last phase servos are curves, and the phase decides which of them are at their limits. The position phase
// takes that decision.
Step exact_step(const Mechanism& mechanism, const StepSettings& settings, const State& state, const Inputs& inputs) {
  const bool two_phases = settings.velocity_iterations > 0;
  const Acting servoless = acting(mechanism, inputs, std::vector<Servo>(mechanism.dofs(), Servo::apart));
  const Stage servoless_stage(servoless.mechanism, settings.dt, state, servoless.inputs);
  std::vector<Curve> servo_curves;
  for (int dof = 0; dof < mechanism.dofs(); ++dof)
    if (limited_servo(mechanism.joint(dof)))
      servo_curves.push_back(servo_curve(mechanism, inputs, servoless_stage, dof));
  const Exact last = exact_phase({servoless.mechanism, settings, servoless.inputs, servoless_stage},
                                 two_phases ? Phase::velocity : Phase::position, servo_curves);

  const Acting decided = acting(mechanism, inputs, servos_at(mechanism, inputs, servoless_stage, last.velocity));
  Stage stage(decided.mechanism, settings.dt, state, decided.inputs);
  VectorXd position_velocity = last.velocity;
  if (two_phases)
    position_velocity = exact_phase({decided.mechanism, settings, decided.inputs, stage}, Phase::position, {}).velocity;
  return finished(mechanism, std::move(stage), {position_velocity, last.velocity, last.impulses, last.loops});
}

// Sweeps do not minimise anything, so the servos at their limits are guessed until the velocities agree with the guess.
Step swept_step(const Mechanism& mechanism, const StepSettings& settings, const State& state, const Inputs& inputs) {
  std::vector<Servo> servos(mechanism.dofs(), Servo::linear);
  for (int guess = 0; guess < most_guesses; ++guess) {
    const Acting guessed = acting(mechanism, inputs, servos);
    Stage stage(guessed.mechanism, settings.dt, state, guessed.inputs);
    const Bounded step{guessed.mechanism, settings, guessed.inputs, stage};
    Solution solution = settings.method == Method::pgs ? bounded_pgs(step) : bounded_tgs(step);
    std::vector<Servo> found = servos_at(mechanism, inputs, stage, solution.velocity);
    if (found == servos) return finished(mechanism, std::move(stage), std::move(solution));
    servos = std::move(found);
  }
  throw std::logic_error("no guess of which servos are at their limits agrees with the velocities that follow from it");
}

}  // namespace

Step bounded_step(const Mechanism& mechanism, const StepSettings& settings, const State& state, const Inputs& inputs) {
  const Mechanism bounded(without(settings.ignore, mechanism.model()));
  switch (settings.method) {
    case Method::pgs:
    case Method::tgs: return swept_step(bounded, settings, state, inputs);
    case Method::direct:
    case Method::reduced: return exact_step(bounded, settings, state, inputs);
    default: throw SettingsError("method", "is automatic", "name the method that the reference is to use");
  }
}

}  // namespace lockstep::reference
