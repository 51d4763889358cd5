// Errors of steps against exact motion that the reference integrates. SPDX-License-Identifier: Apache-2.0
//
// The test is slow: it runs Runge-Kutta 4 on dense matrices until its estimated error is far below that of the steps.
#include "accuracy.h"
#include "reference/truth.h"

namespace lockstep {
namespace {

class ExactMotion : public testing::TestWithParam<physics::Bound> {};

// Steps of RK4 per 1/240 s. RK4 is stable with steps below 2.8 divided by the fastest rate. That is the rate of the
// drives, kd divided by the inertia that they move: 2e4 /s in gripper13 and 5e3 /s in drive1e6.
int steps_of(const std::string& scene) { return scene == "gripper13" ? 64 : scene == "drive1e6" ? 24 : 8; }

TEST_P(ExactMotion, is_approached_to_first_order_in_the_step) {
  const scenes::Scene scene = scenes::scene(GetParam().scene);
  const reference::Mechanism mechanism(scene.model);
  const auto targets = [&](double t, reference::Inputs& inputs) { inputs.position_targets = scene.targets(t); };
  const reference::Motion truth = reference::integrate_with_error(mechanism, mechanism.initial_state(), targets,
                                                                  1.0 / 240, 240, steps_of(scene.name));
  ASSERT_LE(truth.error, 1e-3 * GetParam().rms);
  for (const Method method : {Method::direct, Method::reduced}) {
    const double whole = physics::rms_error(scene.name, method, 1, truth.positions);
    const double half = physics::rms_error(scene.name, method, 2, truth.positions);
    EXPECT_LE(whole, GetParam().rms) << to_string(method);
    EXPECT_NEAR(whole / half, 2.0, 0.3) << to_string(method);
  }
}

INSTANTIATE_TEST_SUITE_P(scene, ExactMotion, testing::ValuesIn(physics::bounds),
                         [](const auto& info) { return std::string(info.param.scene); });

}  // namespace
}  // namespace lockstep
