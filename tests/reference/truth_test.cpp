// The reference against files of exact motion from other sources. SPDX-License-Identifier: Apache-2.0
//
// The files are scenes/NAME.truth.txt in the folder LOCKSTEP_TEST_DATA, set in the environment or when compiled.
#include "reference/truth.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "physics.h"
#include "reference/step.h"
#include "scenes/scenes.h"

namespace lockstep::reference {
namespace {

std::string truth_path(const std::string& scene) { return physics::test_data() + "/scenes/" + scene + ".truth.txt"; }

struct Case {
  const char* scene;
  int steps;           // of Runge-Kutta per row of the file; stiff drives need many for stability
  double tolerance;    // rad
  double first_order;  // bound of the RMS error of q over the first second at 1/240 s; 0 if the error is too large
};

class Truth : public testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(truth_path(GetParam().scene))) GTEST_SKIP() << "no " << truth_path(GetParam().scene);
    truth_ = scenes::read_truth(truth_path(GetParam().scene));
    ASSERT_EQ(truth_.times.size(), 241);
    ASSERT_NEAR(truth_.times[240], 1.0, 1e-12);
  }

  // RMS error over the first second. Targets are those at the start of the step, like those of a controller.
  double rms(Method method, int steps_per_row) const {
    const Mechanism mechanism(scene_.model);
    StepSettings settings;
    settings.method = method;
    settings.dt = 1.0 / 240 / steps_per_row;
    State state = mechanism.initial_state();
    Inputs inputs = mechanism.initial_inputs();
    double squares = 0.0;
    for (int n = 1; n <= 240 * steps_per_row; ++n) {
      inputs.position_targets = scene_.targets((n - 1) * settings.dt);
      state = step(mechanism, settings, state, inputs).state;
      if (n % steps_per_row > 0) continue;
      squares += (state.q.transpose() - truth_.positions.row(n / steps_per_row)).squaredNorm();
    }
    return std::sqrt(squares / static_cast<double>(truth_.positions.size()));
  }

  const scenes::Scene scene_ = scenes::scene(GetParam().scene);
  scenes::Truth truth_;
};

TEST_P(Truth, agrees_with_runge_kutta) {
  const Mechanism mechanism(scene_.model);
  const auto targets = [&](double t, Inputs& inputs) { inputs.position_targets = scene_.targets(t); };
  const Motion motion =
      integrate_with_error(mechanism, mechanism.initial_state(), targets, 1.0 / 240, 240, GetParam().steps);
  EXPECT_LT((motion.positions - truth_.positions).cwiseAbs().maxCoeff(), GetParam().tolerance);
  EXPECT_LT(motion.error, GetParam().tolerance);
}

TEST_P(Truth, is_approached_to_first_order) {
  const double bound = GetParam().first_order;
  if (bound == 0.0) GTEST_SKIP() << "the motion is too fast for a step of 1/240 s";
  const double direct = rms(Method::direct, 1), halved = rms(Method::direct, 2), reduced = rms(Method::reduced, 1);
  RecordProperty("rms", std::to_string(direct));
  EXPECT_LT(direct, bound);
  EXPECT_LT(reduced, bound);
  EXPECT_NEAR(direct / halved, 2.0, 0.15);
  // The steps are equal up to rounding, which the whip of chain32 amplifies over a second.
  EXPECT_NEAR(reduced, direct, 1e-9);
}

INSTANTIATE_TEST_SUITE_P(scenes, Truth,
                         testing::Values(Case{"chain8", 2, 1e-7, 2.7e-3}, Case{"gripper13", 32, 1e-7, 1.7e-3},
                                         Case{"chain32", 2, 2e-6, 1.2e-2}, Case{"gear100", 2, 1e-7, 2.9e-3},
                                         Case{"drive1e6", 20, 1e-7, 2.9e-3}, Case{"redundant", 2, 1e-7, 2.9e-3},
                                         Case{"mass1000", 16, 1e-7, 0.0}),
                         [](const auto& info) { return std::string(info.param.scene); });

}  // namespace
}  // namespace lockstep::reference
