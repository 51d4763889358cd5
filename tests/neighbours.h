// Whether an environment moves, and is read, to the last bit as among copies of itself. SPDX-License-Identifier:
// Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "contact_scenes.h"
#include "lockstep/error.h"

namespace lockstep::neighbours {

constexpr int copies = 16;  ///< as many environments as a tile has at most

/// Columns of one batch against every 16th of another.
template <class A>
bool same(const A& mixed, const A& alone) {
  for (Eigen::Index e = 0; e < mixed.cols(); ++e)
    for (Eigen::Index row = 0; row < mixed.rows(); ++row) {
      const auto a = mixed(row, e), b = alone(row, e * copies);
      if (std::memcmp(&a, &b, sizeof a) != 0) return false;
    }
  return true;
}

template <class S>
struct Reading {
  std::string name;
  std::function<Eigen::ArrayXXd(const Batch<S>&)> read;
};

/// Whatever a plan can be asked for. The counts of solves are those of tiles in part.
template <class S>
std::vector<Reading<S>> readings_of(const Batch<S>& batch) {
  const auto wide = [](const auto& array) -> Eigen::ArrayXXd { return array.template cast<double>(); };
  std::vector<Reading<S>> known = {
      {"row_states", [=](const Batch<S>& b) { return wide(b.row_states()); }},
      {"row_residuals", [=](const Batch<S>& b) { return wide(b.row_residuals()); }},
      {"energy_balances", [=](const Batch<S>& b) { return wide(b.energy_balances()); }},
      {"coupling_impulses", [=](const Batch<S>& b) { return wide(b.coupling_impulses()); }},
  };
  for (int q = 0; q < static_cast<int>(Quantity::height_scan); ++q)
    if (const auto quantity = static_cast<Quantity>(q); quantity != Quantity::solve_counts)
      known.push_back({to_string(quantity), [=](const Batch<S>& b) { return contact_scenes::read(b, quantity); }});
  std::erase_if(known, [&](const Reading<S>& reading) {
    try {
      reading.read(batch);
      return false;
    } catch (const Error&) {  // what the plan does not record
      return true;
    }
  });
  return known;
}

/// Steps a batch, and beside it another one of the same plan, which has each environment in tiles of its own. Before
/// each step act(batch) writes targets and efforts.
template <class S, class Act>
void expect_none_matters(Batch<S>& mixed, int steps, const Act& act) {
  Batch<S> alone(mixed.plan(), mixed.environments() * copies, {.threads = 1, .engine = mixed.engine()});
  std::vector<int> into, from;
  for (int i = 0; i < alone.environments(); ++i) into.push_back(i), from.push_back(i / copies);
  const std::vector<Reading<S>> readings = readings_of(mixed);
  for (int step = 0; step < steps; ++step) {
    SCOPED_TRACE(testing::Message() << "step " << step << " by " << to_string(mixed.engine()));
    act(mixed);
    alone.restore(mixed.save(), into, from);
    mixed.step(), alone.step();
    ASSERT_TRUE(same(mixed.positions(), alone.positions()));
    ASSERT_TRUE(same(mixed.velocities(), alone.velocities()));
    ASSERT_TRUE(same(mixed.root_poses(), alone.root_poses()));
    ASSERT_TRUE(same(mixed.root_velocities(), alone.root_velocities()));
    for (std::size_t e = 0; e < static_cast<std::size_t>(mixed.environments()); ++e)
      ASSERT_EQ(mixed.faults()[e], alone.faults()[e * copies]);
    for (const Reading<S>& reading : readings)
      ASSERT_TRUE(same(reading.read(mixed), reading.read(alone))) << reading.name;
  }
}

}  // namespace lockstep::neighbours
