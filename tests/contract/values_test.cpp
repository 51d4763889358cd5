// Values that no model could have, and the host's floating-point mode. SPDX-License-Identifier: Apache-2.0
#include <cfenv>

#include "batch/values.h"
#include "contract.h"

namespace lockstep {
namespace {

using contract::same_bits;
using contract::scattered;
using contract::serial;

constexpr int environments = 9, damaged = 5;

struct BadValue {
  const char* name;
  Parameter field;
  int row;
  double value;
  const char* words;  // that explain_fault() has
};

// chain8 with each kind of softness; the mass of l3 is its own, as nothing is fixed to it.
Model springs() {
  Model model = scenes::chain8();
  model.couplings[1].softness = ErpCfm{0.5, 0.1};
  model.couplings[2].softness = Spring{80.0, 2.5};
  model.couplings[3].softness = Frequency{60.0, 0.7};
  return model;
}

const std::vector<BadValue> bad_values = {
    {"mass_zero", Parameter::mass, 4, 0.0, "mass of link 'l3' (mass, row 4) is 0, must be above 0"},
    {"mass_negative", Parameter::mass, 4, -0.5, "mass of link 'l3' (mass, row 4) is -0.5, must be above 0"},
    {"kp_negative", Parameter::drive_gains, 6, -100.0, "kp of joint 'j3' (drive_gains, row 6) is -100"},
    {"kd_nan", Parameter::drive_gains, 7, std::nan(""), "kd of joint 'j3' (drive_gains, row 7) is nan"},
    {"damping_negative", Parameter::damping, 2, -0.01, "damping of joint 'j2' (damping, row 2) is -0.01"},
    {"frequency_negative", Parameter::softness, 6, -60.0, "frequency of coupling 'j5' (softness, row 6) is -60"},
    {"damping_ratio_negative", Parameter::softness, 7, -1.0, "damping ratio of coupling 'j5' (softness, row 7) is -1"},
    {"kp_of_spring_negative", Parameter::softness, 4, -1.0, "kp of coupling 'j4'"},
    {"cfm_negative", Parameter::softness, 3, -0.1, "cfm of coupling 'j1'"},
    {"erp_2", Parameter::softness, 0, 2.0, "erp of coupling 'j0' (softness, row 0) is 2, must be 0 to below 2"},
    {"ratio_zero", Parameter::gear_ratio, 2, 0.0, "ratio of joint 'j6' in coupling 'j4' (gear_ratio, row 2) is 0"},
    {"ratio_huge", Parameter::gear_ratio, 2, -1e10, "ratio of joint 'j6' in coupling 'j4'"},
};

class ImpossibleValue : public testing::TestWithParam<BadValue> {};

template <class S>
void expect_flagged(const BadValue& bad, Method method, Engine engine) {
  StepSettings settings = physics::settings(method);
  settings.per_environment = {bad.field};
  const Plan plan = compile(springs(), settings);
  const BatchOptions options = {.threads = 1, .engine = engine};
  Batch<S> sound(plan, environments, options), batch(plan, environments, options);
  batch.parameter(bad.field)(bad.row, damaged) = static_cast<S>(bad.value);
  batch.step(3);
  sound.step(3);
  EXPECT_EQ(batch.faults()[damaged], Fault::bad_value);
  EXPECT_EQ(batch.faulted(), 1);
  EXPECT_TRUE(same_bits(batch, sound, damaged));
  const std::string words = batch.explain_fault(damaged);
  EXPECT_NE(words.find(std::string("environment 5: bad_value")), std::string::npos) << words;
  EXPECT_NE(words.find(bad.words), std::string::npos) << words;
  EXPECT_EQ(batch.explain_fault(0), "");

  // It steps again where the value is put right and the environment is reset.
  batch.parameter(bad.field)(bad.row, damaged) = sound.parameter(bad.field)(bad.row, damaged);
  batch.step();
  EXPECT_EQ(batch.faults()[damaged], Fault::bad_value);
  batch.reset({damaged});
  batch.step();
  EXPECT_EQ(batch.faulted(), 0);
}

TEST_P(ImpossibleValue, is_a_fault_at_once_that_names_field_value_and_rule) {
  for (const Method method : {Method::pgs, Method::direct}) {
    expect_flagged<float>(GetParam(), method, Engine::tables);
    expect_flagged<double>(GetParam(), method, Engine::automatic);
  }
}

INSTANTIATE_TEST_SUITE_P(value, ImpossibleValue, testing::ValuesIn(bad_values),
                         [](const auto& bad) { return std::string(bad.param.name); });

// Whatever stands in whichever row, it is a fault, or a value that a Model may have, or without any effect. Other
// environments keep their bits.
TEST(EveryRowOfEveryField, has_no_value_that_changes_the_motion_silently) {
  Model model = springs();
  model.joints[1].lower = -1.0, model.joints[1].upper = 1.0;
  model.joints[1].velocity_limit = 50.0, model.joints[1].effort_limit = 50.0;
  int faults = 0, quiet = 0;
  for (const bool soft : {false, true})
    for (int f = 0; f < parameter_count; ++f) {
      const Parameter field = static_cast<Parameter>(f);
      StepSettings settings = physics::settings(Method::direct);
      settings.per_environment = {field};
      const Plan plan = compile(soft ? model : scenes::gripper13(), settings);
      const int rows = plan.parameter_rows(field);
      for (const double value : {std::nan(""), -infinity, infinity, -1e6}) {
        // Environment e + 1 has it in row e.
        Batch<double> batch(plan, rows + 1, serial), sound(plan, rows + 1, serial);
        for (int row = 0; row < rows; ++row) batch.parameter(field)(row, row + 1) = value;
        const std::vector<Problem> found = batch.check();
        batch.step(3), sound.step(3);
        EXPECT_TRUE(same_bits(batch, 0, sound, 0));
        for (int row = 0; row < rows; ++row) {
          const bool named = std::any_of(found.begin(), found.end(), [&](const Problem& p) {
            return p.environment == row + 1 && p.row / 2 == row / 2 && p.field == to_string(field);
          });
          const bool fault = batch.faults()[row + 1] != Fault::none;
          const bool same = same_bits(batch, row + 1, sound, 0);
          // Limits may be infinite; anything finite may be an offset, a place, a force, a switch.
          const bool legal = std::isinf(value) ? is_limit(field) : !std::isnan(value) && !named;
          EXPECT_TRUE(fault || legal || same) << to_string(field) << " row " << row << " is " << value;
          EXPECT_TRUE(named || legal) << to_string(field) << " row " << row << " is " << value;
          EXPECT_TRUE(fault || same || !named) << to_string(field) << " row " << row << " is " << value;
          faults += fault, quiet += !fault;
        }
      }
    }
  EXPECT_GT(faults, 3 * quiet);
}

// A payload may be taken off: the body that it is fixed to keeps its mass.
TEST(MassOfALink, may_be_zero_where_its_body_has_others) {
  Model model = physics::sliders({1.0, 2.0});
  Joint fixed;
  fixed.name = "grip", fixed.parent = "body0", fixed.child = "payload";
  model.links.push_back({"payload", Inertia::box(0.5, {0.1, 0.1, 0.1}, Eigen::Vector3d::Zero())});
  model.joints.push_back(fixed);
  StepSettings settings;
  settings.per_environment = {Parameter::mass};
  Batch<double> batch(compile(model, settings), 2, serial);
  batch.parameter(Parameter::mass)(3, 1) = 0.0;
  batch.efforts().row(0).setConstant(3.0);
  batch.step(240);
  EXPECT_EQ(batch.faulted(), 0);
  EXPECT_NEAR(batch.velocities()(0, 0), 3.0 / 1.5, 1e-9);
  EXPECT_NEAR(batch.velocities()(0, 1), 3.0 / 1.0, 1e-9);
  batch.parameter(Parameter::mass)(1, 1) = 0.0;  // now the body has none
  batch.step();
  EXPECT_EQ(batch.faults()[1], Fault::bad_value);
  EXPECT_EQ(batch.faulted(), 1);
  EXPECT_NE(batch.explain_fault(1).find(
                "the sum of the masses of link 'body0', 'payload' (mass, row 1) is 0, must be above 0"),
            std::string::npos)
      << batch.explain_fault(1);
}

Model floating_box() {
  Model model;
  model.name = "box";
  model.links = {{"box", Inertia::box(2.0, {0.1, 0.2, 0.3}, {0.05, 0.0, 0.0})}};
  model.roots = {{"box", true}};
  model.roots[0].velocity << 1.0, 2.0, 3.0, 0.0, 0.0, 0.0;
  return model;
}

// The same rotation, whatever the length of the quaternion.
template <class S>
void expect_normalised(Engine engine) {
  Batch<S> unit(compile(floating_box()), 3, {.threads = 1, .engine = engine}),
      scaled(compile(floating_box()), 3, {.threads = 1, .engine = engine});
  const S half = static_cast<S>(std::sqrt(0.5));
  for (int e = 0; e < 3; ++e) {
    unit.root_poses().col(e).tail(4) << half, half, S(0), S(0);
    const S length = S(3);
    scaled.root_poses().col(e).tail(4) << length * half, length * half, S(0), S(0);
  }
  EXPECT_NEAR((unit.link_poses(0) - scaled.link_poses(0)).abs().maxCoeff(), 0.0, 1e-6);
  scaled.root_poses().bottomRows(4) *= S(1e-3);
  unit.step(240);
  scaled.step(240);
  EXPECT_EQ(scaled.faulted(), 0);
  EXPECT_NEAR((unit.root_poses() - scaled.root_poses()).abs().maxCoeff(), 0.0, sizeof(S) == 4 ? 1e-3 : 1e-11);
}

TEST(QuaternionOfARoot, is_normalised_before_it_is_used) {
  for (const Engine engine : physics::engines()) {
    expect_normalised<float>(engine);
    expect_normalised<double>(engine);
  }
}

TEST(QuaternionOfARoot, of_length_zero_is_a_fault) {
  Batch<float> batch(compile(floating_box()), 3, serial);
  batch.root_poses().col(1).tail(4).setZero();
  batch.step();
  EXPECT_EQ(batch.faults()[1], Fault::bad_value);
  EXPECT_EQ(batch.faulted(), 1);
  EXPECT_NE(batch.explain_fault(1).find("the quaternion of root 'box' (root_poses, row 3) is 0"), std::string::npos)
      << batch.explain_fault(1);
}

TEST(ExplainedFault, names_the_joint_and_its_number) {
  Batch<double> batch(compile(scenes::chain8()), 3, serial);
  batch.efforts()(3, 1) = std::nan("");
  batch.velocities()(6, 2) = 5e6;
  batch.step();
  EXPECT_NE(batch.explain_fault(1).find("not_finite: a position or velocity became NaN or infinite; effort of joint "
                                        "'j3' (efforts, row 3) is nan, must be finite;"),
            std::string::npos)
      << batch.explain_fault(1);
  EXPECT_NE(batch.explain_fault(2).find("the joint to blame is 'j6'"), std::string::npos) << batch.explain_fault(2);
}

// ---------------------------------------------------------------- the host's floating-point mode

// Steps by each engine, with one thread and with two.
template <class Act>
void for_each_way(const Act& act) {
  for (const int threads : {1, 2})
    for (const Engine engine : physics::engines()) {
      SCOPED_TRACE(testing::Message() << threads << " threads, " << to_string(engine));
      act(BatchOptions{.threads = threads, .engine = engine});
    }
}

TEST(RoundingMode, of_the_host_changes_no_bit_and_stays) {
  const Plan plan = compile(scenes::chain8(), {.per_environment = {Parameter::mass}});
  for_each_way([&](const BatchOptions& options) {
    Batch<float> nearest = scattered<float>(plan, 40, options), upward = scattered<float>(plan, 40, options);
    nearest.step(20);
    std::fesetround(FE_UPWARD);
    upward.step(20);
    const int after = std::fegetround();
    std::fesetround(FE_TONEAREST);
    EXPECT_EQ(after, FE_UPWARD);
    EXPECT_TRUE(same_bits(nearest, upward));
  });
}

#ifdef __x86_64__
TEST(FloatingPointTraps, of_the_host_do_not_end_a_step_with_nan) {
  const Plan plan = compile(scenes::chain8(), {.per_environment = {Parameter::mass, Parameter::damping}});
  for_each_way([&](const BatchOptions& options) {
    Batch<float> batch = scattered<float>(plan, 40, options);
    batch.positions()(1, 3) = std::numeric_limits<float>::quiet_NaN();
    batch.velocities()(1, 9) = std::numeric_limits<float>::infinity();
    batch.parameter(Parameter::mass)(2, 7) = std::numeric_limits<float>::quiet_NaN();
    feenableexcept(FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW);
    batch.step(3);
    const int enabled = fegetexcept();
    fedisableexcept(FE_ALL_EXCEPT);
    EXPECT_EQ(enabled, FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW);
    EXPECT_EQ(std::fetestexcept(FE_INVALID), 0) << "flags of a step must not remain";
    EXPECT_EQ(batch.faulted(), 3);
  });
}
#endif

}  // namespace
}  // namespace lockstep
