// Spatial tendons in the kernels agree with the reference, which does not know them: it takes their tensions as efforts
// and wrenches, by directions from differences of lengths. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "lockstep/plan.h"
#include "model/rotations.h"
#include "physics.h"
#include "random_bounds.h"
#include "reference/step.h"
#include "scenes/scenes.h"
#include "seeds.h"

namespace lockstep {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using physics::distance;
using physics::size;

const int seeds = seeds_of(400, 100);

// One to three tendons of one to three segments, between links of any trees and the world.
Model with_tendons(Model model, physics::Uniform& uniform) {
  const auto links = static_cast<double>(model.links.size());
  const auto link = [&] { return model.links[static_cast<std::size_t>(uniform(0.0, links - 1e-9))].name; };
  const auto point = [&] { return Vector3d(uniform(-0.3, 0.3), uniform(-0.3, 0.3), uniform(-0.3, 0.3)); };
  const int count = 1 + static_cast<int>(uniform(0.0, 2.999));
  for (int i = 0; i < count; ++i) {
    Joint tendon;
    tendon.name = physics::numbered("tendon", static_cast<std::size_t>(i));
    tendon.kind = JointKind::tendon;
    const int segments = 1 + static_cast<int>(uniform(0.0, 2.999));
    for (int s = 0; s < segments; ++s)
      tendon.path.push_back({link(), uniform(0.0, 1.0) < 0.2 ? "" : link(), point(), point(), uniform(0.3, 1.5)});
    tendon.stiffness = uniform(0.0, 200.0), tendon.rest = uniform(0.0, 0.5), tendon.damping = uniform(0.0, 5.0);
    tendon.effort = uniform(-3.0, 3.0);
    tendon.drive.kp = uniform(0.0, 50.0), tendon.drive.kd = uniform(0.0, 2.0);
    tendon.drive.position_target = uniform(0.0, 0.5), tendon.drive.velocity_target = uniform(-0.2, 0.2);
    model.joints.push_back(tendon);
    try {
      model.validate();
    } catch (const std::exception&) {  // its length never changes
      model.joints.pop_back();
    }
  }
  return model;
}

// By tendon, from poses of the links by rotation matrices.
VectorXd lengths(const Model& model, const reference::Mechanism& without, const reference::State& state) {
  const std::vector<Eigen::Isometry3d> poses = without.link_poses(state);
  const auto place = [&](const std::string& link, const Vector3d& at) -> Vector3d {
    return link.empty() ? at : poses[static_cast<std::size_t>(model.link_index(link))] * at;
  };
  std::vector<double> all;
  for (const Joint& joint : model.joints) {
    if (joint.kind != JointKind::tendon) continue;
    all.push_back(0.0);
    for (const TendonSegment& s : joint.path)
      all.back() += s.share * (place(s.second, s.second_point) - place(s.first, s.first_point)).norm();
  }
  return Eigen::Map<VectorXd>(all.data(), static_cast<Eigen::Index>(all.size()));
}

// [tendons][velocities], by central differences.
MatrixXd directions(const Model& model, const reference::Mechanism& without, const reference::State& state) {
  constexpr double h = 1e-6;
  MatrixXd all(lengths(model, without, state).size(), without.velocities());
  for (int k = 0; k < without.velocities(); ++k) {
    const VectorXd way = VectorXd::Unit(without.velocities(), k);
    all.col(k) = (lengths(model, without, without.advanced(state, way, h)) -
                  lengths(model, without, without.advanced(state, way, -h))) /
                 (2.0 * h);
  }
  return all;
}

// The inputs with forces along the velocities.
reference::Inputs with_forces(const reference::Mechanism& without, const reference::State& state,
                              const VectorXd& forces) {
  reference::Inputs inputs = without.initial_inputs();
  inputs.efforts += forces.tail(without.dofs());
  for (int tree = 0; tree < without.trees().count(); ++tree) {
    const int first = without.root_velocity(tree);
    if (first < 0) continue;
    const Eigen::Quaterniond turn = state.roots[static_cast<std::size_t>(tree)].orientation;
    const int link = without.trees().root_link[static_cast<std::size_t>(tree)];
    inputs.wrenches.col(link).head<3>() += turn * forces.segment<3>(first);
    inputs.wrenches.col(link).tail<3>() += turn * forces.segment<3>(first + 3);
  }
  return inputs;
}

TEST(SpatialTendons, agree_with_the_reference_after_one_step_beside_everything_linear) {
  int tendons = 0, floating = 0;
  for (int seed = 0; seed < seeds && !HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    physics::Uniform uniform{std::mt19937_64(static_cast<std::uint64_t>(5000 + seed))};
    scenes::RandomOptions options = scenes::forests();
    options.max_trees = 3, options.max_dofs = 7, options.coupling_error = false;
    const Model plain = scenes::random_model(static_cast<std::uint64_t>(seed), options);
    const Model model = with_tendons(plain, uniform);
    const auto count = static_cast<Eigen::Index>(model.joints.size() - plain.joints.size());
    if (count == 0) continue;
    const reference::Mechanism without(plain);
    const StepSettings settings = physics::settings(Method::reduced);
    const double h = settings.dt;

    // The tensions of linear springs and servos follow from what they do: v = v_0 + W tension.
    const reference::State start = without.initial_state();
    const MatrixXd along = directions(model, without, start);
    const VectorXd length = lengths(model, without, start);
    const auto stepped = [&](const VectorXd& tension) {
      return reference::step(without, settings, start, with_forces(without, start, along.transpose() * tension));
    };
    MatrixXd system = MatrixXd::Identity(count, count), moved(without.velocities(), count);
    VectorXd right(count);
    // Velocities of roots are compared along the axes that they have before the step.
    const auto in_old_axes = [&](const reference::Step& step) {
      VectorXd v = step.state.v;
      for (int tree = 0; tree < without.trees().count(); ++tree) {
        const int first = without.root_velocity(tree);
        if (first < 0) continue;
        const Eigen::Quaterniond turn = start.roots[static_cast<std::size_t>(tree)].orientation.conjugate() *
                                        step.state.roots[static_cast<std::size_t>(tree)].orientation;
        v.segment<3>(first) = turn * v.segment<3>(first), v.segment<3>(first + 3) = turn * v.segment<3>(first + 3);
      }
      return v;
    };
    const VectorXd base = in_old_axes(stepped(VectorXd::Zero(count)));
    for (Eigen::Index i = 0; i < count; ++i) moved.col(i) = in_old_axes(stepped(VectorXd::Unit(count, i))) - base;
    for (Eigen::Index i = 0; i < count; ++i) {
      const Joint& tendon = model.joints[plain.joints.size() + static_cast<std::size_t>(i)];
      const double stiff = tendon.stiffness + tendon.drive.kp, slow = tendon.damping + tendon.drive.kd + h * stiff;
      system.row(i) += slow * along.row(i) * moved;
      right[i] = tendon.effort - tendon.stiffness * (length[i] - tendon.rest) +
                 tendon.drive.kp * (tendon.drive.position_target - length[i]) +
                 tendon.drive.kd * tendon.drive.velocity_target - slow * along.row(i).dot(base);
    }
    const reference::Step theirs = stepped(system.partialPivLu().solve(right));

    const Plan plan = compile(model, settings);
    Batch<double> batch(plan, 1, physics::by_turns(plan, seed));
    EXPECT_LE(distance(batch.positions().col(0).tail(count).matrix(), length), 1e-12);
    EXPECT_LE(distance(batch.velocities().col(0).tail(count).matrix(), along * start.v),
              1e-7 * std::max(1.0, size(start.v)));
    batch.step();
    EXPECT_EQ(batch.faults()[0], Fault::none);
    const reference::State ours = physics::state_of(batch);
    const double moving = std::max({1.0, size(start.v), size(theirs.state.v)});
    EXPECT_LE(distance(ours.v.head(without.velocities()), theirs.state.v), 1e-7 * moving);
    EXPECT_LE(distance(ours.q.head(without.dofs()), theirs.state.q), 1e-7 * moving);
    physics::expect_same_poses(ours, theirs.state, 1e-7);
    EXPECT_LE(distance(ours.q.tail(count), lengths(model, without, theirs.state)), 1e-7 * moving);
    EXPECT_LE(distance(ours.v.tail(count), directions(model, without, theirs.state) * theirs.state.v), 1e-6 * moving);
    tendons += static_cast<int>(count);
    for (const Root& root : model.roots) floating += root.floating;
  }
  EXPECT_GT(tendons, seeds);
  EXPECT_GT(floating, seeds / 4);
}

}  // namespace
}  // namespace lockstep
