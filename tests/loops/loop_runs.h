// What tests of moving loops share. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>

#include "lockstep/lockstep.h"
#include "reference/loop_models.h"

namespace lockstep::loop_runs {

/// Joints that may turn for ever.
inline Model turning_for_ever(Model model) {
  for (Joint& joint : model.joints)
    if (joint.kind == JointKind::revolute) joint.kind = JointKind::continuous;
  return model;
}

inline StepSettings settings(Integrator integrator, double dt = 1.0 / 240) {
  StepSettings s;
  s.dt = dt, s.integrator = integrator;
  return s;
}

template <class S>
double energy(const Batch<S>& batch, int e = 0) {
  return static_cast<double>(batch.kinetic_energies()(0, e)) + static_cast<double>(batch.potential_energies()(0, e));
}

/// What a run of environment 0 has shown.
struct Run {
  double gap = 0.0;      ///< largest loop error, m or rad
  double gain = -1e300;  ///< of energy above the start, as a share of the largest kinetic energy, at most
  int faulted = 0;
  std::string why;
};

template <class S>
Run run(Batch<S>& batch, double seconds) {
  Run result;
  const double start = energy(batch);
  double kinetic = 0.0, most = -1e300;
  const int steps = static_cast<int>(seconds / batch.plan().settings().dt + 0.5);
  for (int i = 0; i < steps; ++i) {
    batch.step(1);
    result.gap = std::max(result.gap, static_cast<double>(batch.loop_errors().col(0).maxCoeff()));
    kinetic = std::max(kinetic, static_cast<double>(batch.kinetic_energies()(0, 0)));
    most = std::max(most, energy(batch) - start);
  }
  result.gain = most / kinetic;
  result.faulted = batch.faulted();
  if (result.faulted) result.why = batch.explain_fault(0);
  return result;
}

template <class S>
Run run(const Model& model, const StepSettings& s, double seconds) {
  Batch<S> batch(compile(model, s), 1, {.threads = 1});
  return run(batch, seconds);
}

/// Random efforts on the driven joints, of each environment its own.
template <class S>
void act_differently(Batch<S>& batch, std::mt19937& random, double effort) {
  std::uniform_real_distribution<double> within(-effort, effort);
  for (int e = 0; e < batch.environments(); ++e)
    for (int dof = 0; dof < batch.plan().dofs(); ++dof) batch.efforts()(dof, e) = static_cast<S>(within(random));
}

}  // namespace lockstep::loop_runs
