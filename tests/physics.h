// Helpers that the tests of the physics share. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <limits>
#include <string>
#include <vector>

#include "lockstep/batch.h"
#include "reference/mechanism.h"

namespace lockstep::physics {

constexpr double epsilon = std::numeric_limits<double>::epsilon();

/// The state of one environment of a batch, as the reference represents it.
template <class S>
reference::State state_of(const Batch<S>& batch, int environment = 0) {
  reference::State state;
  const Eigen::MatrixXd poses = batch.root_poses().col(environment).matrix().template cast<double>();
  state.q = batch.positions().col(environment).matrix().template cast<double>();
  state.v.resize(batch.root_velocities().rows() + batch.velocities().rows());
  state.v << batch.root_velocities().col(environment).matrix().template cast<double>(),
      batch.velocities().col(environment).matrix().template cast<double>();
  int floating = 0;
  for (const Root& root : batch.plan().model().roots) {
    if (!root.floating) {
      state.roots.push_back({root.pose.translation(), Eigen::Quaterniond(root.pose.linear())});
      continue;
    }
    const Eigen::Matrix<double, 7, 1> pose = poses.block<7, 1>(7 * floating++, 0);
    state.roots.push_back({pose.head<3>(), Eigen::Quaterniond(pose[3], pose[4], pose[5], pose[6])});
  }
  return state;
}

/// Largest difference between two arrays; NaN if either contains a NaN or an infinity.
template <class A, class B>
double distance(const Eigen::MatrixBase<A>& a, const Eigen::MatrixBase<B>& b) {
  return a.size() == 0 ? 0.0 : (a - b).template lpNorm<Eigen::Infinity>() + 0.0 * (a - b).sum();
}

/// Expects the roots of two states at the same poses: positions to `tolerance` times their size or 1 m, orientations to
/// `tolerance`. A quaternion and its opposite are the same orientation.
void expect_same_poses(const reference::State& ours, const reference::State& theirs, double tolerance);

inline double size(const Eigen::MatrixXd& a) { return a.size() == 0 ? 0.0 : a.lpNorm<Eigen::Infinity>(); }

/// Condition number of a symmetric positive definite matrix whose diagonal is scaled to 1. A solve amplifies rounding
/// by this factor.
double condition(const Eigen::MatrixXd& h);

StepSettings settings(Method method, int iterations = 4, int velocity_iterations = 1, double dt = 1.0 / 240);

/// The tables, and compiled where this build makes machine code for this machine; of those, what takes the plan.
std::vector<Engine> engines();
std::vector<Engine> engines(const Plan& plan);

/// Options with one thread. A test of many plans runs every fourth seed by machine code, if the plan has any, and the
/// others by the tables, which cost nothing to prepare.
BatchOptions by_turns(const Plan& plan, int seed);

inline std::string numbered(const char* word, std::size_t number) {
  return std::string(word).append(std::to_string(number));
}

/// Bodies that slide along world x without gravity on joints s0, s1, ... Each is a tree of its own on a fixed base.
Model sliders(const std::vector<double>& masses);

/// The link of the scenes: a box of 0.1 x 0.04 x 0.04 m with its frame in the centre of the left end face.
inline Inertia link_box(double mass) { return Inertia::box(mass, {0.1, 0.04, 0.04}, {0.05, 0, 0}); }

/// Appends a link with a revolute joint j0, j1, ... behind the link `parent`.
Joint& append_link(Model& model, const std::string& parent, const Eigen::Vector3d& offset, const Eigen::Vector3d& axis,
                   double mass = 0.2);

/// Folder of test data outside of the project; empty if there is none.
std::string test_data();

constexpr Method methods[] = {Method::pgs, Method::tgs, Method::direct, Method::reduced};

inline std::string method_name(const testing::TestParamInfo<Method>& info) { return to_string(info.param); }

}  // namespace lockstep::physics
