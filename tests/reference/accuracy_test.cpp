// Errors of steps against files of exact motion, and errors of couplings. SPDX-License-Identifier: Apache-2.0
#include "accuracy.h"

#include <tuple>

namespace lockstep {
namespace {

class Accuracy : public testing::TestWithParam<std::tuple<physics::Bound, Method>> {
 protected:
  const physics::Bound& bound() const { return std::get<0>(GetParam()); }
  Method method() const { return std::get<1>(GetParam()); }
};

TEST_P(Accuracy, is_of_first_order_in_the_step_and_within_its_bound) {
  const std::string folder = physics::test_data();
  if (folder.empty()) GTEST_SKIP() << "LOCKSTEP_TEST_DATA names no folder with scenes/*.truth.txt";
  const scenes::Truth truth = scenes::read_truth(folder + "/scenes/" + bound().scene + ".truth.txt");
  ASSERT_EQ(truth.times.size(), 241);
  ASSERT_NEAR(truth.times[240], 1.0, 1e-9);
  const double whole = physics::rms_error(bound().scene, method(), 1, truth.positions);
  const double half = physics::rms_error(bound().scene, method(), 2, truth.positions);
  const double quarter = physics::rms_error(bound().scene, method(), 4, truth.positions);
  EXPECT_LE(whole, bound().rms);
  // The error is a h + b h^2 + ..., so the ratio comes nearer to 2 with each halving.
  EXPECT_NEAR(whole / half, 2.0, 0.3);
  EXPECT_NEAR(half / quarter, 2.0, std::max(0.02, std::abs(whole / half - 2.0)));
}

// The largest |C| over five seconds.
template <class S>
double worst_error(const physics::Bound& bound, Method method) {
  const scenes::Scene scene = scenes::scene(bound.scene);
  Batch<S> batch(compile(scene.model, physics::settings(method)), 1, {.threads = 1});
  double worst = 0.0;
  physics::play(scene, batch, 1200, [&](int) {
    const double error = batch.coupling_errors().abs().maxCoeff();
    if (!(error <= worst)) worst = error;  // also if it is NaN
  });
  EXPECT_EQ(batch.faulted(), 0);
  return worst;
}

TEST_P(Accuracy, reaches_rounding_for_couplings) {
  EXPECT_LE(worst_error<double>(bound(), method()), 1e-12);
  EXPECT_LE(worst_error<float>(bound(), method()), std::string(bound().scene) == "chain32" ? 5e-6 : 1e-6);
}

INSTANTIATE_TEST_SUITE_P(scene, Accuracy,
                         testing::Combine(testing::ValuesIn(physics::bounds),
                                          testing::Values(Method::direct, Method::reduced)),
                         [](const auto& info) {
                           return std::string(std::get<0>(info.param).scene) + "_" + to_string(std::get<1>(info.param));
                         });

}  // namespace
}  // namespace lockstep
