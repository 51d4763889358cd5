// Errors of the integrators on the scenes, and their orders in theory. SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <complex>

#include "accuracy.h"
#include "lockstep/import.h"

namespace lockstep {
namespace {

// Steps one environment of a scene with the targets at the time of each stage, and calls watch(step) after each step.
template <class S>
struct Play {
  Play(const scenes::Scene& which, Integrator integrator, int steps_per_second)
      : scene(which),
        dt(1.0 / steps_per_second),
        batch(compile(scene.model, {.dt = dt, .integrator = integrator, .stage_inputs = true}), 1, {.threads = 1}) {}

  template <class Watch>
  void run(int steps, Watch&& watch) {
    const std::vector<double> times = batch.plan().stage_times();
    const int dofs = batch.plan().dofs();
    for (int step = 0; step < steps; ++step) {
      for (std::size_t time = 0; time < times.size(); ++time)
        batch.position_targets().col(0).segment(static_cast<int>(time) * dofs, dofs) =
            scene.targets((step + times[time]) * dt).array().template cast<S>();
      batch.step();
      watch(step + 1);
    }
  }

  scenes::Scene scene;
  double dt;
  Batch<S> batch;
};

// RMS error over all joints and the first second at rows of 1/240 s, as in accuracy.h.
template <class S>
double rms_error(const scenes::Scene& scene, Integrator integrator, int steps_per_second,
                 const Eigen::MatrixXd& truth) {
  Play<S> play(scene, integrator, steps_per_second);
  double sum = 0.0;
  play.run(steps_per_second, [&](int step) {
    if (step * 240 % steps_per_second != 0) return;
    const auto row = step * 240 / steps_per_second;
    sum += (play.batch.positions().col(0).matrix().template cast<double>() - truth.row(row).transpose()).squaredNorm();
  });
  return std::sqrt(sum / static_cast<double>(truth.size() - truth.cols()));
}

template <class S>
double rms_error(const std::string& name, Integrator integrator, int steps_per_second, const Eigen::MatrixXd& truth) {
  return rms_error<S>(scenes::scene(name), integrator, steps_per_second, truth);
}

class AgainstTruth : public testing::Test {
 protected:
  void SetUp() override {
    if (physics::test_data().empty()) GTEST_SKIP() << "LOCKSTEP_TEST_DATA names no folder with scenes/*.truth.txt";
  }
  Eigen::MatrixXd truth(const std::string& scene) const {
    return scenes::read_truth(physics::test_data() + "/scenes/" + scene + ".truth.txt").positions;
  }
};

TEST_F(AgainstTruth, chain8_is_within_1_5e_6_with_four_bias_forces_a_step) {
  for (const char* which : {"f32", "f64"}) {
    const bool single = which == std::string("f32");
    const double error = single ? rms_error<float>("chain8", Integrator::runge_kutta, 240, truth("chain8"))
                                : rms_error<double>("chain8", Integrator::runge_kutta, 240, truth("chain8"));
    EXPECT_LE(error, 1.5e-6) << which;
  }
}

TEST_F(AgainstTruth, gripper13_is_within_1e_4_with_one_mass_matrix_and_1e_5_extrapolated) {
  const Eigen::MatrixXd exact = truth("gripper13");
  EXPECT_LE(rms_error<float>("gripper13", Integrator::leapfrog, 240, exact), 1e-4);
  EXPECT_LE(rms_error<float>("gripper13", Integrator::extrapolated, 240, exact), 1e-5);
}

// The error of one step is of order h^(order + 1), that of a motion h^order. The truth files are exact to about 1e-8,
// and the errors in these cases are a hundred times larger.
TEST_F(AgainstTruth, errors_shrink_by_the_order_of_each_integrator) {
  const struct {
    const char* scene;
    Integrator integrator;
    int steps_per_second;
    double order;
  } cases[] = {{"chain8", Integrator::leapfrog, 480, 2.0},
               {"chain32", Integrator::leapfrog, 480, 2.0},
               {"gear100", Integrator::leapfrog, 480, 2.0},
               {"chain32", Integrator::extrapolated, 480, 3.0},
               {"chain32", Integrator::runge_kutta, 240, 4.0}};
  for (const auto& c : cases) {
    const Eigen::MatrixXd exact = truth(c.scene);
    const double ratio = rms_error<double>(c.scene, c.integrator, c.steps_per_second, exact) /
                         rms_error<double>(c.scene, c.integrator, 2 * c.steps_per_second, exact);
    EXPECT_NEAR(std::log2(ratio), c.order, 0.15) << c.scene << " " << to_string(c.integrator);
  }
}

// The files have no starts. The bounds are those of the files of truth, as in truth_test.cpp.
TEST_F(AgainstTruth, is_reached_by_the_scenes_from_their_mjcf) {
  const struct {
    const char* scene;
    int steps_per_second;
    double bound;
  } cases[] = {{"chain8", 480, 1e-7},    {"gripper13", 7680, 1e-7}, {"chain32", 480, 2e-6},  {"gear100", 480, 1e-7},
               {"drive1e6", 4800, 1e-7}, {"redundant", 480, 1e-7},  {"mass1000", 3840, 1e-7}};
  for (const auto& c : cases) {
    scenes::Scene scene = scenes::scene(c.scene);
    Model model = import_mjcf_file(physics::test_data() + "/scenes/" + c.scene + ".xml").model;
    for (const Joint& start : scene.model.joints) {
      Joint& joint = model.joints[static_cast<std::size_t>(model.joint_index(start.name))];
      joint.position = start.position, joint.velocity = start.velocity;
    }
    ASSERT_EQ(compile(model, {}).dof_names(), compile(scene.model, {}).dof_names());
    scene.model = model;
    EXPECT_LE(rms_error<double>(scene, Integrator::runge_kutta, c.steps_per_second, truth(c.scene)), c.bound)
        << c.scene;
  }
}

// The whip starts with 907.75 J. Damping removes 2 J in the first second.
double energy(Batch<double>& batch) { return batch.kinetic_energies()(0, 0) + batch.potential_energies()(0, 0); }

// Largest error of the energy in the first second, divided by the energy at the start. The exact energy comes from
// small steps of third order, whose error is a thousandth of the bounds below.
double energy_error(Integrator integrator, int steps_per_second) {
  constexpr int rows = 60;
  const auto energies = [&](Integrator how, int rate) {
    Play<double> play(scenes::scene("chain32"), how, rate);
    std::vector<double> all;
    play.run(rate, [&](int step) {
      if (step % (rate / rows) == 0) all.push_back(energy(play.batch));
    });
    EXPECT_EQ(play.batch.faulted(), 0);
    return all;
  };
  const std::vector<double> exact = energies(Integrator::extrapolated, 960),
                            ours = energies(integrator, steps_per_second);
  double worst = 0.0;
  for (std::size_t i = 0; i < exact.size(); ++i) worst = std::max(worst, std::abs(ours[i] - exact[i]));
  return worst / 907.75;
}

TEST(Whip, keeps_its_energy_with_leapfrogs) {
  EXPECT_LE(energy_error(Integrator::leapfrog, 240), 0.01);
  EXPECT_LE(energy_error(Integrator::leapfrog, 120), 0.05);
  EXPECT_LE(energy_error(Integrator::leapfrog, 60), 0.5);  // Euler's method diverges there
}

TEST(Whip, keeps_its_momentum_to_the_order_of_the_integrator) {
  const auto change = [](Integrator integrator, int rate) {
    Play<double> play(scenes::scene("chain32"), integrator, rate);
    const Eigen::ArrayXd start = play.batch.momenta().col(0);
    play.run(rate / 4, [](int) {});
    return (play.batch.momenta().col(0) - start).abs().maxCoeff();
  };
  for (const auto& [integrator, order] : {std::pair{Integrator::leapfrog, 2.0}, {Integrator::runge_kutta, 4.0}})
    EXPECT_GT(std::log2(change(integrator, 480) / change(integrator, 960)), order - 0.3) << to_string(integrator);
}

TEST(Float, follows_double_to_1e_6_over_a_second) {
  for (const char* scene : {"chain8", "gripper13"})
    for (const Integrator integrator :
         {Integrator::euler, Integrator::leapfrog, Integrator::extrapolated, Integrator::runge_kutta}) {
      if (scene == std::string("gripper13") && integrator == Integrator::runge_kutta) continue;  // refused as too stiff
      Play<float> single(scenes::scene(scene), integrator, 240);
      Play<double> in_double(scenes::scene(scene), integrator, 240);
      std::vector<Eigen::ArrayXd> exact;
      in_double.run(240, [&](int) { exact.push_back(in_double.batch.positions().col(0)); });
      double largest = 0.0;
      single.run(240, [&](int step) {
        const Eigen::ArrayXd off =
            single.batch.positions().col(0).cast<double>() - exact[static_cast<std::size_t>(step - 1)];
        largest = std::max(largest, off.abs().maxCoeff());
      });
      EXPECT_LE(largest, 1e-6) << scene << " " << to_string(integrator);
    }
}

// Damping removes energy; gravity and the springs of servos store it. The default integrator, here the leapfrog, adds
// no energy beyond rounding in any step of sixty seconds.
TEST(DefaultIntegrator, never_adds_energy_to_a_passive_scene) {
  for (const char* name : {"chain8", "gripper13"}) {
    const Model model = scenes::scene(name).model;
    const Plan plan = compile(model);
    ASSERT_EQ(plan.integrator(), Integrator::leapfrog);
    Batch<double> batch(plan, 1, {.threads = 1});
    if (name == std::string("gripper13")) {  // falls from a position that satisfies its couplings
      batch.positions().col(0) << 0.3, 0.3, 0.3, 0.3, 0.3, 0.3, 0.3, 0.3, -0.3, 0.3, 0.3, -0.3, 0.3;
      ASSERT_LT(batch.coupling_errors().abs().maxCoeff(), 1e-12);
    }
    const auto all_energy = [&] {
      double sum = energy(batch);
      for (const Joint& joint : model.joints) {
        const double stretch = batch.positions()(plan.dof(joint.name), 0) - joint.drive.position_target;
        sum += 0.5 * joint.drive.kp * stretch * stretch;
      }
      return sum;
    };
    double before = all_energy();
    const double start = before, rounding = 1e-13 * (1.0 + std::abs(start));
    for (int step = 0; step < 60 * 240; ++step) {
      batch.step();
      const double now = all_energy();
      ASSERT_LE(now, before + rounding) << name << " after " << step / 240.0 << " s";
      before = now;
    }
    EXPECT_LT(before, start - 0.5) << name << " has not lost energy";
  }
}

// Largest error after settling of a slider of 1 kg whose servo follows a sine.
double servo_error(double kp, double kd, int rate, bool staged) {
  constexpr double amplitude = 0.3, frequency = 3.0;  // m, rad/s
  Model model = physics::sliders({1.0});
  model.joints[0].drive = {kp, kd, 0.0, 0.0};
  const StepSettings settings{.dt = 1.0 / rate, .integrator = Integrator::leapfrog, .stage_inputs = staged};
  Batch<double> batch(compile(model, settings), 1, {.threads = 1});
  const std::vector<double> times = staged ? batch.plan().stage_times() : std::vector<double>{0.0};
  // With e = q - q_t: e'' + kd e' + kp e = -q_t''.
  const std::complex<double> lag =
      amplitude * frequency * frequency / std::complex<double>(kp - frequency * frequency, kd * frequency);
  double worst = 0.0;
  for (int step = 0; step < rate; ++step) {
    for (std::size_t i = 0; i < times.size(); ++i) {
      const double t = (step + times[i]) * settings.dt;
      batch.position_targets()(static_cast<Eigen::Index>(i), 0) = amplitude * std::sin(frequency * t);
      batch.velocity_targets()(static_cast<Eigen::Index>(i), 0) = amplitude * frequency * std::cos(frequency * t);
    }
    batch.step();
    const double t = (step + 1) * settings.dt;
    const double exact = amplitude * std::sin(frequency * t) + (lag * std::polar(1.0, frequency * t)).imag();
    if (t > 0.5) worst = std::max(worst, std::abs(batch.positions()(0, 0) - exact));
  }
  return worst;
}

double servo_order(double kp, double kd, int rate, bool staged) {
  return std::log2(servo_error(kp, kd, rate, staged) / servo_error(kp, kd, 2 * rate, staged));
}

// A servo approaches its target at the rate kp / kd. With steps that are short for this rate, the linear part is of
// third order. With long steps, the error (gamma h)^2 q'' / 2 of each stage is divided by h kp / kd, which leaves first
// order.
TEST(OrderReduction, goes_from_three_to_one_as_servos_get_stiff) {
  EXPECT_NEAR(servo_order(1e5, 2e3, 240, true), 3.0, 0.15);  // h kp / kd = 0.2
  EXPECT_NEAR(servo_order(1e11, 2e5, 60, true), 1.0, 0.15);  // h kp / kd = 8000
  EXPECT_LT(servo_error(1e11, 2e5, 60, true), 1e-6) << "a stiff servo must have a small error in spite of first order";
}

TEST(OrderReduction, goes_to_one_for_held_targets) {
  EXPECT_NEAR(servo_order(1e5, 2e3, 240, false), 1.0, 0.15);
  EXPECT_NEAR(servo_order(1e11, 2e5, 60, false), 1.0, 0.15);
  EXPECT_GT(servo_error(1e5, 2e3, 240, false), 1e3 * servo_error(1e5, 2e3, 240, true));
}

}  // namespace
}  // namespace lockstep
