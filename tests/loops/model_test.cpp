// Rules for loops, how compile() closes them, and what it says of them. SPDX-License-Identifier: Apache-2.0
#include <Eigen/SVD>

#include "lockstep/error.h"
#include "loop_runs.h"
#include "model/loops.h"

namespace lockstep {
namespace {

using namespace loop_models;
using namespace loop_runs;

template <class Change>
void expect_refused(Model model, const Change& change, const char* element, const char* words) {
  change(model);
  try {
    compile(model);
    ADD_FAILURE() << "accepted, instead of: " << words;
  } catch (const ModelError& error) {
    EXPECT_EQ(error.element(), element);
    EXPECT_NE((error.rule() + "; " + error.remedy()).find(words), std::string::npos) << error.what();
  }
}

TEST(LoopRules, name_the_loop_the_rule_and_the_remedy) {
  const auto refused = [](const auto& change, const char* words) {
    expect_refused(
        four_bar(), [&](Model& m) { change(m.loops[0]); }, "loop 'loop0'", words);
  };
  refused([](Loop& l) { l.first = "rod"; }, "link 'rod', which does not exist");
  refused([](Loop& l) { l.first = l.second = ""; }, "the world to itself");
  refused([](Loop& l) { l.second = l.first; }, "one rigid body");
  refused([](Loop& l) { l.first = "", l.second = "ground"; }, "both stand still");
  refused([](Loop& l) { l.first_pose.linear() *= 2.0; }, "first pose is not a rigid transform");
  refused([](Loop& l) { l.kind = LoopKind::hinge, l.axis.setZero(); }, "axis has no length");
  refused([](Loop& l) { l.softness = Spring{}; }, "it would hold nothing");
  refused([](Loop& l) { l.softness = Hard{0.0}; }, "outside (0, 1]");
  refused([](Loop& l) { l.softness = Hard{1.5}; }, "outside (0, 1]");
  refused([](Loop& l) { l.force_limit = 0.0; }, "force limit is not above 0");
  refused([](Loop& l) { l.torque_limit = std::nan(""); }, "torque limit is not above 0");
  refused([](Loop& l) { l.kind = static_cast<LoopKind>(9); }, "none of the kinds");
  expect_refused(
      four_bar({.loops = 2}), [](Model& m) { m.loops[1].name = "loop0"; }, "loop 'loop0'", "appears twice");
}

TEST(LoopRules, name_the_gap_and_both_frames_where_a_loop_does_not_close) {
  expect_refused(
      four_bar(), [](Model& m) { m.loops[0].second_pose.translation().y() = 0.25; }, "loop 'loop0'",
      "leaves 0.25 m and 0 rad between its frame on link 'coupler' and its frame on link 'rocker'");
  expect_refused(
      four_bar(), [](Model& m) { m.loops[0].second_pose.translation().x() = 2.0; }, "loop 'loop0'",
      "correct the poses of its frames");
}

TEST(LoopRules, refuse_sweeps_and_smooth_integrators) {
  for (const Method method : {Method::pgs, Method::tgs}) {
    StepSettings s = settings(Integrator::euler);
    s.method = method;
    EXPECT_THROW(compile(four_bar(), s), SettingsError);
  }
  for (const Integrator integrator : {Integrator::extrapolated, Integrator::runge_kutta})
    EXPECT_THROW(compile(four_bar(), settings(integrator)), SettingsError);
}

// J of the host against differences of the gaps, for all kinds, floating roots and slides.
TEST(LoopJacobian, is_the_derivative_of_the_gaps) {
  for (Model model : {four_bar(), four_bar({.kind = LoopKind::hinge}), slider_crank(LoopKind::slider), stewart(),
                      bar_on_arms(), gripper()}) {
    const Trees trees(model);
    std::vector<PlacedLoop> loops;
    for (const Loop& loop : model.loops) loops.push_back(placed(model, loop));
    const Configuration at = start_of(model, trees);
    const Eigen::MatrixXd jacobian = loop_jacobian(model, trees, at, loops);
    constexpr double step = 1e-6;
    for (std::size_t j = 0; j < model.joints.size(); ++j) {
      Configuration before = at, after = at;
      before.position[j] -= step, after.position[j] += step;
      const Eigen::VectorXd slope =
          (loop_gaps(model, trees, after, loops) - loop_gaps(model, trees, before, loops)) / (2.0 * step);
      EXPECT_LT((slope - jacobian.col(static_cast<Eigen::Index>(j))).lpNorm<Eigen::Infinity>(), 1e-8) << model.name;
    }
    for (int tree = 0; tree < trees.count(); ++tree)
      for (int k = 0; k < 6 && trees.roots[tree].floating; ++k) {
        const auto moved = [&](double by) {
          Configuration here = at;
          if (k < 3)
            here.root[tree].linear() =
                Eigen::AngleAxisd(by, Eigen::Vector3d::Unit(k)).toRotationMatrix() * here.root[tree].linear();
          else
            here.root[tree].translation()[k - 3] += by;
          return loop_gaps(model, trees, here, loops);
        };
        const auto column = static_cast<Eigen::Index>(model.joints.size()) + 6 * tree + k;
        EXPECT_LT(((moved(step) - moved(-step)) / (2.0 * step) - jacobian.col(column)).lpNorm<Eigen::Infinity>(), 1e-8);
      }
  }
}

// The closest pose: what it has moved is across all motions that keep the loop closed.
TEST(LoopStart, is_closed_by_the_least_motion) {
  Model model = four_bar();
  const double by[] = {0.02, -0.03, 0.025};
  for (int j = 0; j < 3; ++j) model.joints[j].position += by[j];
  const Plan plan = compile(model);
  const Model& closed = plan.model();
  const Trees trees(closed);
  const std::vector<PlacedLoop> loops{placed(closed, closed.loops[0])};
  const Configuration at = start_of(closed, trees);
  EXPECT_LT(loop_gaps(closed, trees, at, loops).norm(), 1e-12);
  const Eigen::MatrixXd jacobian = loop_jacobian(closed, trees, at, loops).leftCols(3);
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(jacobian, Eigen::ComputeFullV);
  Eigen::Vector3d moved;
  for (int j = 0; j < 3; ++j) moved[j] = closed.joints[j].position - model.joints[j].position;
  EXPECT_GT(moved.norm(), 1e-3);
  EXPECT_LT(std::abs(svd.matrixV().col(2).dot(moved)), 0.015 * moved.norm());
}

// A head on a bar, held by a plate on two rods, all parallel. Both rods are too long by the same vector, one forth and
// one back, and what files round off: taken to the last digit the mechanism is locked, and closes at another pose. It
// is closed where it stands, and moves.
TEST(LoopStart, of_bars_that_nearly_say_the_same_twice_stays) {
  const auto rounded = [](const Vector3d& v) { return Vector3d((v * 1e7).array().round() * 1e-7); };
  const Vector3d head(0.0, 0.0, 0.02), bar(-0.03123456789, 0.0, 0.03987654321), pin(0.00812345678, 0.0, 0.00187654321),
      longer(8.1234e-6, 0.0, -3.0876e-5);
  Model model = loop_models::on_ground("neck");
  const auto link = [&](const std::string& name, const std::string& parent, const Vector3d& place) {
    loop_models::add(model, name, Inertia::box(0.05, {0.02, 0.02, 0.02}, Vector3d(0.0, 0.0, 0.01)),
                     JointKind::continuous, parent, loop_models::at(rounded(place)), Vector3d::UnitY(), 0.0, 0.0);
  };
  link("head", "ground", head);
  link("plate", "head", bar);
  for (const double side : {1.0, -1.0}) {
    const std::string rod = side > 0.0 ? "front" : "back";
    link(rod, "plate", side * pin);
    Loop loop;
    loop.name = loop.first = rod, loop.second = "ground";
    loop.first_pose.translation() = rounded(side * longer - bar);
    loop.second_pose.translation() = rounded(head + side * (pin + longer));
    model.loops.push_back(loop);
  }
  const Plan plan = compile(model);
  EXPECT_EQ(plan.loop_dependent_dofs().size(), 3u);
  Batch<double> batch(plan, 1, {.threads = 1});
  EXPECT_LT(batch.positions().abs().maxCoeff(), 1e-4);
  EXPECT_LT(batch.loop_errors().maxCoeff(), 3e-7);
  const double speeds[] = {1.0, -1.0, 1.0, 1.0};
  for (int j = 0; j < 4; ++j) batch.velocities()(j, 0) = speeds[j];
  EXPECT_TRUE(batch.project().empty());
  for (int j = 0; j < 4; ++j) EXPECT_NEAR(batch.velocities()(j, 0), speeds[j], 0.01);
}

TEST(LoopStart, keeps_mimics_and_moves_floating_roots) {
  Model model = gripper();
  model.joints[1].position += 0.1, model.joints[6].position -= 0.05;
  const Plan plan = compile(model);
  Batch<double> batch(plan, 1, {.threads = 1});
  EXPECT_LT(batch.loop_errors().maxCoeff(), 1e-12);
  EXPECT_LT(batch.coupling_errors().abs().maxCoeff(), 1e-12);

  Model platform = stewart();
  platform.roots.back().pose.translation() += Eigen::Vector3d(0.02, 0.01, -0.01);
  Batch<double> moved(compile(platform), 1, {.threads = 1});
  EXPECT_LT(moved.loop_errors().maxCoeff(), 1e-12);
}

TEST(LoopPlan, counts_redundant_rows_and_names_dependent_joints) {
  Model model = four_bar({.loops = 2});
  model.joints[0].drive.kp = 1.0;
  const Plan plan = compile(model);
  ASSERT_EQ(plan.loops().size(), 2u);
  EXPECT_EQ(plan.loops()[0].rows, 3);
  EXPECT_EQ(plan.loops()[0].redundant, 1);  // across the plane
  EXPECT_EQ(plan.loops()[1].redundant, 3);
  EXPECT_EQ(plan.loop_dependent_dofs(), (std::vector<int>{1, 2}));
  EXPECT_NE(plan.describe().find("loop0 (point, hard (erp 1))"), std::string::npos) << plan.describe();
  EXPECT_NE(plan.describe().find("by them coupler, rocker depend on the other joints"), std::string::npos);
  int redundant = 0;
  const Plan arms = compile(bar_on_arms());
  for (const PlanLoop& loop : arms.loops()) redundant += loop.redundant;
  EXPECT_EQ(redundant, 6);
  EXPECT_EQ(compile(stewart()).loop_dependent_dofs().size(), 18u);
  EXPECT_NE(plan.hash(), compile(four_bar()).hash());
}

}  // namespace
}  // namespace lockstep
