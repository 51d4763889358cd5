// What a batch says of its solves, and that nothing of an environment depends on its company there.
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <random>

#include "contact_scenes.h"

namespace lockstep {
namespace {

using namespace contact_scenes;

TEST(SolveCounts, of_a_block_at_rest_are_four_points_and_a_round_a_step) {
  Batch<double> batch(compile(block()), 3, {.threads = 1});
  EXPECT_NE(batch.describe().find("no step yet"), std::string::npos);
  batch.step(200);
  batch.step(10);
  const Eigen::ArrayXXd counts = counts_of(batch);
  for (int e = 0; e < 3; ++e) {
    EXPECT_EQ(counts(0, e), 10.0);  // steps of the last call
    EXPECT_EQ(counts(1, e), 10.0);  // pairs near
    EXPECT_EQ(counts(2, e), 40.0);  // points that could act
    EXPECT_EQ(counts(3, e), 40.0);  // points that pressed
    EXPECT_EQ(counts(4, e), 10.0);  // solves
    EXPECT_EQ(counts(6, e), 10.0);  // rounds
  }
  EXPECT_NE(batch.describe().find("1 pairs declared, 1.0 near; 4.0 points could act, 4.0 pressed"), std::string::npos)
      << batch.describe();
}

TEST(SolveCounts, are_zero_where_nothing_is_near) {
  Model model = block();
  model.roots[0].pose.translation().z() = 10.0;
  Batch<float> batch(compile(model), 2, {.threads = 1});
  batch.step(5);
  const Eigen::ArrayXXd counts = counts_of(batch);
  EXPECT_EQ(counts(0, 0), 5.0);
  EXPECT_EQ(counts.bottomRows(10).abs().maxCoeff(), 0.0);
}

TEST(SolveCounts, have_no_rows_in_a_plan_without_contacts) {
  Model model = block();
  model.contacts.clear();
  Batch<double> batch(compile(model), 2, {.threads = 1});
  EXPECT_EQ(batch.plan().query_rows({Quantity::solve_counts}), 0);
  EXPECT_NE(batch.describe().find("Nothing in its steps"), std::string::npos);
}

TEST(SolveCounts, of_rows_without_contacts_are_those_of_their_solves) {
  Model model = finger();
  model.contacts.clear();
  StepSettings settings;
  settings.integrator = Integrator::leapfrog;
  Batch<double> batch(compile(model, settings), 2, {.threads = 1});
  EXPECT_NE(batch.describe().find("needed no rounds"), std::string::npos) << batch.describe();
  batch.step(400);
  const Eigen::ArrayXXd counts = counts_of(batch);
  ASSERT_EQ(counts.rows(), 11);
  EXPECT_GT(counts(4, 0), 0.0);
  EXPECT_GE(counts(6, 0), counts(4, 0));
  EXPECT_NE(batch.describe().find("In the mean of a solve"), std::string::npos) << batch.describe();
}

// Walkers with limits, friction and targets of their own. Each walks once among others and once alone.
TEST(SolveCounts, and_all_readings_of_an_environment_do_not_depend_on_its_company) {
  constexpr int environments = 24;
  Model model = quadruped();
  for (Joint& joint : model.joints)
    if (joint.drive.kp > 0.0)
      joint.lower = joint.position - 0.3, joint.upper = joint.position + 0.3, joint.friction = 0.3,
      joint.effort_limit = 20.0;
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    StepSettings settings;
    settings.integrator = integrator;
    settings.record_diagnostics = integrator == Integrator::euler;
    const Plan plan = compile(model, settings);
    Batch<float> together(plan, environments, {.threads = 1});
    std::vector<Batch<float>> alone;
    for (int e = 0; e < environments; ++e) alone.emplace_back(plan, 1, BatchOptions{.threads = 1});
    std::mt19937 random(5);
    std::uniform_real_distribution<float> target(-0.5f, 1.5f);
    for (int control = 0; control < 40; ++control) {
      for (int e = 0; e < environments; ++e)
        for (Eigen::Index j = 0; j < together.position_targets().rows(); ++j)
          together.position_targets()(j, e) = alone[e].position_targets()(j, 0) = target(random);
      together.step(6);
      const Eigen::ArrayXXd counts = counts_of(together);
      for (int e = 0; e < environments; ++e) {
        alone[e].step(6);
        ASSERT_TRUE((together.root_poses().col(e) == alone[e].root_poses().col(0)).all());
        ASSERT_TRUE((counts.col(e).head(8) == counts_of(alone[e]).col(0).head(8)).all());
        if (!settings.record_diagnostics) continue;
        ASSERT_TRUE((together.row_residuals().col(e) == alone[e].row_residuals().col(0)).all()) << e;
        ASSERT_TRUE((together.energy_balances().col(e) == alone[e].energy_balances().col(0)).all())
            << e << "\n"
            << together.energy_balances().col(e) - alone[e].energy_balances().col(0);
      }
    }
    EXPECT_GT(counts_of(together).row(6).sum(), 0.0);
  }
}

}  // namespace
}  // namespace lockstep
