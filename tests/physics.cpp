// Helpers that the tests of the physics share. SPDX-License-Identifier: Apache-2.0
#include "physics.h"

#include <algorithm>
#include <cstdlib>

#include "batch/engine.h"
#include "scenes/scenes.h"
#include "targets/dispatch.h"

namespace lockstep::physics {

double condition(const Eigen::MatrixXd& h) {
  if (h.size() == 0) return 1.0;
  const Eigen::VectorXd scale = h.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * h * scale.asDiagonal();
  const Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(scaled).eigenvalues();
  return values.maxCoeff() / std::max(values.minCoeff(), epsilon * values.maxCoeff());
}

void expect_same_poses(const reference::State& ours, const reference::State& theirs, double tolerance) {
  ASSERT_EQ(ours.roots.size(), theirs.roots.size());
  for (std::size_t tree = 0; tree < ours.roots.size(); ++tree) {
    const reference::RootPose &a = ours.roots[tree], &b = theirs.roots[tree];
    EXPECT_LE(distance(a.position, b.position), tolerance * std::max(1.0, size(b.position))) << "position " << tree;
    const double sign = a.orientation.dot(b.orientation) < 0.0 ? -1.0 : 1.0;
    EXPECT_LE(distance(a.orientation.coeffs(), (sign * b.orientation.coeffs()).eval()), tolerance)
        << "orientation " << tree;
  }
}

StepSettings settings(Method method, int iterations, int velocity_iterations, double dt) {
  StepSettings result;
  result.dt = dt;
  result.method = method;
  result.integrator = Integrator::euler;
  result.iterations = iterations;
  result.velocity_iterations = velocity_iterations;
  result.guard = infinity;  // tests of formulas move as wildly as they like
  return result;
}

std::vector<Engine> engines(const Plan& plan) {
  std::vector<Engine> all = {Engine::tables};
  if (code_obstacle<double>(plan, resolve(Target::automatic)).empty()) all.push_back(Engine::compiled);
  return all;
}
std::vector<Engine> engines() { return engines(compile(scenes::chain8())); }

BatchOptions by_turns(const Plan& plan, int seed) {
  return {.threads = 1, .engine = seed % 4 == 0 ? engines(plan).back() : Engine::tables};
}

Model sliders(const std::vector<double>& masses) {
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

Joint& append_link(Model& model, const std::string& parent, const Eigen::Vector3d& offset, const Eigen::Vector3d& axis,
                   double mass) {
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

std::string test_data() {
  const char* folder = std::getenv("LOCKSTEP_TEST_DATA");
  return folder ? folder : LOCKSTEP_TEST_DATA;
}

}  // namespace lockstep::physics
