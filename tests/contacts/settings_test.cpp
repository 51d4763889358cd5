// Contact settings by name: what costs more errs less. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <random>
#include <vector>

#include "divergence_scenes.h"

namespace lockstep {
namespace {

using namespace contact_scenes;

constexpr int environments = 8;

Batch<double> solved_by(const Model& model, const ContactSettings& contacts) {
  StepSettings settings;
  settings.integrator = Integrator::euler, settings.contacts = contacts;
  return Batch<double>(compile(model, settings), environments, {.threads = 1});
}

/// By setting: the differences of velocities after single steps from those of solves that converge, over 1 + the
/// largest velocity of the environment, ascending. The motion has random targets; all begin a step without memory.
std::vector<std::vector<double>> errors(const Model& model, const std::vector<ContactSettings>& all) {
  Batch<double> motion = solved_by(model, {}), exact = solved_by(model, {100, 200, 2e-6});
  std::vector<Batch<double>> batches;
  for (const ContactSettings& contacts : all) batches.push_back(solved_by(model, contacts));
  const auto velocities = [](const Batch<double>& batch) {
    Eigen::ArrayXXd parts(batch.velocities().rows() + batch.root_velocities().rows(), environments);
    parts << batch.velocities(), batch.root_velocities();
    return parts;
  };
  std::mt19937 random(11);
  std::uniform_real_distribution<double> target(-0.5, 0.5);
  std::vector<std::vector<double>> found(all.size());
  for (int i = 0; i < 240; ++i) {
    if (i % 12 == 0)
      for (const Joint& joint : model.joints)
        for (int e = 0; joint.drive.kp > 0.0 && e < environments; ++e)
          motion.position_targets()(motion.plan().dof(joint.name), e) = joint.drive.position_target + target(random);
    motion.step(1);
    if (i < 20 || i % 2 != 0) continue;  // it lands first
    const std::vector<std::byte> state = motion.save();
    exact.restore(state, {.other_settings = true});
    exact.step(1);
    const Eigen::ArrayXXd exactly = velocities(exact);
    for (std::size_t s = 0; s < all.size(); ++s) {
      batches[s].restore(state, {.other_settings = true});
      batches[s].step(1);
      const Eigen::ArrayXXd differences = (velocities(batches[s]) - exactly).abs();
      for (int e = 0; e < environments; ++e)
        found[s].push_back(differences.col(e).maxCoeff() / (1.0 + exactly.col(e).abs().maxCoeff()));
    }
  }
  for (std::vector<double>& ascending : found) std::sort(ascending.begin(), ascending.end());
  return found;
}

TEST(ContactSettings, that_cost_more_err_less_where_legs_hit_the_floor) {
  const auto found = errors(limited_quadruped(false), {ContactSettings::learning(), {}, ContactSettings::accurate()});
  const auto most = [&](std::size_t s) { return found[s][found[s].size() * 99 / 100]; };
  EXPECT_LT(most(0), 0.5);
  EXPECT_LT(most(1), most(0) / 2.0);
  EXPECT_LT(most(2), most(1) / 10.0);
}

}  // namespace
}  // namespace lockstep
