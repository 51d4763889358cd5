// The scenes are valid, and the random ones respect their options. SPDX-License-Identifier: Apache-2.0
#include "scenes.h"

#include <gtest/gtest.h>

#include <set>

namespace lockstep {
namespace {

TEST(Scenes, are_valid_and_complete) {
  for (const std::string& name : scenes::names()) {
    const scenes::Scene scene = scenes::scene(name);
    EXPECT_EQ(scene.model.name, name);
    EXPECT_NO_THROW(scene.model.validate()) << name;
    ASSERT_EQ(scene.targets(0.0).size(), static_cast<Eigen::Index>(scene.model.joints.size()));
    for (std::size_t i = 0; i < scene.model.joints.size(); ++i)
      EXPECT_EQ(scene.model.joints[i].drive.position_target, scene.targets(0.0)[i]) << name;
  }
}

double coupling_error(const Model& model, const Coupling& coupling, double Joint::*field, double offset) {
  double error = model.joints[model.joint_index(coupling.joint)].*field + offset;
  for (const CouplingTerm& term : coupling.terms)
    error += term.ratio * (model.joints[model.joint_index(term.joint)].*field);
  return error;
}

TEST(RandomModel, is_valid_and_reproducible) {
  std::set<std::size_t> kinds;
  int floating = 0, fixed_joints = 0;
  for (int seed = 0; seed < 200; ++seed) {
    const Model model = scenes::random_model(seed), again = scenes::random_model(seed);
    ASSERT_NO_THROW(model.validate()) << seed;
    ASSERT_EQ(model.joints.size(), again.joints.size());
    for (std::size_t j = 0; j < model.joints.size(); ++j) {
      EXPECT_EQ(model.joints[j].position, again.joints[j].position);
      fixed_joints += !model.joints[j].moves();
    }
    floating += model.roots[0].floating;
    for (const Coupling& coupling : model.couplings) kinds.insert(coupling.softness.index());
  }
  EXPECT_EQ(kinds.size(), 4u);
  EXPECT_GT(floating, 50);
  EXPECT_LT(floating, 150);
  EXPECT_GT(fixed_joints, 100);
}

TEST(RandomModel, satisfies_its_couplings_where_no_error_is_asked_for) {
  scenes::RandomOptions options;
  options.coupling_error = false;
  for (int seed = 0; seed < 100; ++seed) {
    const Model model = scenes::random_model(seed, options);
    for (const Coupling& coupling : model.couplings) {
      EXPECT_NEAR(coupling_error(model, coupling, &Joint::position, coupling.offset), 0.0, 1e-12);
      if (is_hard(coupling.softness)) {
        EXPECT_NEAR(coupling_error(model, coupling, &Joint::velocity, 0.0), 0.0, 1e-12);
      }
    }
  }
}

}  // namespace
}  // namespace lockstep
