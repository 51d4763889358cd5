// Inactive and ignored bounds change no bit; some settings are refused. SPDX-License-Identifier: Apache-2.0
#include <span>

#include "bounded_scenes.h"
#include "lockstep/error.h"
#include "plan/program.h"
#include "seeds.h"

namespace lockstep {
namespace {

using contract::same_bits;
using contract::scattered;

class InactiveBounds : public testing::TestWithParam<Method> {};

template <class S>
void expect_same_steps(const Plan& one, const Plan& other, const BatchOptions& options = {}) {
  auto a = scattered<S>(one, 19, options), b = scattered<S>(other, 19, options);
  ASSERT_EQ(b.engine(), a.engine());
  for (int step = 0; step < 20; ++step) {
    a.step(), b.step();
    ASSERT_TRUE(same_bits(a, b)) << step;
  }
  if (one.settings().record_impulses) {
    EXPECT_TRUE((a.coupling_impulses() == b.coupling_impulses()).all());
  }
  EXPECT_EQ(a.faulted(), 0);
}

// Ignores one kind at a time, then all together.
TEST_P(InactiveBounds, change_no_bit_where_they_are_ignored) {
  for (const Model& model : contract::bounded_scenes())
    for (int kind = 0; kind < 5; ++kind) {
      SCOPED_TRACE(model.name + " " + std::to_string(kind));
      const auto is = [&](int which) { return kind == which || kind == 4; };
      Model without = model;
      for (Joint& joint : without.joints) {
        if (is(0)) joint.lower = -infinity, joint.upper = infinity;
        if (is(1)) joint.velocity_limit = infinity;
        if (is(2)) joint.effort_limit = infinity;
        if (is(3)) joint.friction = 0.0;
      }
      StepSettings settings = contract::settings(GetParam());
      const Plan unbounded = compile(without, settings), bounded = compile(model, settings);
      settings.ignore = {is(0), is(1), is(2), is(3)};
      const Plan ignoring = compile(model, settings);
      expect_same_steps<float>(ignoring, unbounded);
      expect_same_steps<double>(ignoring, unbounded);
      auto a = scattered<double>(ignoring, 9), b = scattered<double>(bounded, 9);
      a.step(), b.step();
      EXPECT_FALSE(same_bits(a, b)) << "the ignored bounds were inactive anyway";
    }
}

// Adds position limits with each softness in turn, velocity limits, and effort limits to joints without a servo: a
// limited servo is summed in another order.
Model with_distant_limits(Model model, std::span<const Softness> kinds) {
  std::size_t number = 0;
  for (Joint& joint : model.joints) {
    if (!joint.moves()) continue;
    if (joint.kind == JointKind::continuous) joint.kind = JointKind::revolute;
    joint.lower = -1000.0, joint.upper = 1000.0, joint.velocity_limit = 1e5;
    joint.limit_softness = kinds[++number % kinds.size()];
    if (joint.drive.kp == 0.0 && joint.drive.kd == 0.0) joint.effort_limit = 1e5;
  }
  return model;
}

// Joints without a range would keep whole turns apart, which sums in another order. So the range is left out.
Plan compile_without_bounds(const Model& limited, StepSettings settings) {
  settings.ignore.position_limits.all = settings.ignore.velocity_limits.all = settings.ignore.effort_limits.all = true;
  return compile(limited, settings);
}

TEST_P(InactiveBounds, change_no_bit_where_they_are_never_reached) {
  const Softness kinds[] = {Hard{}, Spring{60.0, 1.0}, ErpCfm{0.3, 0.5}, Frequency{20.0, 0.7}, Hard{0.0}};
  std::vector<Model> models = {scenes::chain8(), scenes::gripper13(), scenes::chain32(), scenes::redundant()};
  scenes::RandomOptions options;
  options.efforts = false;
  for (std::uint64_t seed = 0; seed < static_cast<std::uint64_t>(seeds_of(40, 12)); ++seed)
    models.push_back(scenes::random_model(seed, options));
  Model soft = scenes::chain8();
  for (Coupling& coupling : soft.couplings) coupling.softness = Spring{40.0, 1.0};
  models.push_back(soft);
  for (const Model& model : models) {
    SCOPED_TRACE(model.name);
    const Model limited = with_distant_limits(model, kinds);
    for (int velocity_iterations : {1, 0}) {
      StepSettings settings = contract::settings(GetParam());
      settings.velocity_iterations = velocity_iterations;
      if (GetParam() == Method::tgs) settings.guard = infinity;  // its sub-steps feed some of these scenes
      const Plan unbounded = compile_without_bounds(limited, settings);
      for (const bool recorded : {false, true}) {
        settings.record_diagnostics = recorded;
        const Plan bounded = compile(limited, settings);
        expect_same_steps<float>(bounded, unbounded);
        expect_same_steps<double>(bounded, unbounded, {.threads = 1, .engine = Engine::tables});
      }
    }
    if (HasFailure()) return;
  }
}

// The couplings are hard: with soft ones only, bounds add a velocity phase, which sums in another order. For a
// Frequency softness of a limit, `reduced` may form its matrix in another way, so it gets none.
TEST_P(InactiveBounds, change_no_bit_of_a_compiled_step) {
  const Softness all_kinds[] = {Hard{}, Spring{60.0, 1.0}, ErpCfm{0.3, 0.5}, Hard{0.0}, Frequency{20.0, 0.7}};
  const std::span<const Softness> kinds(all_kinds, GetParam() == Method::reduced ? 4 : 5);
  for (std::uint64_t seed = 0; seed < static_cast<std::uint64_t>(seeds_of(30, 10)); ++seed) {
    Model model = scenes::random_model(seed, {.efforts = false});
    for (Coupling& coupling : model.couplings) coupling.softness = Hard{};
    if (seed % 5 == 4) model.couplings.clear();
    const Model limited = with_distant_limits(model, kinds);
    SCOPED_TRACE(model.name);
    StepSettings settings = contract::settings(GetParam());
    if (GetParam() == Method::tgs) settings.guard = infinity;
    for (const bool recorded : {true, false}) {
      settings.record_impulses = recorded;
      expect_same_steps<float>(compile(limited, settings), compile_without_bounds(limited, settings),
                               {.threads = 1, .engine = physics::engines().back()});
    }
  }
}

// `direct` takes constraint velocities as known where impulses are not recorded (M79), and solves for the impulses only
// where bounds are active.
TEST(KnownVelocities, give_the_bits_of_rows_that_are_solved) {
  std::vector<Model> models;
  for (Model model : {scenes::chain8(), scenes::gripper13()}) {
    models.push_back(model);
    for (std::size_t j = 0; j < model.joints.size(); j += 3) model.joints[j].upper = 0.1;
    models.push_back(model);
    models.push_back(contract::bounded(model));
  }
  for (const Model& model : models) {
    SCOPED_TRACE(model.name);
    StepSettings settings = contract::settings(Method::direct);
    settings.record_impulses = true;
    const Plan solving = compile(model, settings);
    settings.record_impulses = false;
    const Plan knowing = compile(model, settings);
    EXPECT_TRUE(program_of(knowing).f64.rows.known_suffice);
    EXPECT_FALSE(program_of(solving).f64.rows.known_suffice);
    auto a = scattered<float>(solving, 19), b = scattered<float>(knowing, 19);
    for (int step = 0; step < 20; ++step) {
      a.step(), b.step();
      ASSERT_TRUE(same_bits(a, b)) << step;
    }
  }
}

void expect_refused(const Model& model, const StepSettings& settings, const std::string& setting,
                    const std::string& rule, const std::string& remedy) {
  try {
    compile(model, settings);
    FAIL() << "accepted";
  } catch (const SettingsError& error) {
    EXPECT_EQ(error.element(), setting);
    EXPECT_NE(error.rule().find(rule), std::string::npos) << error.what();
    EXPECT_NE(error.remedy().find(remedy), std::string::npos) << error.what();
  }
}

INSTANTIATE_TEST_SUITE_P(method, InactiveBounds, testing::ValuesIn(physics::methods), physics::method_name);

class BoundsSettings : public testing::TestWithParam<Method> {};

TEST_P(BoundsSettings, refuse_a_softness_per_environment_beside_a_force_limit) {
  Model model = contract::bounded(scenes::chain8());
  const Method method = GetParam() == Method::reduced ? Method::automatic : GetParam();
  const StepSettings settings = contract::settings(method, {Parameter::softness});
  expect_refused(model, settings, "per_environment", "'j4' has a force limit", "leave out the softness");
  model.couplings[contract::limited_coupling].force_limit = infinity;
  EXPECT_NO_THROW(compile(model, settings));
}

TEST_P(BoundsSettings, stand_beside_coupling_switches) {
  const Model model = contract::bounded(scenes::chain8());
  EXPECT_NO_THROW(compile(model, contract::settings(GetParam(), {Parameter::coupling_switch})));
}

// The sub-steps of tgs share the erp of a hard limit. A Spring has none.
TEST_P(BoundsSettings, refuse_an_erp_above_1_that_sub_steps_share) {
  Model model = scenes::chain8();
  model.joints[2].lower = 0.0;
  model.joints[2].limit_softness = Hard{1.5};
  StepSettings settings = contract::settings(GetParam());
  if (GetParam() == Method::tgs)
    expect_refused(model, settings, "method", "erp 1.5 of the limits of joint 'j2'", "lower the erp");
  else
    EXPECT_NO_THROW(Batch<float>(compile(model, settings), 1));
  settings.iterations = 1;
  EXPECT_NO_THROW(Batch<float>(compile(model, settings), 1));
  settings.iterations = 4, settings.ignore.position_limits = true;
  EXPECT_NO_THROW(compile(model, settings));
  settings.ignore.position_limits = false;
  model.joints[2].limit_softness = Spring{1e6, 10.0};
  EXPECT_NO_THROW(Batch<float>(compile(model, settings), 1));
}

INSTANTIATE_TEST_SUITE_P(method, BoundsSettings, testing::ValuesIn(physics::methods), physics::method_name);

}  // namespace
}  // namespace lockstep
