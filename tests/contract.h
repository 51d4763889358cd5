// What the contract tests share. SPDX-License-Identifier: Apache-2.0
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

/// By LOCKSTEP_TEST_ENGINE: engine.cpp.
extern const bool engine_preferred;

/// `reduced` takes hard couplings for hard in all environments, so it refuses fields that say otherwise.
inline bool allows(Method method, Parameter parameter) {
  return method != Method::reduced || (parameter != Parameter::softness && parameter != Parameter::coupling_switch);
}

/// Every field that environments may differ in. A force limit goes with one softness only.
ParameterSet all_parameters(Method method, const Model& model = {});

inline StepSettings settings(Method method, ParameterSet per_environment = {}) {
  StepSettings result = physics::settings(method);
  result.per_environment = per_environment;
  result.record_impulses = true;
  return result;
}

/// The same numbers with every standard library.
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

/// The numbers of a random softness of the kind that the model states; the second number of a hard one is its cfm.
SoftnessNumbers another(const Softness& softness, Random& random);

/// Gives a fresh environment a state, inputs and declared parameters of its own. They depend on the plan and the
/// seed alone, not on where the environment stands.
template <class S>
void scatter(Batch<S>& batch, int environment, std::uint64_t seed);

/// A batch whose environment e is scattered by seed e.
template <class S>
Batch<S> scattered(const Plan& plan, int environments, const BatchOptions& options = {.threads = 1}) {
  Batch<S> batch(plan, environments, options);
  for (int e = 0; e < environments; ++e) scatter(batch, e, static_cast<std::uint64_t>(e));
  return batch;
}

/// All that a step leaves behind in one environment.
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

/// To the last bit: 0 is not -0, and one NaN is another if its bits are.
template <class S>
bool same_bits(const std::vector<S>& a, const std::vector<S>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(S)) == 0);
}

template <class S>
testing::AssertionResult same_bits(const Batch<S>& a, int i, const Batch<S>& b, int j) {
  if (a.faults()[i] != b.faults()[j])
    return testing::AssertionFailure() << "environments " << i << " and " << j << " have other faults";
  const std::vector<S> left = outcome(a, i), right = outcome(b, j);
  if (same_bits(left, right)) return testing::AssertionSuccess();
  for (std::size_t k = 0; k < left.size(); ++k)
    if (std::memcmp(&left[k], &right[k], sizeof(S)) != 0)
      return testing::AssertionFailure() << "environments " << i << " and " << j << " differ: number " << k << " is "
                                         << testing::PrintToString(left[k]) << " and "
                                         << testing::PrintToString(right[k]);
  return testing::AssertionFailure();
}

/// Environment by environment, but for `except`.
template <class S>
testing::AssertionResult same_bits(const Batch<S>& a, const Batch<S>& b, int except = -1) {
  for (int e = 0; e < std::min(a.environments(), b.environments()); ++e)
    if (e != except)
      if (const auto same = same_bits(a, e, b, e); !same) return same;
  return testing::AssertionSuccess();
}

/// The model that says what one environment has in its fields, its state and its inputs.
Model model_of(Batch<double>& batch, int environment);

/// [6][links] of one environment; zero where the field is not declared.
Eigen::MatrixXd wrenches_of(Batch<double>& batch, int environment);

/// All at rest, with followers where their environment's others put them, but for rounding: some steps do the rest.
template <class S>
void put_consistent(Batch<S>& batch);

/// Where all followers are in place a step is shorter, and its bits are those of the same environments between others
/// whose followers are not.
template <class S>
void expect_the_same_bits_where_consistent(const Plan& plan, int environments, const BatchOptions& options);

}  // namespace lockstep::contract
