// What a Batch refuses, and which target and engine it chooses. SPDX-License-Identifier: Apache-2.0
#include <cstdlib>
#include <functional>
#include <limits>
#include <optional>
#include <utility>

#include "contract.h"
#include "lockstep/error.h"

namespace lockstep {
namespace {

using contract::same_bits;
using contract::scattered;
using contract::serial;

// The error of type E that act() throws.
template <class E, class Act>
std::optional<E> thrown_by(Act act) {
  try {
    act();
  } catch (const E& error) {
    return error;
  }
  return std::nullopt;
}

template <class E, class Act>
void expect_refused(Act act, const std::string& element, const std::string& remedy) {
  const auto error = thrown_by<E>(act);
  ASSERT_TRUE(error) << "accepted: " << element;
  EXPECT_EQ(error->element(), element);
  EXPECT_NE(error->remedy().find(remedy), std::string::npos) << error->what();
}

TEST(Reset, refuses_masks_numbers_and_states_that_do_not_fit_and_changes_nothing) {
  Batch<double> batch = scattered<double>(compile(scenes::chain8()), 6);
  const Batch<double> unchanged = scattered<double>(compile(scenes::chain8()), 6);
  const bool short_mask[5] = {true, true, true, true, true};
  const std::vector<int> beyond = {1, 6}, negative = {0, -1}, good = {0, 1};
  const Batch<double>::Array two = Batch<double>::Array::Zero(8, 2), three = Batch<double>::Array::Zero(8, 3),
                             few = Batch<double>::Array::Zero(7, 2);
  expect_refused<UsageError>([&] { batch.reset(short_mask); }, "mask of environments", "one per environment");
  expect_refused<UsageError>([&] { batch.reset(beyond); }, "environment 6", "0 to 5");
  expect_refused<UsageError>([&] { batch.reset(negative); }, "environment -1", "0 to 5");
  expect_refused<UsageError>([&] { batch.reset(good, three, three); }, "reset state", "8 dofs x 2 environments");
  expect_refused<UsageError>([&] { batch.reset(good, two, few); }, "reset state", "8 dofs x 2 environments");
  expect_refused<UsageError>([&] { batch.reset(beyond, two, two); }, "environment 6", "0 to 5");
  EXPECT_TRUE(same_bits(batch, unchanged));
}

TEST(Batch, refuses_parameters_that_were_not_declared_and_says_where_to_declare_them) {
  Batch<double> batch(compile(scenes::chain8(), {.per_environment = {Parameter::damping}}), 2, serial);
  EXPECT_NO_THROW(batch.parameter(Parameter::damping));
  for (unsigned p = 0; p < parameter_count; ++p) {
    const Parameter parameter = static_cast<Parameter>(p);
    if (parameter == Parameter::damping) continue;
    expect_refused<UsageError>([&] { batch.parameter(parameter); }, std::string("field ") + to_string(parameter),
                               "StepSettings::per_environment");
  }
  expect_refused<UsageError>([&] { batch.coupling_impulses(); }, "coupling impulses", "StepSettings::record_impulses");
}

TEST(Batch, refuses_links_and_sites_that_do_not_exist) {
  const Batch<double> batch(compile(scenes::random_model(7)), 2, serial);
  const int links = static_cast<int>(batch.plan().model().links.size());
  for (int link : {-1, links}) {
    expect_refused<UsageError>([&] { batch.link_poses(link); }, "link " + std::to_string(link), "Plan::link()");
    expect_refused<UsageError>([&] { batch.link_velocities(link); }, "link " + std::to_string(link), "Plan::link()");
  }
  for (int site : {-1, 2}) {
    expect_refused<UsageError>([&] { batch.site_positions(site); }, "site " + std::to_string(site), "Plan::site()");
    expect_refused<UsageError>([&] { batch.site_jacobians(site); }, "site " + std::to_string(site), "Plan::site()");
  }
}

TEST(Batch, refuses_less_than_one_environment_and_negative_threads) {
  const Plan plan = compile(scenes::chain8());
  expect_refused<SettingsError>([&] { Batch<float>(plan, 0); }, "environments", "1 or more");
  expect_refused<SettingsError>([&] { Batch<float>(plan, -7); }, "environments", "1 or more");
  expect_refused<SettingsError>([&] { Batch<float>(plan, 1, {.threads = -1}); }, "threads", "0 for all");
  for (const int threads : {1025, std::numeric_limits<int>::max(), std::numeric_limits<int>::min()})
    expect_refused<SettingsError>([&] { Batch<float>(plan, 1, {.threads = threads}); }, "threads", "0 for all");
  expect_refused<SettingsError>([&] { Batch<float>(plan, std::numeric_limits<int>::max()); }, "environments", "1 or");
}

TEST(Batch, refuses_numbers_that_are_no_enumerators) {
  const Plan plan = compile(scenes::chain8(), {.per_environment = {Parameter::mass}});
  for (const int number : {-1, 9, 77}) {
    const std::string text = std::to_string(number);
    expect_refused<SettingsError>([&] { Batch<float>(plan, 1, {.threads = 1, .target = Target(number)}); },
                                  "target " + text, "one of Target");
    expect_refused<SettingsError>([&] { Batch<float>(plan, 1, {.threads = 1, .engine = Engine(number)}); },
                                  "engine " + text, "one of Engine");
  }
  Batch<float> batch(plan, 1, serial);
  for (const unsigned number : {static_cast<unsigned>(parameter_count), 31u, 32u, 77u, 4294967295u}) {
    expect_refused<UsageError>([&] { batch.parameter(Parameter(number)); }, "field " + std::to_string(number),
                               "one of");
    expect_refused<UsageError>([&] { plan.parameter_rows(Parameter(number)); }, "field " + std::to_string(number),
                               "one of");
  }
}

TEST(Batch, that_was_moved_from_refuses_everything_but_an_assignment) {
  Batch<double> first(compile(scenes::chain8(), {.record_diagnostics = true}), 2, serial);
  const Batch<double> second = std::move(first);
  const Batch<double>::Array state = Batch<double>::Array::Zero(8, 1);
  const std::vector<int> ids = {0};
  const bool mask[2] = {};
  const std::vector<std::byte> blob = second.save();
  const std::vector<std::function<void()>> calls = {[&] { first.plan(); },
                                                    [&] { first.environments(); },
                                                    [&] { first.target(); },
                                                    [&] { first.engine(); },
                                                    [&] { first.kernel_name(); },
                                                    [&] { first.positions(); },
                                                    [&] { std::as_const(first).positions(); },
                                                    [&] { first.root_poses(); },
                                                    [&] { first.velocity_targets(); },
                                                    [&] { first.parameter(Parameter::mass); },
                                                    [&] { first.reset(); },
                                                    [&] { first.reset(ids); },
                                                    [&] { first.reset(mask); },
                                                    [&] { first.reset(ids, state, state); },
                                                    [&] { first.project(); },
                                                    [&] { first.project(ids); },
                                                    [&] { first.project(mask); },
                                                    [&] { first.save(); },
                                                    [&] { first.save(ids); },
                                                    [&] { first.restore(blob); },
                                                    [&] { first.restore(blob, ids); },
                                                    [&] { first.faults(); },
                                                    [&] { first.faulted(); },
                                                    [&] { first.explain_fault(0); },
                                                    [&] { first.ids(); },
                                                    [&] { std::as_const(first).seeds(); },
                                                    [&] { first.draw({}, 0); },
                                                    [&] { first.draw_normal({}, 0); },
                                                    [&] { first.randomize(Parameter::mass, {}); },
                                                    [&] { first.reset_random(); },
                                                    [&] { first.set_actions({}); },
                                                    [&] { first.check(); },
                                                    [&] { first.read({}, {}); },
                                                    [&] { first.coupling_errors(); },
                                                    [&] { first.link_poses(0); },
                                                    [&] { first.kinetic_energies(); },
                                                    [&] { first.limit_violations(); },
                                                    [&] { first.speeds(); },
                                                    [&] { first.row_residuals(); },
                                                    [&] { first.conflicts(0); }};
  for (std::size_t i = 0; i < calls.size(); ++i) {
    SCOPED_TRACE(i);
    expect_refused<UsageError>(calls[i], "batch", "moved to");
  }
  EXPECT_NO_FATAL_FAILURE(first.step());
}

struct TooLarge {
  const char* name;
  std::function<void(Model&)> write;
};

class SinglePrecision : public testing::TestWithParam<TooLarge> {};

// A double can hold 1e300, a float cannot.
TEST_P(SinglePrecision, refuses_numbers_that_it_cannot_hold) {
  Model model = scenes::chain8();
  model.roots = {{model.links[0].name, true}};
  model.links[0].inertia = model.links[1].inertia;
  GetParam().write(model);
  std::optional<Plan> plan;
  ASSERT_NO_THROW(plan = compile(model, {.method = Method::direct}));
  EXPECT_NO_THROW(Batch<double>(*plan, 1, serial));
  expect_refused<UsageError>([&] { Batch<float>(*plan, 1, serial); }, "numbers of model 'chain8'", "Batch<double>");
}

INSTANTIATE_TEST_SUITE_P(
    batch, SinglePrecision,
    testing::Values(TooLarge{"kp", [](Model& m) { m.joints[0].drive.kp = 1e300; }},
                    TooLarge{"damping", [](Model& m) { m.joints[0].damping = 1e300; }},
                    TooLarge{"armature", [](Model& m) { m.joints[0].armature = 1e300; }},
                    TooLarge{"position", [](Model& m) { m.joints[0].position = 1e300; }},
                    TooLarge{"velocity", [](Model& m) { m.joints[0].velocity = -1e300; }},
                    TooLarge{"effort", [](Model& m) { m.joints[0].effort = 1e300; }},
                    TooLarge{"target", [](Model& m) { m.joints[0].drive.position_target = 1e300; }},
                    TooLarge{"place", [](Model& m) { m.joints[0].origin.translation().x() = 1e60; }},
                    TooLarge{
                        "mass",
                        [](Model& m) {
                          m.links[3].inertia = {1e60, Eigen::Vector3d::Zero(), 1e100 * Eigen::Matrix3d::Identity()};
                        }},
                    TooLarge{"gravity", [](Model& m) { m.gravity.z() = -1e300; }},
                    TooLarge{"offset", [](Model& m) { m.couplings[0].offset = 1e300; }},
                    TooLarge{"stiffness",
                             [](Model& m) {
                               m.couplings[0].softness = Spring{1e300, 0.0};
                             }},
                    TooLarge{"root", [](Model& m) { m.roots[0].pose.translation().y() = 1e300; }},
                    TooLarge{"twist", [](Model& m) { m.roots[0].velocity[4] = 1e300; }}),
    [](const auto& info) { return std::string(info.param.name); });

// Restores an environment variable after the test.
class Variable : public testing::Test {
 protected:
  explicit Variable(const char* name) : name_(name) {
    if (const char* value = std::getenv(name)) before_ = value;
  }
  ~Variable() override { before_ ? setenv(name_, before_->c_str(), 1) : unsetenv(name_); }

 private:
  const char* name_;
  std::optional<std::string> before_;
};
struct TargetVariable : Variable {
  TargetVariable() : Variable("LOCKSTEP_TARGET") {}
};
TEST_F(TargetVariable, chooses_the_target_where_the_options_do_not) {
  const Plan plan = compile(scenes::chain8());
  for (Target target : all_targets) {
    if (!supported(target)) continue;
    setenv("LOCKSTEP_TARGET", to_string(target), 1);
    EXPECT_EQ(Batch<float>(plan, 1).target(), target);
    EXPECT_EQ(Batch<float>(plan, 1, {.target = Target::baseline}).target(), Target::baseline);
  }
  const Target best = supported(Target::avx512) ? Target::avx512
                      : supported(Target::avx2) ? Target::avx2
                      : supported(Target::neon) ? Target::neon
                                                : Target::baseline;
  setenv("LOCKSTEP_TARGET", "", 1);
  EXPECT_EQ(Batch<float>(plan, 1).target(), best);
  unsetenv("LOCKSTEP_TARGET");
  EXPECT_EQ(Batch<float>(plan, 1).target(), best);
  setenv("LOCKSTEP_TARGET", "sse9", 1);
  expect_refused<SettingsError>([&] { Batch<float>(plan, 1); }, "LOCKSTEP_TARGET", "baseline, avx2");
  EXPECT_NO_THROW(Batch<float>(plan, 1, {.target = Target::baseline}));
}

TEST(AutomaticEngine, is_compiled_for_smooth_plans_and_the_tables_for_others) {
  if (contract::engine_preferred) GTEST_SKIP() << "LOCKSTEP_TEST_ENGINE is set";
  Model bounded = scenes::chain8(), long_one = scenes::chain32();
  bounded.joints[0].friction = long_one.joints[0].friction = 0.1;
  const Plan small = compile(scenes::chain8()), large = compile(scenes::chain32(), {.method = Method::direct}),
             small_with_friction = compile(bounded), with_friction = compile(long_one);
  for (const Plan& plan : {small, large, small_with_friction}) {
    EXPECT_EQ(Batch<float>(plan, 1).engine(), physics::engines().back());
    EXPECT_NE(plan.describe().find("Engine: compiled"), std::string::npos) << plan.describe();
  }
  EXPECT_EQ(Batch<float>(small, 1, {.target = Target::baseline}).engine(), Engine::tables);
  EXPECT_EQ(Batch<double>(with_friction, 1).engine(), Engine::tables);
  EXPECT_NE(with_friction.describe().find("Engine: tables;"), std::string::npos) << with_friction.describe();
}

TEST(RequestedEngine, runs_or_is_refused) {
  const Plan plan = compile(scenes::chain8()), large = compile(scenes::chain32(), {.method = Method::direct});
  for (const Engine engine : physics::engines())
    for (const Plan& each : {plan, large}) {
      const Batch<float> batch(each, 1, {.engine = engine});
      EXPECT_EQ(batch.engine(), engine);
      EXPECT_EQ(batch.kernel_name(), "");
    }
  expect_refused<SettingsError>([&] { Batch<float>(plan, 1, {.engine = Engine::generated}); }, "engine",
                                "lockstep_add_kernel");
  Model limited = scenes::chain8();
  limited.joints[0].drive.kp = 1.0, limited.joints[0].effort_limit = 1.0;
  expect_refused<SettingsError>(
      [&] { Batch<float>(compile(limited, {.method = Method::pgs}), 1, {.engine = Engine::compiled}); }, "engine",
      "tables");
}

TEST(ToString, names_targets_and_engines) {
  for (Target target : all_targets) EXPECT_NE(std::string(to_string(target)), "unknown");
  EXPECT_STREQ(to_string(Engine::automatic), "automatic");
  EXPECT_STREQ(to_string(Engine::tables), "tables");
  EXPECT_STREQ(to_string(Engine::compiled), "compiled");
  EXPECT_STREQ(to_string(Engine::generated), "generated");
}

}  // namespace
}  // namespace lockstep
