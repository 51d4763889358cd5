// The order of a step with bounds: servos, phases, methods. SPDX-License-Identifier: Apache-2.0
#include "bounded.h"

#include <stdexcept>

#include "convex.h"
#include "lockstep/error.h"
#include "servos.h"

namespace lockstep::reference {
namespace {

using Eigen::VectorXd;

constexpr int most_guesses = 100;  // of the servos at their limits

// The last phase decides on the servos, each of which is a curve there; the position phase takes them as they are then.
Step exact_step(const Mechanism& mechanism, const StepSettings& settings, const State& state, const Inputs& inputs) {
  const bool two_phases = settings.velocity_iterations > 0;
  const Acting without = acting(mechanism, inputs, std::vector<Servo>(mechanism.dofs(), Servo::apart));
  const Stage free_of_servos(without.mechanism, settings.dt, state, without.inputs);
  std::vector<Curve> apart;
  for (int dof = 0; dof < mechanism.dofs(); ++dof)
    if (limited_servo(mechanism.joint(dof))) apart.push_back(servo_curve(mechanism, inputs, free_of_servos, dof));
  const Exact last = exact_phase({without.mechanism, settings, without.inputs, free_of_servos},
                                 two_phases ? Phase::velocity : Phase::position, apart);

  const Acting now = acting(mechanism, inputs, servos_at(mechanism, inputs, free_of_servos, last.velocity));
  Stage stage(now.mechanism, settings.dt, state, now.inputs);
  VectorXd moving = last.velocity;
  if (two_phases) moving = exact_phase({now.mechanism, settings, now.inputs, stage}, Phase::position, {}).velocity;
  return finished(mechanism, std::move(stage), {moving, last.velocity, last.impulses});
}

// Sweeps are no minimum, so the servos are guessed until the velocities agree with the guess.
Step swept_step(const Mechanism& mechanism, const StepSettings& settings, const State& state, const Inputs& inputs) {
  std::vector<Servo> servos(mechanism.dofs(), Servo::linear);
  for (int guess = 0; guess < most_guesses; ++guess) {
    const Acting now = acting(mechanism, inputs, servos);
    Stage stage(now.mechanism, settings.dt, state, now.inputs);
    const Bounded step{now.mechanism, settings, now.inputs, stage};
    Solution solution = settings.method == Method::pgs ? bounded_pgs(step) : bounded_tgs(step);
    std::vector<Servo> found = servos_at(mechanism, inputs, stage, solution.velocity);
    if (found == servos) return finished(mechanism, std::move(stage), std::move(solution));
    servos = std::move(found);
  }
  throw std::logic_error("no choice of servos at their limits agrees with the velocities after it");
}

}  // namespace

Step bounded_step(const Mechanism& mechanism, const StepSettings& settings, const State& state, const Inputs& inputs) {
  const Mechanism bounded(without(settings.ignore, mechanism.model()));
  switch (settings.method) {
    case Method::pgs:
    case Method::tgs: return swept_step(bounded, settings, state, inputs);
    case Method::direct:
    case Method::reduced: return exact_step(bounded, settings, state, inputs);
    default: throw SettingsError("method", "is automatic", "name one that the reference shall use");
  }
}

}  // namespace lockstep::reference
