// Whatever is not finite in a state is a fault, also where nothing reads it. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <set>

#include "lockstep/error.h"
#include "physics.h"
#include "scenes/any_model.h"

namespace lockstep {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

// A hinge along gravity: no force depends on its angle, which nothing but its range reads.
TEST(Fault, is_found_where_nothing_reads_what_is_not_finite) {
  Model model;
  model.links = {{"base", {}}};
  physics::append_link(model, "base", Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitZ(), 0.2);
  physics::append_link(model, model.joints[0].child, Eigen::Vector3d(0, 0, 0.1), Eigen::Vector3d::UnitY(), 0.2);
  for (Joint& joint : model.joints) joint.lower = -2.9, joint.upper = 2.9;
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog})
    for (const bool ranged : {true, false}) {
      for (Joint& joint : model.joints)
        if (!ranged) joint.lower = -infinity, joint.upper = infinity;
      const Plan plan = compile(model, {.integrator = integrator});
      for (const Engine engine : physics::engines(plan))
        for (const int dof : {0, 1})
          for (const double number : {nan, HUGE_VAL, -HUGE_VAL}) {
            SCOPED_TRACE(fmt::format("{} {} {} {} {}", to_string(integrator), ranged, to_string(engine), dof, number));
            Batch<float> positions(plan, 3, {.threads = 1, .engine = engine}),
                velocities(plan, 3, {.threads = 1, .engine = engine});
            positions.positions()(dof, 1) = velocities.velocities()(dof, 1) = static_cast<float>(number);
            for (Batch<float>* batch : {&positions, &velocities}) {
              batch->step();
              EXPECT_EQ(batch->faults()[1], Fault::not_finite);
              EXPECT_EQ(batch->faulted(), 1);
            }
          }
    }
}

// Writes NaN and infinity into every row of the state that is not placed by others.
template <class S>
void expect_found(const Plan& plan, Engine engine) {
  Batch<S> batch(plan, 3, {.threads = 1, .engine = engine});
  std::set<int> placed(plan.follower_dofs().begin(), plan.follower_dofs().end());
  const std::vector<std::string>& names = plan.dof_names();
  for (const Joint& joint : plan.model().joints)
    if (joint.kind == JointKind::tendon) placed.insert(plan.dof(joint.name));
  for (const int part : {0, 1, 2, 3}) {
    const auto rows = [&]() -> typename Batch<S>::View {
      return part == 0   ? batch.positions()
             : part == 1 ? batch.velocities()
             : part == 2 ? batch.root_poses()
                         : batch.root_velocities();
    };
    for (int row = 0; row < rows().rows(); ++row)
      for (const double number : {nan, HUGE_VAL}) {
        if (part < 2 && placed.contains(row)) continue;
        SCOPED_TRACE(fmt::format("part {}, {}, {}", part, part < 2 ? names[row] : fmt::to_string(row), number));
        batch.reset();
        rows()(row, 1) = static_cast<S>(number);
        batch.step();
        EXPECT_NE(batch.faults()[1], Fault::none);
      }
  }
}

TEST(Fault, finds_whatever_is_not_finite_in_random_models_of_every_feature) {
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    SCOPED_TRACE(seed);
    const std::vector<std::uint8_t> bytes = scenes::bytes_of(seed);
    scenes::AnyModel any(bytes);
    const Model model = any.model();
    const StepSettings settings = any.settings();
    try {
      const Plan plan = compile(model, settings);
      for (const Engine engine : {Engine::tables, Engine::automatic})
        seed % 2 == 0 ? expect_found<float>(plan, engine) : expect_found<double>(plan, engine);
    } catch (const Error&) {  // refused
    }
  }
}

// A body whose distance has no square stands where it stands, and cannot be stepped.
TEST(Fault, finds_bodies_too_far_away_for_their_squares) {
  for (const double far : {1e155, 1e300}) {
    Model model;
    model.links = {{"base", {}}, {"near", Inertia::box(1.0, {0.1, 0.1, 0.1}, {0.1, 0, 0})}};
    model.links.push_back({"far", model.links[1].inertia});
    for (const char* name : {"near", "far"}) {
      Joint joint;
      joint.name = name, joint.child = name, joint.parent = model.joints.empty() ? "base" : "near";
      joint.kind = JointKind::continuous, joint.axis = {0, 1, 0};
      if (!model.joints.empty()) joint.origin.translation() = Eigen::Vector3d(far, 0, 0);
      model.joints.push_back(joint);
    }
    Batch<double> batch(compile(model), 1, {.threads = 1});
    batch.step();
    EXPECT_NE(batch.faults()[0], Fault::none) << far;
  }
}

}  // namespace
}  // namespace lockstep
