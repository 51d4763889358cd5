// Joints that turn for ever: whole turns are kept apart from the angle (M80). SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <numbers>

#include "contract.h"
#include "plan/program.h"

namespace lockstep {
namespace {

constexpr double turn = 2.0 * std::numbers::pi;

// A rotor about the vertical and a wheel beside it with wheel = -ratio rotor - offset. No gravity along the axes, no
// damping.
Model rotor(double ratio, double offset, double speed, Softness softness = {}) {
  Model model;
  model.links = {{"base", {}}};
  for (int i = 0; i < 2; ++i) physics::append_link(model, "base", {0, 0.3 * i, 0}, Eigen::Vector3d::UnitZ());
  model.joints[1].kind = JointKind::continuous;
  model.joints[0].velocity = speed;
  model.joints[1].velocity = -ratio * speed;
  model.joints[1].position = -offset;
  model.couplings.push_back(Coupling::mimic("j1", "j0", ratio, offset, softness));
  return model;
}

using physics::engines;

// C in double, by the angles and the whole turns.
template <class S>
double exact_error(const Batch<S>& batch, double ratio, double offset) {
  const auto angles = batch.angles().template cast<double>().eval(),
             turns = batch.turns().template cast<double>().eval();
  return angles(1, 0) + ratio * angles(0, 0) + offset + turn * std::fma(ratio, turns(0, 0), turns(1, 0));
}

template <class S>
class Turns : public testing::Test {};
using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(Turns, Precisions);

TYPED_TEST(Turns, a_rotor_keeps_its_coupling_for_an_hour) {
  using S = TypeParam;
  constexpr double speed = 300.0, dt = 1.0 / 240, ratio = 0.37, offset = 0.2;
  constexpr int minutes = 60, steps = 60 * 240;
  for (const Method method : {Method::reduced, Method::direct, Method::pgs}) {
    const Plan plan = compile(rotor(ratio, offset, speed), physics::settings(method, 4, 1, dt));
    for (const Engine engine : engines(plan)) {
      SCOPED_TRACE(testing::Message() << to_string(method) << ", " << to_string(engine));
      Batch<S> batch(plan, 1, {.threads = 1, .engine = engine});
      for (int minute = 1; minute <= minutes; ++minute) {
        batch.step(steps);
        ASSERT_EQ(batch.faulted(), 0) << batch.explain_fault(0);
        ASSERT_LE(std::abs(exact_error(batch, ratio, offset)), 1e-6) << minute;
        ASSERT_LE(batch.coupling_errors().abs().maxCoeff(), 1e-6) << minute;
        ASSERT_LE(batch.angles().abs().maxCoeff(), S(3.1417));
      }
      const double way = speed * 3600.0;
      EXPECT_NEAR(batch.turns()(0, 0), way / turn, 1e-5 * way);
      EXPECT_NEAR(batch.positions()(0, 0), way, 1e-5 * way);
      EXPECT_NEAR(batch.velocities()(0, 0), speed, 1e-4 * speed);
    }
  }
}

// The same model with a range that the step leaves out: its joints count as any others.
Model without_turns(Model model) {
  for (Joint& joint : model.joints) {
    if (joint.kind == JointKind::prismatic || joint.kind == JointKind::fixed) continue;
    joint.kind = JointKind::revolute;
    joint.lower = -1e5, joint.upper = 1e5;
  }
  return model;
}

// Random mechanisms that turn several times: springs, drives, soft couplings and N-joint couplings feel whole turns.
class TurnsOfMethods : public testing::TestWithParam<Method> {};

TEST_P(TurnsOfMethods, random_models_move_as_if_nothing_were_kept_apart) {
  scenes::RandomOptions options = scenes::forests();
  options.max_dofs = 8;
  options.redundant = false;
  int turned = 0;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    Model model = scenes::random_model(seed, options);
    for (Joint& joint : model.joints) joint.velocity *= 20.0, joint.stiffness *= 0.02, joint.drive.kp *= 0.02;
    for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog, Integrator::extrapolated}) {
      StepSettings settings = physics::settings(GetParam());
      settings.integrator = integrator;
      settings.ignore.position_limits.all = true;
      std::optional<Plan> plan, plain;
      try {
        plan = compile(model, settings), plain = compile(without_turns(model), settings);
      } catch (const SettingsError&) {  // an integrator that does not apply
        continue;
      }
      for (const Engine engine : engines(*plan)) {
        SCOPED_TRACE(testing::Message() << "seed " << seed << ", " << to_string(integrator) << ", "
                                        << to_string(engine));
        const BatchOptions by{.threads = 1, .engine = engine};
        Batch<double> ours(*plan, 1, by), theirs(*plain, 1, by);
        for (int i = 0; i < 12; ++i) ours.step(5), theirs.step(5);
        ASSERT_EQ(ours.faulted(), theirs.faulted());
        if (ours.faulted() > 0) continue;
        turned += (ours.turns() != 0.0).count() > 0;
        const double q = 1.0 + theirs.positions().abs().maxCoeff(), v = 1.0 + theirs.velocities().abs().maxCoeff();
        EXPECT_LE((ours.positions() - theirs.positions()).abs().maxCoeff(), 1e-8 * q);
        EXPECT_LE((ours.velocities() - theirs.velocities()).abs().maxCoeff(), 1e-7 * v);
        EXPECT_LE((ours.coupling_errors() - theirs.coupling_errors()).abs().maxCoeff(), 1e-8 * q);
      }
    }
  }
  EXPECT_GE(turned, 20 * static_cast<int>(engines().size()));
}

INSTANTIATE_TEST_SUITE_P(Methods, TurnsOfMethods, testing::ValuesIn(physics::methods), physics::method_name);

// One, some and all of the steps in a call, among other environments: the same bits.
TYPED_TEST(Turns, calls_and_neighbours_do_not_change_a_bit) {
  using S = TypeParam;
  Model star;  // of wheels that follow a driven one
  star.links = {{"base", {}}};
  for (int i = 0; i < 5; ++i) {
    physics::append_link(star, "base", {0, 0.3 * i, 0}, Eigen::Vector3d::Unit(i % 3)).damping = 0.001;
    if (i > 1)
      star.couplings.push_back(
          Coupling::mimic(physics::numbered("j", static_cast<std::size_t>(i)), "j0", 0.4 * i - 1.0, 0.1 * i));
  }
  star.couplings[0].terms.push_back({"j1", 0.7});
  for (const Model& model : {star, rotor(0.37, 0.2, 300.0), rotor(-1.0, 0.0, 50.0, Spring{5.0, 0.1})})
    for (const Method method : physics::methods)
      for (const ParameterSet& fields : {ParameterSet{}, ParameterSet{Parameter::gear_ratio, Parameter::offset}}) {
        const Plan plan = compile(model, contract::settings(method, fields));
        for (const Engine engine : engines(plan)) {
          SCOPED_TRACE(testing::Message() << model.name << ", " << to_string(method) << ", " << to_string(engine));
          const BatchOptions by{.threads = 1, .engine = engine};
          Batch<S> one(plan, 1, by), many(plan, 37, by);
          const auto start = [](Batch<S>& batch, int e, int seed) {
            contract::scatter(batch, e, static_cast<std::uint64_t>(seed));
            batch.velocities().col(e) *= S(10);
          };
          start(one, 0, 5);
          for (int e = 0; e < 37; ++e) start(many, e, e == 21 ? 5 : e);
          for (int i = 0; i < 60; ++i) {
            one.step(4);
            for (int k : {1, 3}) many.step(k);
            ASSERT_TRUE(contract::same_bits(one, 0, many, 21)) << i;
          }
          EXPECT_TRUE((one.turns().col(0) == many.turns().col(21)).all());
          EXPECT_TRUE((one.angles().col(0) == many.angles().col(21)).all());
          EXPECT_EQ(one.faulted(), 0);
          EXPECT_GT(one.turns().abs().maxCoeff(), S(0));
        }
      }
}

// The shorter step of consistent followers, among them one that mirrors its leader, and the step beside others.
TYPED_TEST(Turns, consistent_followers_have_the_same_bits_beside_others) {
  using S = TypeParam;
  Model model;
  model.links = {{"base", {}}};
  for (int i = 0; i < 5; ++i) {
    physics::append_link(model, "base", {0, 0.3 * i, 0}, Eigen::Vector3d::Unit(i % 3)).damping = 0.001;
    if (i > 0)
      model.couplings.push_back(
          Coupling::mimic(physics::numbered("j", i), "j0", std::vector{0., 1., -1., 0.7, -0.2}[i]));
  }
  const Plan plan = compile(model, physics::settings(Method::reduced));
  ASSERT_GT(program_of(plan).f64.reduction.mirrors.count, 0);
  for (const Engine engine : engines(plan)) {
    const BatchOptions by{.threads = 1, .engine = engine};
    constexpr int count = 32;
    Batch<S> all(plan, count, by), some(plan, count, by);
    for (Batch<S>* batch : {&all, &some})
      for (int e = 0; e < count; ++e) batch->positions()(0, e) = S(0.1 * e - 1.5), batch->velocities()(0, e) = S(3 * e);
    all.project();
    for (int e = 0; e < count; e += 4) some.positions()(1, e) = S(0.3);
    std::vector<int> others;
    for (int e = 0; e < count; ++e)
      if (e % 4 != 0) others.push_back(e);
    some.project(others);
    for (int i = 0; i < 300; ++i) {
      all.step(3);
      for (int k : {1, 2}) some.step(k);
      for (const int e : others) ASSERT_TRUE(contract::same_bits(all, e, some, e)) << i << to_string(engine);
    }
    EXPECT_GT(all.turns().abs().maxCoeff(), S(2));
  }
}

TYPED_TEST(Turns, positions_show_the_whole_angle_and_take_any_number) {
  using S = TypeParam;
  Batch<S> batch(compile(rotor(0.5, 0.0, 0.0), {}), 2, {.threads = 1});
  batch.positions()(0, 1) = S(3.0 * turn + 1.0);
  batch.positions()(1, 1) = S(-1.5 * turn - 0.5);
  EXPECT_NEAR(batch.angles()(0, 1), 1.0, 1e-5);
  EXPECT_EQ(batch.turns()(0, 1), S(3));
  batch.step(3);
  EXPECT_NEAR(batch.positions()(0, 1), 3.0 * turn + 1.0, 1e-5);
  EXPECT_NEAR(batch.positions()(1, 1), -1.5 * turn - 0.5, 1e-5);
  EXPECT_LE(batch.velocities().abs().maxCoeff(), S(1e-4));
  EXPECT_EQ(batch.turns()(0, 0), S(0));

  batch.reset({1});
  EXPECT_EQ(batch.turns().abs().maxCoeff(), S(0));
  EXPECT_EQ(batch.positions()(0, 1), S(0));

  // Followers far from zero are placed with all digits.
  batch.positions()(0, 0) = S(1001.25 * turn);
  EXPECT_TRUE(batch.project().empty());
  EXPECT_LE(std::abs(exact_error(batch, 0.5, 0.0)), 1e-6);
  EXPECT_NEAR(batch.positions()(1, 0), -500.625 * turn, 1e-3);
}

TYPED_TEST(Turns, drives_and_springs_reach_targets_that_are_turns_away) {
  using S = TypeParam;
  for (const bool limited : {false, true})
    for (const bool kinematic : {false, true}) {
      Model model = rotor(0.5, 0.0, 0.0);
      model.joints[0].velocity = model.joints[1].velocity = 0.0;
      model.couplings.clear();
      model.joints[0].drive = {0.2, 0.1, 3.0 * turn + 1.0, 0.0};
      if (limited) model.joints[0].effort_limit = 0.5;
      if (kinematic)
        model.joints[0].drive.kp = model.joints[0].drive.kd = 0.0, model.joints[0].drive.kinematic = true,
        model.joints[0].drive.softness = Hard{0.1};
      model.joints[1].stiffness = 0.2, model.joints[1].damping = 0.1, model.joints[1].rest = -2.0 * turn - 0.5;
      const Plan plan = compile(model, {});
      for (const Engine engine : engines(plan)) {
        SCOPED_TRACE(testing::Message() << limited << kinematic << to_string(engine));
        Batch<S> batch(plan, 1, {.threads = 1, .engine = engine});
        batch.step(240 * 20);
        ASSERT_EQ(batch.faulted(), 0) << batch.explain_fault(0);
        EXPECT_NEAR(batch.positions()(0, 0), 3.0 * turn + 1.0, 1e-4);
        EXPECT_NEAR(batch.positions()(1, 0), -2.0 * turn - 0.5, 1e-4);
        EXPECT_EQ(batch.turns()(0, 0), S(3));
      }
    }
}

// What a user writes after a joint has been beyond a turn and back must not depend on the neighbours, nor on how the
// steps were split into calls.
TYPED_TEST(Turns, a_turn_that_is_written_is_taken_alike_beside_any_neighbour) {
  using S = TypeParam;
  const Plan plan = compile(rotor(0.5, 0.1, 0.0), physics::settings(Method::reduced));
  for (const Engine engine : engines(plan))
    for (int trial = 0; trial < 30; ++trial) {
      const BatchOptions by{.threads = 1, .engine = engine};
      Batch<S> alone(plan, 1, by), beside(plan, 2, by);
      beside.positions()(0, 1) = S(20);
      for (Batch<S>* batch : {&alone, &beside}) batch->velocities()(0, 0) = S(0.1 * trial + 0.3);
      alone.step(8);
      for (int i = 0; i < 8; ++i) beside.step(1);
      for (Batch<S>* batch : {&alone, &beside}) batch->positions()(0, 0) += S(turn), batch->step(10);
      ASSERT_TRUE(contract::same_bits(alone, 0, beside, 0)) << trial << to_string(engine);
    }
}

TYPED_TEST(Turns, a_frozen_environment_keeps_the_position_that_was_written) {
  using S = TypeParam;
  StepSettings settings = physics::settings(Method::reduced);
  settings.per_environment = {Parameter::damping};
  const Plan plan = compile(rotor(0.5, 0.0, 0.0), settings);
  for (const Engine engine : engines(plan))
    for (int trial = 0; trial < 30; ++trial) {
      Batch<S> batch(plan, 2, {.threads = 1, .engine = engine});
      const S far = S(5 + 7.31 * trial);
      batch.positions()(0, 0) = far, batch.positions()(1, 0) = S(-0.0), batch.positions()(0, 1) = S(20);
      batch.parameter(Parameter::damping)(0, 0) = S(-1);
      batch.step(2);
      ASSERT_EQ(batch.faults()[0], Fault::bad_value);
      ASSERT_EQ(batch.positions()(0, 0), far);
      ASSERT_TRUE(std::signbit(batch.positions()(1, 0)));
    }
}

// Followers that are consistent step by a list of their own, which must not lose the last good state either.
TYPED_TEST(Turns, a_joint_too_fast_to_count_keeps_its_state_in_every_engine) {
  using S = TypeParam;
  StepSettings settings = physics::settings(Method::reduced);
  settings.velocity_bound = 1e30;
  const Plan plan = compile(rotor(0.5, 0.0, 0.0), settings);
  for (const Engine engine : engines(plan)) {
    Batch<S> batch(plan, 2, {.threads = 1, .engine = engine});
    batch.velocities()(0, 0) = S(sizeof(S) == 4 ? 1e10 : 1e19);
    batch.velocities()(1, 0) = S(-0.5) * batch.velocities()(0, 0);
    batch.step(3);
    EXPECT_EQ(batch.faults()[0], Fault::diverged);
    EXPECT_EQ(batch.positions()(0, 0), S(0)) << to_string(engine);
    EXPECT_EQ(batch.faults()[1], Fault::none);
  }
}

// More turns than a rounded position tells apart, and numbers that are none.
TYPED_TEST(Turns, what_cannot_be_counted_is_a_fault) {
  using S = TypeParam;
  const Plan plan = compile(rotor(0.5, 0.0, 10.0), {});
  for (const Engine engine : engines(plan)) {
    Batch<S> batch(plan, 4, {.threads = 1, .engine = engine});
    batch.positions()(0, 1) = sizeof(S) == 4 ? S(1e8) : S(1e30);
    batch.positions()(0, 2) = std::numeric_limits<S>::quiet_NaN();
    batch.step(2);
    EXPECT_EQ(batch.faults()[0], Fault::none);
    EXPECT_EQ(batch.faults()[1], Fault::diverged);
    EXPECT_EQ(batch.faults()[2], Fault::not_finite);
    EXPECT_EQ(batch.faults()[3], Fault::none);
    EXPECT_EQ(batch.positions()(0, 1), sizeof(S) == 4 ? S(1e8) : S(1e30));
    batch.step(200);
    EXPECT_TRUE(contract::same_bits(batch, 0, batch, 3));
    EXPECT_GT(batch.positions()(0, 0), S(8));
  }
}

}  // namespace
}  // namespace lockstep
