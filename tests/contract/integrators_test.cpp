// Determinism, faults and refusals of the integrators beside Euler's method. SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>
#include <optional>

#include "contract.h"
#include "lockstep/error.h"

namespace lockstep {
namespace {

using contract::same_bits;
using contract::scattered;

constexpr int several = 19;  // two full tiles of eight lanes and a part of a third

class Integrators : public testing::TestWithParam<Integrator> {
 protected:
  // Calls check(plan, scalar) for scenes and random models, without and with all parameters per environment.
  template <class Check>
  void for_every_plan(Check check) const {
    std::vector<Model> models = {scenes::chain8(), scenes::gripper13(), scenes::chain32()};
    scenes::RandomOptions options;
    options.max_dofs = 12;
    options.redundant = false;
    for (std::uint64_t seed = 0; seed < 6; ++seed) models.push_back(scenes::random_model(seed, options));
    int checked = 0;
    for (const Model& model : models)
      for (const bool with_fields : {false, true}) {
        StepSettings settings;
        settings.integrator = GetParam();
        settings.method = Method::reduced;
        settings.stage_inputs = with_fields;
        settings.dt = 1.0 / 480;
        if (with_fields) settings.per_environment = contract::all_parameters(Method::reduced, model);
        SCOPED_TRACE(model.name);
        std::optional<Plan> plan;
        try {
          plan = compile(model, settings);
        } catch (const SettingsError&) {
          ASSERT_EQ(GetParam(), Integrator::runge_kutta) << "the others must take every smooth scene";
          continue;
        }
        ++checked;
        check(*plan, float());
        check(*plan, double());
        if (HasFailure()) return;
      }
    EXPECT_GE(checked, 4);
  }
};

TEST_P(Integrators, give_the_bits_of_their_scalar_twin) {
  for_every_plan([](const Plan& plan, auto scalar) {
    using S = decltype(scalar);
    const std::pair<Target, Target> pairs[] = {{twins::baseline_scalar, Target::baseline},
                                               {twins::avx2_scalar, Target::avx2},
                                               {twins::avx2_scalar, Target::avx512},
                                               {twins::neon_scalar, Target::neon}};
    for (const auto& [twin, wide] : pairs) {
      if (!supported(twin) || !supported(wide)) continue;
      auto a = scattered<S>(plan, several, {.threads = 1, .target = twin, .engine = Engine::tables});
      auto b = scattered<S>(plan, several, {.threads = 1, .target = wide, .engine = Engine::tables});
      a.step(3), b.step(3);
      EXPECT_TRUE(same_bits(a, b)) << to_string(wide);
    }
  });
}

TEST_P(Integrators, give_the_same_bits_for_threads_sizes_places_and_calls) {
  for_every_plan([](const Plan& plan, auto scalar) {
    using S = decltype(scalar);
    Batch<S> many = scattered<S>(plan, 600, {.threads = 1});
    many.step(4);
    Batch<S> threads = scattered<S>(plan, 600, {.threads = 3});
    for (int i = 0; i < 4; ++i) threads.step();
    EXPECT_TRUE(same_bits(many, threads));
    for (const int place : {0, 7, 18}) {
      Batch<S> single(plan, 1, {.threads = 1});
      contract::scatter(single, 0, static_cast<std::uint64_t>(place));
      single.step(4);
      EXPECT_TRUE(same_bits(many, place, single, 0)) << place;
    }
  });
}

TEST_P(Integrators, freeze_a_failed_environment_and_keep_the_bits_of_its_neighbours) {
  for_every_plan([](const Plan& plan, auto scalar) {
    using S = decltype(scalar);
    constexpr int damaged = 11;
    Batch<S> sound = scattered<S>(plan, several);
    sound.step(3);
    Batch<S> batch = scattered<S>(plan, several);
    batch.efforts().col(damaged).setConstant(std::numeric_limits<S>::quiet_NaN());
    const std::vector<S> before = contract::outcome(batch, damaged);
    batch.step(3);
    EXPECT_EQ(batch.faults()[damaged], Fault::not_finite);
    EXPECT_TRUE(same_bits(contract::outcome(batch, damaged), before)) << "it must keep its last good state";
    EXPECT_TRUE(same_bits(batch, sound, damaged));
  });
}

TEST_P(Integrators, give_the_same_bits_for_held_inputs_and_equal_inputs_per_stage) {
  StepSettings settings;
  settings.integrator = GetParam();
  const Plan holding = compile(scenes::chain8(), settings);
  settings.stage_inputs = true;
  const Plan staged = compile(scenes::chain8(), settings);
  ASSERT_GT(staged.stage_times().size(), 1u);
  Batch<double> a(holding, 3, {.threads = 1}), b(staged, 3, {.threads = 1});
  ASSERT_EQ(b.efforts().rows(), 8 * static_cast<Eigen::Index>(staged.stage_times().size()));
  for (Eigen::Index row = 0; row < b.efforts().rows(); ++row) b.efforts().row(row) = 0.1 * static_cast<double>(row % 8);
  for (Eigen::Index row = 0; row < 8; ++row) a.efforts().row(row) = 0.1 * static_cast<double>(row);
  a.step(5), b.step(5);
  EXPECT_TRUE(same_bits(a, b));
  b.efforts().row(8 + 2) += 0.5;  // at the second stage time
  a.step(), b.step();
  EXPECT_FALSE(same_bits(a, b));
}

INSTANTIATE_TEST_SUITE_P(integrator, Integrators,
                         testing::Values(Integrator::leapfrog, Integrator::extrapolated, Integrator::runge_kutta),
                         [](const auto& info) { return std::string(to_string(info.param)); });

template <class Change>
std::string refusal(Model model, Integrator integrator, Change change) {
  StepSettings settings;
  settings.integrator = integrator;
  change(model, settings);
  try {
    compile(model, settings);
  } catch (const SettingsError& error) {
    return error.what();
  }
  return "";
}

TEST(IntegratorSettings, are_refused_with_reason_and_remedy_where_they_do_not_apply) {
  const auto expect_contains = [](const std::string& message, const char* reason, const char* remedy) {
    EXPECT_NE(message.find(reason), std::string::npos) << message;
    EXPECT_NE(message.find(remedy), std::string::npos) << message;
  };
  for (const Integrator integrator : {Integrator::leapfrog, Integrator::extrapolated, Integrator::runge_kutta}) {
    const auto of_chain = [&](auto change) { return refusal(scenes::chain8(), integrator, change); };
    EXPECT_EQ(of_chain([](Model&, StepSettings&) {}), "");
    if (integrator == Integrator::leapfrog) {
      EXPECT_EQ(of_chain([](Model& m, StepSettings&) { m.joints[0].upper = 1.0; }), "");
      EXPECT_EQ(of_chain([](Model& m, StepSettings&) { m.joints[0].effort_limit = 1.0; }), "");
      EXPECT_EQ(of_chain([](Model& m, StepSettings&) {
                  m.joints[0].upper = 1.0, m.joints[0].limit_softness = Spring{10.0, 1.0};
                }),
                "");
      EXPECT_EQ(of_chain([](Model& m, StepSettings&) {
                  m.joints[0].upper = 1.0, m.couplings[0].softness = Spring{10.0, 1.0};
                }),
                "");
    } else {
      expect_contains(of_chain([](Model& m, StepSettings&) { m.joints[0].upper = 1.0; }), "has bounds",
                      "StepSettings::ignore");
      expect_contains(
          of_chain([](Model& m, StepSettings&) { m.joints[0].effort_limit = 1.0, m.joints[0].drive.kp = 1.0; }),
          "has bounds", "euler");
    }
    expect_contains(of_chain([](Model&, StepSettings& s) { s.method = Method::pgs; }), "sweeps", "reduced");
    expect_contains(of_chain([](Model&, StepSettings& s) { s.record_impulses = true; }), "record", "euler");
    if (integrator != Integrator::runge_kutta)
      expect_contains(of_chain([](Model&, StepSettings& s) { s.velocity_iterations = 0; }), "velocity_iterations",
                      "give 1");
    EXPECT_EQ(of_chain([](Model& m, StepSettings& s) { m.joints[0].upper = 1.0, s.ignore.position_limits = true; }),
              "");
  }
  expect_contains(refusal(scenes::gripper13(), Integrator::runge_kutta, [](Model&, StepSettings&) {}),
                  "drives, springs and damping", "dt of at most");
  expect_contains(refusal(scenes::chain8(), Integrator::runge_kutta,
                          [](Model& m, StepSettings&) {
                            m.couplings[0].softness = Spring{10.0, 0.1};
                          }),
                  "soft", "leapfrog");
  expect_contains(refusal(scenes::chain8(), Integrator::extrapolated,
                          [](Model& m, StepSettings&) { m.couplings[0].softness = Hard{1.9}; }),
                  "erp", "lower");
}

// Runge-Kutta stays bounded with the largest step that compile() accepts.
TEST(IntegratorSettings, limit_the_step_of_runge_kutta_to_a_stable_one) {
  const auto plan = [](double dt) {
    StepSettings settings;
    settings.integrator = Integrator::runge_kutta;
    settings.dt = dt;
    return compile(scenes::chain8(), settings);
  };
  double low = 1e-4, high = 1.0;  // s
  for (int i = 0; i < 40; ++i) {
    const double middle = std::sqrt(low * high);
    try {
      plan(middle);
      low = middle;
    } catch (const SettingsError&) {
      high = middle;
    }
  }
  Batch<double> batch(plan(0.99 * low), 1, {.threads = 1});
  batch.step(500);
  EXPECT_EQ(batch.faulted(), 0);
  EXPECT_LT(batch.velocities().abs().maxCoeff(), 50.0);
}

TEST(IntegratorSettings, choose_leapfrog_where_it_applies_and_give_the_reason_for_others) {
  const Plan smooth = compile(scenes::chain8());
  EXPECT_EQ(smooth.integrator(), Integrator::leapfrog);
  EXPECT_NE(smooth.describe().find("leapfrog with an implicit linear part (its errors are of second order)"),
            std::string::npos);
  Model model = scenes::chain8();
  model.joints[3].friction = 0.1, model.joints[0].upper = 0.5, model.joints[1].velocity_limit = 2.0;
  EXPECT_EQ(compile(model).integrator(), Integrator::leapfrog);
  model.joints[0].limit_softness = Spring{10.0, 1.0};
  const Plan soft = compile(model);
  EXPECT_EQ(soft.integrator(), Integrator::leapfrog);
  EXPECT_NE(
      soft.describe().find("bounds act at its midpoint: a limit, a kinematic drive or a coupling's force limit is"),
      std::string::npos)
      << soft.describe();
  StepSettings swept;
  swept.method = Method::pgs;
  const Plan sweeps = compile(model, swept);
  EXPECT_EQ(sweeps.integrator(), Integrator::euler);
  EXPECT_NE(sweeps.describe().find("semi-implicit Euler (pgs uses sweeps"), std::string::npos) << sweeps.describe();
}

}  // namespace
}  // namespace lockstep
