// Contradictions are refused by name, or shared and named. SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "lockstep/error.h"
#include "mechanisms.h"
#include "scenes/scenes.h"
#include "watch.h"

namespace lockstep::stability {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
using Names = std::vector<std::string>;

std::string refusal(const Model& model) {
  try {
    compile(model);
  } catch (const ModelError& error) {
    return error.what();
  }
  return "";
}

TEST(Contradiction, couplings_with_nan_or_extreme_numbers_are_refused_by_name) {
  for (double offset : {nan, infinity, -infinity}) {
    Model model = scenes::chain8();
    model.couplings[1].offset = offset;
    EXPECT_NE(refusal(model).find("coupling 'j1'"), std::string::npos) << refusal(model);
  }
  for (double ratio : {nan, infinity, 0.0, 1e20, -1e20, 1e-20}) {
    Model model = scenes::chain8();
    model.couplings[1].terms[0].ratio = ratio;
    EXPECT_NE(refusal(model).find("coupling 'j1'"), std::string::npos) << ratio << ": " << refusal(model);
  }
}

TEST(Contradiction, loop_that_cannot_close_is_refused_by_the_names_of_its_couplings) {
  EXPECT_EQ(refusal(loop(0.0)), "");
  const std::string message = refusal(loop(0.1));
  for (const char* side : {"j0", "j2", "j0#2"}) EXPECT_NE(message.find(side), std::string::npos) << message;
}

// Only one environment cannot close the loop. The third coupling is redundant, so the others hold. The neighbour does
// not change.
TEST(Contradiction, loop_that_cannot_close_in_one_environment_stays_quiet_there) {
  with_exact_methods([](auto scalar, double dt, Method method) {
    using S = decltype(scalar);
    Model model = loop(0.0);
    for (Joint& joint : model.joints) joint.damping = 0.3;
    StepSettings settings = recorded(dt, method);
    settings.per_environment = {Parameter::offset};
    Watch<S> watch(model, settings, 2), single(model, settings);
    watch.batch.parameter(Parameter::offset)(2, 1) = S(0.1);
    watch.run(20.0), single.run(20.0);
    const auto errors = watch.batch.coupling_errors();
    EXPECT_TRUE(watch.finite());
    EXPECT_EQ(watch.batch.faulted(), 0);
    EXPECT_LE(errors.topRows(2).abs().maxCoeff(), hard_tolerance<S>);
    EXPECT_NEAR(errors(2, 1), 0.1, 1e-4);
    EXPECT_LE(std::abs(errors(2, 0)), hard_tolerance<S>);
    EXPECT_LE(watch.speed(), 1e-3);
    EXPECT_EQ(watch.batch.conflicts(1), (Names{"coupling j0", "coupling j2", "coupling j0#2"}));
    EXPECT_EQ(watch.batch.conflicts(0), Names{});
    EXPECT_TRUE((watch.batch.positions().col(0) == single.batch.positions().col(0)).all());
  });
}

// `direct` keeps both sides of a contradiction through a coupling in an inverse, in which they are nearly dependent
// (M61), and lets them share the violation by a compliance. In single precision the coupling loses digits, so it is
// named as well.
template <class S>
void expect_named(const Watch<S>& watch, const Names& both) {
  const bool single = sizeof(S) == 4;
  EXPECT_TRUE(watch.finite());
  EXPECT_EQ(watch.batch.faulted(), 0);
  EXPECT_LE(watch.error(), single ? 3e-2 : 1e-5);  // it grows with 1 / h
  EXPECT_LE(watch.speed(), single ? 0.2 : 1e-3);
  const Names named = watch.batch.conflicts(0);
  for (const std::string& side : both) EXPECT_NE(std::find(named.begin(), named.end(), side), named.end()) << side;
}

template <class S>
void expect_quiet_and_named(const Watch<S>& watch, const Names& both, int environment = 0) {
  EXPECT_TRUE(watch.finite());
  EXPECT_EQ(watch.batch.faulted(), 0);
  EXPECT_LE(watch.error(), hard_tolerance<S>);
  EXPECT_LE(watch.speed(), 1e-3);
  EXPECT_EQ(watch.batch.conflicts(environment), both);
}

// q_0 <= 0.2 and q_2 >= 0.25 contradict q_0 = q_2. The neighbour has q_0 = q_2 - 0.1, so it can meet its limits.
TEST(Contradiction, limits_that_contradict_through_a_coupling_share_the_violation) {
  Model model = scenes::chain8();
  for (Joint& joint : model.joints) joint.damping = 0.3;
  model.joints[0].upper = 0.2;
  model.joints[2].lower = 0.25;
  const Names both = {"position limit j0", "position limit j2"};
  at_all_steps([&](auto scalar, double dt) {
    using S = decltype(scalar);
    StepSettings settings = recorded(dt);
    settings.per_environment = {Parameter::offset};
    Watch<S> watch(model, settings, 2);
    watch.batch.parameter(Parameter::offset)(0, 1) = S(0.1);
    watch.start();
    watch.run(2.0);
    EXPECT_NEAR(watch.position(0), 0.225, 1e-5);
    EXPECT_NEAR(watch.velocity(0), 0.0, 1e-3);
    watch.run(20.0);
    expect_quiet_and_named(watch, both);
    EXPECT_NEAR(watch.position(0), 0.225, 1e-5);
    EXPECT_LE(watch.batch.limit_violations()(0, 1), 1e-5);
    EXPECT_EQ(watch.batch.conflicts(1), Names{});
  });
  at_all_steps([&](auto scalar, double dt) {
    using S = decltype(scalar);
    Watch<S> direct(model, recorded(dt, Method::direct));
    direct.run(20.0);
    expect_named(direct, both);
    EXPECT_NEAR(direct.position(0), 0.225, sizeof(S) == 4 ? 1e-2 : 1e-5);
  });
}

// Runs `direct` and expects the first joint of the first environment at `end`.
template <class Prescribe>
void expect_named_by_direct(const Model& model, const Prescribe& prescribe, const Names& both, double end,
                            double end_in_floats) {
  at_all_steps([&](auto scalar, double dt) {
    using S = decltype(scalar);
    Watch<S> direct(model, recorded(dt, Method::direct), 2);
    prescribe(direct);
    direct.run(3.0);
    expect_named(direct, both);
    const bool single = sizeof(S) == 4;
    EXPECT_NEAR(direct.position(0), single ? end_in_floats : end, single ? 1e-2 : 1e-4);
    if (sizeof(S) == 8) {
      EXPECT_EQ(direct.batch.conflicts(1), Names{});
    }
  });
}

// Two drives prescribe different motions of coupled joints. The coupling holds, and the joints meet in the middle.
TEST(Contradiction, kinematic_drives_that_contradict_through_a_coupling_meet_in_the_middle) {
  Model model = pair(Arrangement::second_on_first);
  for (Joint& joint : model.joints) joint.drive.kinematic = true;
  const Names both = {"kinematic drive j0", "kinematic drive j1"};
  const auto prescribe = [](auto& watch) { watch.batch.position_targets() << 0.3, 0.2, -0.3, 0.2; };
  at_all_steps([&](auto scalar, double dt) {
    using S = decltype(scalar);
    Watch<S> watch(model, recorded(dt), 2);
    prescribe(watch);
    watch.run(3.0);
    expect_quiet_and_named(watch, both);
    EXPECT_NEAR(watch.position(0, 0), 0.0, 1e-5);
    EXPECT_NEAR(watch.position(0, 1), 0.2, 1e-5);
    EXPECT_EQ(watch.batch.conflicts(1), Names{});
  });
  expect_named_by_direct(model, prescribe, both, 0.0, 0.0);
}

// A limit takes precedence over a prescribed motion, and the step names both.
TEST(Contradiction, kinematic_drive_beyond_the_limit_of_its_follower_stops_there) {
  Model model = pair(Arrangement::second_on_first);
  model.joints[0].upper = 0.1;
  model.joints[1].drive.kinematic = true;
  const Names both = {"position limit j0", "kinematic drive j1"};
  const auto prescribe = [](auto& watch) { watch.batch.position_targets().row(1) << 0.5, -0.5; };
  at_all_steps([&](auto scalar, double dt) {
    using S = decltype(scalar);
    Watch<S> watch(model, recorded(dt), 2);
    prescribe(watch);
    watch.run(2.0);
    expect_quiet_and_named(watch, both);
    EXPECT_NEAR(watch.position(0, 0), 0.1, 1e-5);
    EXPECT_NEAR(watch.position(0, 1), -0.5, 1e-5);
    EXPECT_EQ(watch.batch.conflicts(1), Names{});
  });
  // At x beyond the limit, the limit corrects 0.2 x per step and the drive lacks 0.4 - x. The drive yields 300 times as
  // much as the limit, and 100 times in floats.
  expect_named_by_direct(model, prescribe, both, 0.1 + 0.4 / (1.0 + 0.2 * 300), 0.1 + 0.4 / (1.0 + 0.2 * 100));
}

}  // namespace
}  // namespace lockstep::stability
