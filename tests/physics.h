// What the tests of the physics share. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cstdlib>
#include <limits>
#include <string>
#include <vector>

#include "lockstep/batch.h"
#include "reference/mechanism.h"

namespace lockstep::physics {

constexpr double epsilon = std::numeric_limits<double>::epsilon();

/// One environment of a batch as the reference sees it.
template <class S>
reference::State state_of(const Batch<S>& batch, int environment = 0) {
  reference::State state;
  const int dofs = batch.plan().dofs(), root = batch.plan().floating() ? 6 : 0;
  state.q = batch.positions().col(environment).matrix().template cast<double>();
  state.v.resize(root + dofs);
  state.v.tail(dofs) = batch.velocities().col(environment).matrix().template cast<double>();
  if (root > 0) {
    const Eigen::VectorXd pose = batch.root_poses().col(environment).matrix().template cast<double>();
    state.position = pose.head<3>();
    state.orientation = Eigen::Quaterniond(pose[3], pose[4], pose[5], pose[6]);
    state.v.head(6) = batch.root_velocities().col(environment).matrix().template cast<double>();
  } else {
    const Eigen::Isometry3d& pose = batch.plan().model().root.pose;
    state.position = pose.translation();
    state.orientation = Eigen::Quaterniond(pose.linear());
  }
  return state;
}

/// Largest difference of two arrays; NaN where either has one.
template <class A, class B>
double distance(const Eigen::MatrixBase<A>& a, const Eigen::MatrixBase<B>& b) {
  return a.size() == 0 ? 0.0 : (a - b).template lpNorm<Eigen::Infinity>() + 0.0 * (a - b).sum();
}

inline double size(const Eigen::MatrixXd& a) { return a.size() == 0 ? 0.0 : a.lpNorm<Eigen::Infinity>(); }

/// Of a symmetric positive definite matrix after scaling its diagonal to 1: what a solve multiplies rounding by.
inline double condition(const Eigen::MatrixXd& h) {
  if (h.size() == 0) return 1.0;
  const Eigen::VectorXd scale = h.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * h * scale.asDiagonal();
  const Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(scaled).eigenvalues();
  return values.maxCoeff() / std::max(values.minCoeff(), epsilon * values.maxCoeff());
}

inline StepSettings settings(Method method, int iterations = 4, int velocity_iterations = 1, double dt = 1.0 / 240) {
  StepSettings result;
  result.dt = dt;
  result.method = method;
  result.integrator = Integrator::euler;
  result.iterations = iterations;
  result.velocity_iterations = velocity_iterations;
  return result;
}

inline std::string numbered(const char* word, std::size_t number) {
  return std::string(word).append(std::to_string(number));
}

/// Bodies that slide along world x on a fixed base, each a tree of its own: joints s0, s1, ..., no gravity.
inline Model sliders(const std::vector<double>& masses) {
  Model model;
  model.name = "sliders";
  model.links = {{"base", {}}};
  model.gravity.setZero();
  for (std::size_t i = 0; i < masses.size(); ++i) {
    Joint joint;
    joint.name = numbered("s", i);
    joint.kind = JointKind::prismatic;
    joint.parent = "base";
    joint.child = numbered("body", i);
    model.links.push_back({joint.child, Inertia::box(masses[i], {0.1, 0.1, 0.1}, Eigen::Vector3d::Zero())});
    model.joints.push_back(joint);
  }
  return model;
}

/// The link of the scenes, 0.1 x 0.04 x 0.04 m: its frame in the centre of the left end face.
inline Inertia link_box(double mass) { return Inertia::box(mass, {0.1, 0.04, 0.04}, {0.05, 0, 0}); }

/// Appends a link with a revolute joint j0, j1, ... behind the link `parent`.
inline Joint& append_link(Model& model, const std::string& parent, const Eigen::Vector3d& offset,
                          const Eigen::Vector3d& axis, double mass = 0.2) {
  const std::size_t number = model.joints.size();
  model.links.push_back({numbered("l", number), link_box(mass)});
  Joint joint;
  joint.name = numbered("j", number);
  joint.kind = JointKind::revolute;
  joint.parent = parent;
  joint.child = numbered("l", number);
  joint.origin.translation() = offset;
  joint.axis = axis;
  model.joints.push_back(joint);
  return model.joints.back();
}

/// Folder of files that are not part of the project; empty where there is none.
inline std::string test_data() {
  const char* folder = std::getenv("LOCKSTEP_TEST_DATA");
  return folder ? folder : LOCKSTEP_TEST_DATA;
}

constexpr Method methods[] = {Method::pgs, Method::tgs, Method::direct, Method::reduced};

inline std::string method_name(const testing::TestParamInfo<Method>& info) { return name(info.param); }

}  // namespace lockstep::physics
