// Drives that are late, and motors whose effort falls with speed: theory, and a twin without either that is told by
// hand what drives apply. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <deque>

#include "contact_scenes.h"
#include "reference/random_bounds.h"

namespace lockstep {
namespace {

using Eigen::ArrayXXd;

constexpr double dt = 0.004;
constexpr BatchOptions serial = {.threads = 1};

const ParameterSet all = {Parameter::drive_delay, Parameter::drive_lag, Parameter::motor_curve};

StepSettings with(Integrator integrator, ParameterSet fields = all) {
  StepSettings settings;
  settings.dt = dt, settings.integrator = integrator, settings.per_environment = fields;
  settings.contacts = {.passes = 3, .rounds = 100, .tolerance = 1e-10};
  return settings;
}

/// A flywheel of 0.5 kg m^2 on a shaft.
constexpr double inertia = 0.5;
Model wheel(const Drive& drive, double effort_limit = infinity) {
  Model model;
  model.links = {{"base", Inertia::box(1.0, {0.1, 0.1, 0.1}, {0, 0, 0})},
                 {"wheel", {1.0, {0, 0, 0}, Eigen::Vector3d(0.4, 0.4, inertia).asDiagonal()}}};
  Joint joint;
  joint.name = "shaft", joint.kind = JointKind::revolute, joint.parent = "base", joint.child = "wheel";
  joint.axis = Eigen::Vector3d::UnitZ(), joint.drive = drive, joint.effort_limit = effort_limit;
  model.joints = {joint};
  return model;
}

/// It stands on its target after each step.
Model placed(int delay, double lag) { return wheel({.kinematic = true, .delay = delay, .lag = lag}); }

class Actuators : public testing::TestWithParam<Integrator> {};
INSTANTIATE_TEST_SUITE_P(integrator, Actuators, testing::Values(Integrator::euler, Integrator::leapfrog),
                         [](const auto& tested) { return std::string(to_string(tested.param)); });

// ---------------------------------------------------------------- theory

TEST(Delay, is_exact_in_steps_and_differs_between_environments) {
  Batch<float> batch(compile(placed(5, 0.0), with(Integrator::euler)), 6, serial);
  for (int e = 0; e < 6; ++e) batch.parameter(Parameter::drive_delay)(0, e) = static_cast<float>(e);
  for (int step = 1; step <= 20; ++step) {
    batch.position_targets().setConstant(0.01f * static_cast<float>(step));
    batch.step();
    for (int e = 0; e < 6; ++e)
      EXPECT_NEAR(batch.positions()(0, e), 0.01 * std::max(0, step - e), 1e-6) << "step " << step << " delay " << e;
  }
}

// (M154): y = 1 - exp(-t / tau), and what is applied is its mean over the step.
TEST(Lag, follows_a_step_of_its_target_as_the_closed_form_does) {
  const double lags[] = {0.0, 1e-300, 1e-4, 0.004, 0.05, 2.0, 1e12};
  Batch<double> batch(compile(placed(0, 0.1), with(Integrator::euler)), 7, serial);
  for (int e = 0; e < 7; ++e) batch.parameter(Parameter::drive_lag)(0, e) = lags[e];
  batch.position_targets().setConstant(1.0);
  for (int step = 1; step <= 200; ++step) {
    batch.step();
    for (int e = 0; e < 7; ++e) {
      const double tau = lags[e], begin = (step - 1) * dt;
      const double left = tau < 1e-200 ? 0.0 : std::exp(-begin / tau) * tau / dt * -std::expm1(-dt / tau);
      EXPECT_NEAR(batch.positions()(0, e), 1.0 - left, 1e-13) << "step " << step << " lag " << tau;
    }
  }
}

// A target that rises by h in each step, against a fine integration of y' = (u - y) / tau.
TEST(Lag, follows_a_ramp_as_its_differential_equation_does) {
  constexpr double tau = 0.03;
  constexpr int parts = 2000;
  Batch<double> batch(compile(placed(0, tau), with(Integrator::euler, {})), 1, serial);
  double y = 0.0;
  for (int step = 1; step <= 60; ++step) {
    const double target = step * dt, h = dt / parts;
    batch.position_targets()(0, 0) = target;
    batch.step();
    double mean = 0.0;
    for (int k = 0; k < parts; ++k) {  // the midpoint rule
      const double middle = y + 0.5 * h * (target - y) / tau;
      mean += middle / parts;
      y += h * (target - middle) / tau;
    }
    EXPECT_NEAR(batch.positions()(0, 0), mean, 1e-10) << step;
  }
  EXPECT_NEAR(60 * dt - y, tau, 0.1 * tau) << "it ends up late by its time constant";
}

// (M155): v = v_0 (1 - exp(-stall t / (I v_0))), at first order in the step.
TEST_P(Actuators, bring_a_motor_to_its_no_load_speed_at_first_order) {
  constexpr double stall = 6.0, end = 0.48;
  const double no_load[] = {2.0, 4.0, 9.0};
  double last[3];
  for (const int halvings : {0, 1, 2}) {
    StepSettings settings = with(GetParam());
    settings.dt = dt / (1 << halvings);
    Batch<double> batch(compile(wheel({.stall_effort = stall, .no_load_speed = 5.0}, 100.0), settings), 3, serial);
    for (int e = 0; e < 3; ++e) batch.parameter(Parameter::motor_curve)(1, e) = no_load[e];
    batch.efforts().setConstant(50.0);
    batch.step(static_cast<int>(std::lround(end / settings.dt)));
    for (int e = 0; e < 3; ++e) {
      const double rate = stall / (inertia * no_load[e]);
      const double error = batch.velocities()(0, e) - no_load[e] * -std::expm1(-rate * end);
      EXPECT_LT(std::abs(error), rate * settings.dt * no_load[e]);
      if (halvings > 0) {
        EXPECT_NEAR(last[e] / error, 2.0, 0.15) << "no-load speed " << no_load[e];
      }
      last[e] = error;
    }
    batch.step(static_cast<int>(20.0 / settings.dt));
    for (int e = 0; e < 3; ++e) EXPECT_NEAR(batch.velocities()(0, e), no_load[e], 1e-9);
  }
}

// Forwards, backwards and braking; the limit alone bounds a brake.
TEST_P(Actuators, limit_a_motor_by_the_way_in_which_it_pushes) {
  constexpr double stall = 6.0, no_load = 4.0, limit = 5.0;
  Batch<double> batch(compile(wheel({.stall_effort = stall, .no_load_speed = no_load}, limit), with(GetParam(), {})), 6,
                      serial);
  const double speed[] = {3.0, 3.0, -3.0, -3.0, 0.5, 7.0}, effort[] = {50.0, -50.0, 50.0, -50.0, 50.0, 50.0};
  const double expected[] = {stall * 0.25, -limit, limit, -stall * 0.25, limit, 0.0};
  for (int e = 0; e < 6; ++e) batch.velocities()(0, e) = speed[e], batch.efforts()(0, e) = effort[e];
  batch.step();
  for (int e = 0; e < 6; ++e) EXPECT_NEAR(inertia * (batch.velocities()(0, e) - speed[e]) / dt, expected[e], 1e-9) << e;
}

// With steps of three times its own time constant, a motor passes its no-load speed by at most h stall / I, once.
TEST_P(Actuators, keep_a_motor_stable_for_any_step) {
  constexpr double stall = 6.0, no_load = 4.0;
  StepSettings settings = with(GetParam(), {});
  settings.dt = 3.0 * inertia * no_load / stall, settings.guard = infinity;
  Batch<double> batch(compile(wheel({.stall_effort = stall, .no_load_speed = no_load}, 100.0), settings), 1, serial);
  batch.efforts().setConstant(50.0);
  for (int step = 0; step < 50; ++step) {
    batch.step();
    EXPECT_LE(batch.velocities()(0, 0), settings.dt * stall / inertia * (1.0 + 1e-12));
    EXPECT_GE(batch.velocities()(0, 0), no_load);
  }
}

TEST_P(Actuators, show_in_recorded_efforts_what_drives_really_apply) {
  StepSettings settings = with(GetParam(), {});
  settings.record_efforts = true;
  Batch<double> batch(
      compile(wheel({.kp = 80.0, .kd = 2.0, .delay = 3, .lag = 0.02, .stall_effort = 9.0, .no_load_speed = 6.0}, 7.0),
              settings),
      3, serial);
  const Query query{Quantity::drive_effort};
  Batch<double>::Array effort(1, 3);
  for (int step = 0; step < 200; ++step) {
    for (int e = 0; e < 3; ++e) batch.position_targets()(0, e) = (step / 50 % 2 == 0 ? 1.0 : -1.0) * e;
    const ArrayXXd before = batch.velocities();
    batch.step();
    batch.read(std::span(&query, 1), {effort.data(), 3, 1});
    for (int e = 0; e < 3; ++e)
      EXPECT_NEAR(effort(0, e), inertia * (batch.velocities()(0, e) - before(0, e)) / dt, 1e-8) << step;
  }
}

// ---------------------------------------------------------------- beside everything else

/// Tells a batch without actuators, whose effort limits differ, what those of `model` would apply.
class Twin {
 public:
  Twin(Batch<double>& late, Batch<double>& plain) : late_(late), plain_(plain) {
    const auto shown = {late.position_targets(), late.velocity_targets(), late.efforts()};
    for (const auto& rows : shown) lagged_.push_back(rows), waiting_.push_back(std::deque<ArrayXXd>(20, rows));
  }

  void step() {
    const Model& model = late_.plan().model();
    const Batch<double>::View shown[] = {late_.position_targets(), late_.velocity_targets(), late_.efforts()};
    Batch<double>::View told[] = {plain_.position_targets(), plain_.velocity_targets(), plain_.efforts()};
    const auto delay = late_.parameter(Parameter::drive_delay), lag = late_.parameter(Parameter::drive_lag),
               curve = late_.parameter(Parameter::motor_curve);
    auto limits = plain_.parameter(Parameter::effort_limit);
    for (std::size_t input = 0; input < 3; ++input) {
      waiting_[input].push_front(shown[input]);
      for (int dof = 0; dof < late_.plan().dofs(); ++dof)
        for (int e = 0; e < late_.environments(); ++e) {
          const double u = waiting_[input][static_cast<std::size_t>(delay(dof, e))](dof, e), tau = lag(dof, e);
          double& y = lagged_[input](dof, e);
          told[input](dof, e) = tau > 0.0 ? u + (y - u) * -std::expm1(-dt / tau) * tau / dt : u;
          y = tau > 0.0 ? u + (y - u) * std::exp(-dt / tau) : u;
        }
      waiting_[input].pop_back();
    }
    int dof = 0;
    for (const Joint& joint : model.joints) {
      if (!joint.moves()) continue;
      for (int e = 0; e < late_.environments() && joint.drive.stall_effort < infinity; ++e) {
        const double v = plain_.velocities()(dof, e), reached = plain_.positions()(dof, e) + dt * v;
        const double wanted =
            joint.drive.kp * (told[0](dof, e) - reached) + joint.drive.kd * (told[1](dof, e) - v) + told[2](dof, e);
        const double share = 1.0 - std::copysign(1.0, wanted) * v / curve(2 * dof + 1, e);
        limits(dof, e) = std::min(std::max(curve(2 * dof, e) * share, 0.0), joint.effort_limit);
      }
      ++dof;
    }
    plain_.step();
    late_.step();
  }

 private:
  Batch<double>&late_, &plain_;
  std::vector<ArrayXXd> lagged_;
  std::vector<std::deque<ArrayXXd>> waiting_;
};

/// Its drives with delays, and where they say so with lags and motors.
Model late(Model model, bool with_lags) {
  int number = 0;
  for (Joint& joint : model.joints) {
    Drive& drive = joint.drive;
    if (!joint.moves() || (drive.kp == 0.0 && drive.kd == 0.0 && !drive.kinematic)) continue;
    drive.delay = 1 + ++number % 5;
    if (!with_lags) continue;
    drive.lag = 0.004 * (number % 4 + 1);
    if (drive.kinematic) continue;
    joint.effort_limit = std::min(joint.effort_limit, 10.0);
    drive.stall_effort = 1.2 * joint.effort_limit, drive.no_load_speed = 3.0;
  }
  return model;
}

Model plain(Model model) {
  for (Joint& joint : model.joints) {
    Drive& drive = joint.drive;
    drive.delay = 0, drive.lag = 0.0, drive.stall_effort = drive.no_load_speed = infinity;
  }
  return model;
}

void expect_as_told(const Model& model, Integrator integrator, double tolerance, int steps) {
  constexpr int environments = 5;
  Batch<double> batch(compile(model, with(integrator)), environments, serial);
  Batch<double> other(compile(plain(model), with(integrator, {Parameter::effort_limit})), environments, serial);
  auto delay = batch.parameter(Parameter::drive_delay), lag = batch.parameter(Parameter::drive_lag),
       curve = batch.parameter(Parameter::motor_curve);
  for (int e = 0; e < environments; ++e) {
    delay.col(e) = (delay.col(e) * e / 4.0).floor(), lag.col(e) *= 0.5 * e;
    curve.col(e) *= 0.8 + 0.1 * e;
  }
  Twin twin(batch, other);
  physics::Uniform uniform{std::mt19937_64(7)};
  for (int step = 0; step < steps; ++step) {
    if (step % 3 == 0)
      for (Eigen::Index dof = 0; dof < batch.plan().dofs(); ++dof)
        for (int e = 0; e < environments; ++e) {
          batch.position_targets()(dof, e) += uniform(-0.1, 0.1);
          batch.velocity_targets()(dof, e) = uniform(-0.5, 0.5), batch.efforts()(dof, e) = uniform(-0.5, 0.5);
        }
    twin.step();
    ASSERT_EQ(batch.faulted(), other.faulted());
    if (batch.faulted() > 0) return;
    const double scale = std::max(1.0, other.velocities().abs().maxCoeff());
    ASSERT_LE((batch.positions() - other.positions()).abs().maxCoeff(), tolerance * scale) << "step " << step;
    ASSERT_LE((batch.velocities() - other.velocities()).abs().maxCoeff(), tolerance * scale) << "step " << step;
    if (batch.root_poses().rows() > 0) {
      ASSERT_LE((batch.root_poses() - other.root_poses()).abs().maxCoeff(), tolerance * scale);
    }
  }
}

TEST_P(Actuators, delay_drives_beside_contacts_couplings_tendons_and_limits_to_the_bit) {
  expect_as_told(late(contact_scenes::quadruped(), false), GetParam(), 0.0, 150);
  expect_as_told(late(contact_scenes::finger(), false), GetParam(), 0.0, 150);
}

TEST_P(Actuators, lag_and_limit_drives_beside_contacts_couplings_tendons_and_limits) {
  expect_as_told(late(contact_scenes::quadruped(), true), GetParam(), 1e-7, 60);
  expect_as_told(late(contact_scenes::finger(), true), GetParam(), 1e-7, 60);
}

TEST(LateDrives, act_on_random_bounded_mechanisms_as_told) {
  physics::RandomBounds bounds(11);
  scenes::RandomOptions options = scenes::forests();
  options.redundant = options.coupling_error = false, options.max_tendons = 1;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    SCOPED_TRACE(seed);
    expect_as_told(late(bounds.draw(seed, options), true), Integrator::euler, 1e-6, 30);
  }
}

// ---------------------------------------------------------------- contracts

template <class S>
Batch<S> lively(const Plan& plan, int environments, const BatchOptions& options, int first = 0) {
  Batch<S> batch(plan, environments, options);
  auto delay = batch.parameter(Parameter::drive_delay), lag = batch.parameter(Parameter::drive_lag);
  for (int e = 0; e < environments; ++e) {
    const int number = (e + first) % 5;
    delay.col(e) = (delay.col(e) * S(number) / S(4)).floor(), lag.col(e) *= S(0.3 * number);
    batch.position_targets().col(e) += S(0.02 * number);
  }
  return batch;
}

template <class S>
void expect_same_bits(const Batch<S>& a, int i, const Batch<S>& b, int j) {
  EXPECT_TRUE((a.positions().col(i) == b.positions().col(j)).all() &&
              (a.velocities().col(i) == b.velocities().col(j)).all())
      << i << " and " << j;
}

template <class S>
void expect_the_same_anywhere() {
  const Plan plan = compile(late(contact_scenes::quadruped(), true), with(Integrator::automatic));
  Batch<S> batch = lively<S>(plan, 37, serial), threads = lively<S>(plan, 37, {.threads = 3});
  batch.step(40);
  for (int i = 0; i < 10; ++i) threads.step(4);
  for (int e = 0; e < 37; ++e) expect_same_bits(batch, e, threads, e);
  for (const int first : {1, 19}) {
    Batch<S> few = lively<S>(plan, 3, serial, first);
    few.step(40);
    for (int e = 0; e < 3; ++e) expect_same_bits(batch, first + e, few, e);
  }
}
TEST(LateDrives, have_the_same_bits_for_any_threads_batch_and_calls_in_single) { expect_the_same_anywhere<float>(); }
TEST(LateDrives, have_the_same_bits_for_any_threads_batch_and_calls_in_double) { expect_the_same_anywhere<double>(); }

TEST(LateDrives, are_saved_restored_and_copied_with_what_is_on_its_way) {
  const Plan plan = compile(late(contact_scenes::quadruped(), true), with(Integrator::automatic));
  Batch<float> batch = lively<float>(plan, 6, serial), other(plan, 6, serial);
  batch.step(3);
  batch.position_targets() += 0.1f;
  batch.step(1);
  other.restore(batch.save());
  const int from = 4;
  batch.copy(from, EnvironmentSet::all());
  batch.step(20), other.step(20);
  for (int e = 0; e < 6; ++e) expect_same_bits(batch, e, other, from);
}

TEST(LateDrives, begin_a_reset_and_other_settings_with_the_inputs_that_stand_there) {
  const Model model = placed(3, 0.02);
  Batch<double> batch(compile(model, with(Integrator::euler)), 2, serial);
  batch.position_targets().setConstant(0.5);
  batch.step(7);
  batch.reset({0}, {.keep_inputs = true});
  batch.reset({1});
  EXPECT_EQ(batch.position_targets()(0, 1), 0.0);
  batch.step();
  EXPECT_NEAR(batch.positions()(0, 0), 0.5, 1e-15);
  EXPECT_NEAR(batch.positions()(0, 1), 0.0, 1e-15);

  StepSettings longer = with(Integrator::euler);
  longer.dt = 2 * dt;
  Batch<double> other(compile(model, longer), 2, serial);
  batch.position_targets().setConstant(0.25);
  other.restore(batch.save(), {.other_settings = true});
  other.step();
  EXPECT_NEAR(other.positions()(0, 0), 0.25, 1e-15);
}

TEST(LateDrives, take_no_delay_that_is_none_and_leave_neighbours_alone) {
  const Plan plan = compile(late(contact_scenes::quadruped(), true), with(Integrator::automatic));
  const int dof = plan.dof("fl_hip"), passive = plan.dof("fl_knee");
  Batch<float> sound(plan, 8, serial), batch(plan, 8, serial);
  batch.parameter(Parameter::drive_delay)(dof, 1) = 0.5f;
  batch.parameter(Parameter::drive_delay)(dof, 2) = 77.0f;
  batch.parameter(Parameter::drive_delay)(passive, 3) = 1.0f;
  batch.parameter(Parameter::drive_lag)(dof, 4) = -1.0f;
  batch.parameter(Parameter::drive_lag)(dof, 5) = std::nanf("");
  batch.parameter(Parameter::motor_curve)(2 * dof, 6) = 0.0f;
  sound.step(5), batch.step(5);
  for (int e = 1; e < 7; ++e) EXPECT_EQ(batch.faults()[e], Fault::bad_value) << e;
  EXPECT_NE(batch.explain_fault(2).find("0 to the model's Drive::delay"), std::string::npos) << batch.explain_fault(2);
  for (const int e : {0, 7}) expect_same_bits(batch, e, sound, e);
}

TEST(LateDrives, are_drawn_with_delays_of_whole_steps) {
  Batch<float> batch(compile(late(contact_scenes::quadruped(), false), with(Integrator::automatic)), 50, serial);
  batch.randomize(Parameter::drive_delay, {.low = 0.0, .high = 1.0});
  const Eigen::ArrayXXf delays = batch.parameter(Parameter::drive_delay);
  EXPECT_TRUE((delays == delays.round()).all());
  EXPECT_EQ(delays.maxCoeff(), 5.0f);
  EXPECT_EQ(delays.minCoeff(), 0.0f);
  batch.step(5);
  EXPECT_EQ(batch.faulted(), 0);
  EXPECT_THROW(batch.randomize(Parameter::drive_delay, {.low = 0.0, .high = 1.5}), UsageError);
}

TEST(LateDrives, meet_a_target_that_is_nan_with_a_fault_when_it_arrives) {
  Batch<double> batch(compile(wheel({.kp = 10.0, .kd = 1.0, .delay = 4, .lag = 0.01}), with(Integrator::euler, {})), 2,
                      serial);
  batch.position_targets()(0, 1) = std::nan("");
  batch.step(4);
  EXPECT_EQ(batch.faulted(), 0);
  batch.step();
  EXPECT_EQ(batch.faults()[1], Fault::not_finite);
  EXPECT_EQ(batch.faults()[0], Fault::none);
  batch.position_targets().setZero();
  batch.reset();
  batch.step(10);
  EXPECT_EQ(batch.faulted(), 0);
}

TEST(LateDrives, are_refused_by_name_where_they_cannot_be) {
  const auto refuses = [](const Model& model, const char* part) {
    try {
      model.validate();
      ADD_FAILURE() << part;
    } catch (const ModelError& error) {
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
      EXPECT_NE(std::string(error.what()).find("shaft"), std::string::npos) << error.what();
    }
  };
  refuses(wheel({.delay = -1}), "delay");
  refuses(wheel({.delay = 1001}), "delay");
  refuses(wheel({.lag = -0.1}), "lag");
  refuses(wheel({.lag = infinity}), "lag");
  refuses(wheel({.stall_effort = 1.0}, 1.0), "no-load speed");
  refuses(wheel({.stall_effort = std::nan(""), .no_load_speed = 1.0}, 1.0), "stall effort");
  refuses(wheel({.stall_effort = 1.0, .no_load_speed = 1.0}), "effort limit");
  refuses(wheel({.kinematic = true, .stall_effort = 1.0, .no_load_speed = 1.0}, 1.0), "kinematic");

  StepSettings settings = with(Integrator::leapfrog, {});
  settings.stage_inputs = true;
  EXPECT_THROW(compile(wheel({.kp = 1.0, .delay = 2}), settings), SettingsError);
  Batch<double> batch(compile(wheel({.kp = 1.0, .lag = 0.1}), with(Integrator::euler, {})), 1, serial);
  EXPECT_THROW(batch.linearize(EnvironmentSet::all(), {}), UsageError);
}

}  // namespace
}  // namespace lockstep
