// Helpers that the contract tests share. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "model/softness_numbers.h"
#include "physics.h"
#include "scenes/scenes.h"
#include "twins/twins.h"

namespace lockstep::contract {

inline constexpr BatchOptions serial = {.threads = 1};

/// Whether LOCKSTEP_TEST_ENGINE chose an engine: see engine.cpp.
extern const bool engine_preferred;

/// `reduced` relies on hard couplings being hard in all environments, so it refuses fields that could soften them.
inline bool allows(Method method, Parameter parameter) {
  return method != Method::reduced || (parameter != Parameter::softness && parameter != Parameter::coupling_switch);
}

/// Every parameter that may differ per environment but friction, which makes a row of every joint. The model's force
/// limits rule out a softness per environment.
ParameterSet all_parameters(Method method, const Model& model = {});

inline StepSettings settings(Method method, ParameterSet per_environment = {}) {
  StepSettings result = physics::settings(method);
  result.guard = StepSettings().guard;
  result.per_environment = per_environment;
  result.record_impulses = true;
  return result;
}

/// Random numbers that are the same with every standard library.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_() >> 11) * 0x1p-53);
  }
  bool chance(double probability) { return uniform(0.0, 1.0) < probability; }

 private:
  std::mt19937_64 engine_;
};

/// Random numbers for a softness of the same kind. The second number of a hard one is its cfm.
SoftnessNumbers another(const Softness& softness, Random& random);

/// Gives an environment in its start state a random state, inputs and declared parameters. They depend on the plan and
/// the seed only, not on the place of the environment.
template <class S>
void scatter(Batch<S>& batch, int environment, std::uint64_t seed);

/// A batch whose environment e is scattered with seed e.
template <class S>
Batch<S> scattered(const Plan& plan, int environments, const BatchOptions& options = {.threads = 1}) {
  Batch<S> batch(plan, environments, options);
  for (int e = 0; e < environments; ++e) scatter(batch, e, static_cast<std::uint64_t>(e));
  return batch;
}

/// The state of one environment after a step: all numbers in one vector.
template <class S>
std::vector<S> outcome(const Batch<S>& batch, int environment) {
  std::vector<S> numbers;
  const auto append = [&](const auto& rows) {
    for (Eigen::Index row = 0; row < rows.rows(); ++row) numbers.push_back(rows(row, environment));
  };
  append(batch.positions());
  append(batch.velocities());
  append(batch.root_poses());
  append(batch.root_velocities());
  return numbers;
}

/// Compares bits: 0 differs from -0, and NaNs are equal if their bits are.
template <class S>
bool same_bits(const std::vector<S>& a, const std::vector<S>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(S)) == 0);
}

template <class S>
testing::AssertionResult same_bits(const Batch<S>& a, int i, const Batch<S>& b, int j) {
  if (a.faults()[i] != b.faults()[j])
    return testing::AssertionFailure() << "environments " << i << " and " << j << " have different faults";
  const std::vector<S> left = outcome(a, i), right = outcome(b, j);
  if (same_bits(left, right)) return testing::AssertionSuccess();
  for (std::size_t k = 0; k < left.size(); ++k)
    if (std::memcmp(&left[k], &right[k], sizeof(S)) != 0)
      return testing::AssertionFailure() << "environments " << i << " and " << j << " differ: number " << k << " is "
                                         << testing::PrintToString(left[k]) << " and "
                                         << testing::PrintToString(right[k]);
  return testing::AssertionFailure();
}

/// Compares all environments except `except`.
template <class S>
testing::AssertionResult same_bits(const Batch<S>& a, const Batch<S>& b, int except = -1) {
  for (int e = 0; e < std::min(a.environments(), b.environments()); ++e)
    if (e != except)
      if (const auto same = same_bits(a, e, b, e); !same) return same;
  return testing::AssertionSuccess();
}

/// The first dof that is no tendon: what is written into a tendon's rows is not its state.
int first_joint(const Plan& plan);

/// A model with the parameters, the state and the inputs of one environment.
Model model_of(Batch<double>& batch, int environment);

/// Link wrenches [6][links] of one environment; zero if the parameter is not declared.
Eigen::MatrixXd wrenches_of(Batch<double>& batch, int environment);

/// Stops all environments and moves their followers onto the couplings, up to rounding. A few steps make them
/// consistent to the last bit.
template <class S>
void put_consistent(Batch<S>& batch);

/// A tile whose followers are all consistent takes a shorter step. Expects the same bits from environments in such
/// tiles and from the same environments beside inconsistent ones.
template <class S>
void expect_the_same_bits_where_consistent(const Plan& plan, int environments, const BatchOptions& options);

}  // namespace lockstep::contract
