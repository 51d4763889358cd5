// What the tests of save() and restore() share. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <numeric>
#include <set>

#include "batch/blob.h"
#include "bounded_scenes.h"
#include "contact_scenes.h"
#include "lockstep/error.h"
#include "lockstep/version.h"
#include "plan/program.h"

namespace lockstep::saves {

using Bytes = std::vector<std::byte>;

constexpr int several = 19;
constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

// The error that act() throws, in words; empty if none.
template <class Act>
std::string refusal(Act act) {
  try {
    act();
  } catch (const UsageError& error) {
    return error.what();
  }
  return {};
}

inline void expect_words(const std::string& text, const std::vector<std::string>& parts) {
  for (const std::string& part : parts) EXPECT_NE(text.find(part), std::string::npos) << part << " in: " << text;
}

inline std::string hex(std::uint64_t hash) {
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(hash));
  return text;
}

// Everything that an environment shows, state, inputs, parameters, counts and faults, without save().
template <class S>
std::vector<S> shown(Batch<S>& batch, int e) {
  std::vector<S> numbers = contract::outcome(batch, e);
  const auto append = [&](const auto& rows) {
    for (Eigen::Index row = 0; row < rows.rows(); ++row) numbers.push_back(rows(row, e));
  };
  append(batch.position_targets());
  append(batch.velocity_targets());
  append(batch.efforts());
  append(batch.angles());
  append(batch.turns());
  for (unsigned p = 0; p < parameter_count; ++p)
    if (batch.plan().settings().per_environment.contains(Parameter{p})) append(batch.parameter(Parameter{p}));
  const FaultReport report = batch.fault_report(e);
  for (const double number : {static_cast<double>(batch.steps()[e]), static_cast<double>(batch.resets()[e]),
                              static_cast<double>(report.fault), static_cast<double>(report.stage),
                              static_cast<double>(report.dof), static_cast<double>(report.step)})
    numbers.push_back(static_cast<S>(number));
  return numbers;
}

template <class S>
testing::AssertionResult same(Batch<S>& a, int i, Batch<S>& b, int j) {
  const std::vector<S> left = shown(a, i), right = shown(b, j);
  if (contract::same_bits(left, right)) return testing::AssertionSuccess();
  for (std::size_t k = 0; k < left.size(); ++k)
    if (std::memcmp(&left[k], &right[k], sizeof(S)) != 0)
      return testing::AssertionFailure() << "environments " << i << " and " << j << ": number " << k << " is "
                                         << left[k] << " and " << right[k];
  return testing::AssertionFailure();
}

// Scattered, with other counts of steps and resets, and with two frozen environments.
template <class S>
Batch<S> used(const Plan& plan, const BatchOptions& options = {.threads = 1}) {
  Batch<S> batch = contract::scattered<S>(plan, several, options);
  batch.step(5);
  batch.reset(std::vector<int>{6, 11});
  batch.reset(std::vector<int>{6});
  contract::scatter(batch, 6, 77);
  batch.velocities()(0, 3) = static_cast<S>(not_a_number);
  batch.positions()(0, 14) = S(1e30);
  batch.step(3);
  EXPECT_NE(batch.faults()[3], Fault::none);
  return batch;
}

// A small batch with sections of every kind, faults among them.
struct Small {
  Plan plan = compile(scenes::chain8(), {.per_environment = {Parameter::damping}});
  Batch<float> batch{plan, 3, {.threads = 1}};
  Bytes blob;
  Small() {
    for (int e = 0; e < 3; ++e) contract::scatter(batch, e, static_cast<std::uint64_t>(e));
    batch.velocities()(0, 1) = static_cast<float>(not_a_number);
    batch.step(2);
    blob = batch.save();
    batch.step(3);
  }
};

}  // namespace lockstep::saves
