// Followers that are functions of one joint: against closed forms, the reference, and what they are said to hold.
// SPDX-License-Identifier: Apache-2.0
//
// One file: nearly all tests move one of two mechanisms, a slider-crank with a closed form and a hand, which stand
// here.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "lockstep/batch.h"
#include "lockstep/error.h"
#include "model/functions.h"
#include "reference/functions.h"
#include "reference/integrators.h"
#include "reference/step.h"
#include "reference/truth.h"

namespace lockstep {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

const CamTable cam{{-2.0, -1.1, -0.3, 0.2, 1.0, 2.2}, {0.1, -0.3, 0.05, 0.3, 0.2, 0.5}};

Link link(const std::string& name, double mass, const Vector3d& center = Vector3d::Zero(), double about = 0.02) {
  Link result;
  result.name = name;
  result.inertia.mass = mass;
  result.inertia.center = center;
  result.inertia.about_center = Vector3d(about, 1.3 * about, 1.1 * about).asDiagonal();
  return result;
}

Joint joint(const std::string& name, JointKind kind, const std::string& parent, const std::string& child,
            const Vector3d& axis, const Vector3d& at = Vector3d::Zero()) {
  Joint result;
  result.name = name, result.kind = kind, result.parent = parent, result.child = child, result.axis = axis;
  result.origin.translation() = at;
  return result;
}

// A crank about z, which hangs in gravity along y, and a slider along y beside it: q_slider = f(q_crank).
struct CrankSlider {
  static constexpr double mass = 0.7, about = 0.05, arm = 0.2, slider = 1.3, gravity = 9.81, armature = 0.03,
                          spring = 4.0, damping = 0.05, armature_of_slider = 0.2;

  explicit CrankSlider(Function function, bool loses = false) : f(std::move(function)) {
    model.name = "engine";
    model.gravity = Vector3d(0.0, -gravity, 0.0);
    model.links = {link("base", 1.0), link("crank", mass, Vector3d(0.0, -arm, 0.0), about), link("slider", slider)};
    model.joints = {joint("crank", JointKind::revolute, "base", "crank", Vector3d::UnitZ()),
                    joint("slider", JointKind::prismatic, "base", "slider", Vector3d::UnitY(), Vector3d(0.5, 0, 0))};
    model.joints[0].armature = armature;
    model.joints[0].position = 0.3, model.joints[0].velocity = 2.0;
    model.joints[1].armature = armature_of_slider;
    model.joints[1].stiffness = spring;
    if (loses) model.joints[1].damping = damping;
    model.couplings = {Coupling::cam("slider", "crank", f)};
  }

  double inertia_of_crank() const { return 1.1 * about + mass * arm * arm + armature; }

  // (I + m f'^2) a + m f' f'' v^2 = - dV/dx - d f'^2 v, by hand.
  double acceleration(double x, double v) const {
    const reference::FunctionValue at = reference::value_of(f, x);
    const double m = slider + armature_of_slider;
    const double forces = -mass * gravity * arm * std::sin(x) -
                          at.slope * (slider * gravity + spring * at.value + model.joints[1].damping * at.slope * v);
    return (forces - m * at.slope * at.bend * v * v) / (inertia_of_crank() + m * at.slope * at.slope);
  }
  double energy(double x, double v) const {
    const reference::FunctionValue at = reference::value_of(f, x);
    const double m = slider + armature_of_slider;
    return 0.5 * (inertia_of_crank() + m * at.slope * at.slope) * v * v - mass * gravity * arm * std::cos(x) +
           slider * gravity * at.value + 0.5 * spring * at.value * at.value;
  }

  // Position and velocity of the crank after a second, by Runge-Kutta 4.
  std::pair<double, double> after_a_second() const {
    constexpr int steps = 20000;
    double x = model.joints[0].position, v = model.joints[0].velocity;
    const double h = 1.0 / steps;
    for (int i = 0; i < steps; ++i) {
      const double v1 = v, a1 = acceleration(x, v);
      const double v2 = v + h / 2 * a1, a2 = acceleration(x + h / 2 * v1, v2);
      const double v3 = v + h / 2 * a2, a3 = acceleration(x + h / 2 * v2, v3);
      const double v4 = v + h * a3, a4 = acceleration(x + h * v3, v4);
      x += h / 6 * (v1 + 2 * v2 + 2 * v3 + v4);
      v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
    }
    return {x, v};
  }

  Function f;
  Model model;
};

const std::vector<Function> functions = {Harmonic{0.1, 0.25, -0.1, 1.0}, Harmonic{0.0, 0.05, 0.1, -2.5},
                                         Polynomial{{0.1, 0.2, -0.15, 0.05}}, Polynomial{{0.0, 0.5}}, cam};

StepSettings with(Integrator integrator, double dt) {
  StepSettings settings;
  settings.dt = dt, settings.integrator = integrator;
  settings.guard = infinity;  // a halved step would hide the order
  return settings;
}

BatchOptions by_tables() {
  BatchOptions options;
  options.threads = 1, options.engine = Engine::tables;
  return options;
}

double error_after_a_second(const CrankSlider& engine, Integrator integrator, int steps) {
  const Plan plan = compile(engine.model, with(integrator, 1.0 / steps));
  Batch<double> batch(plan, 1, by_tables());
  batch.step(steps);
  EXPECT_EQ(batch.faulted(), 0) << batch.explain_fault(0);
  const auto [x, v] = engine.after_a_second();
  return std::hypot(batch.positions()(0, 0) - x, batch.velocities()(0, 0) - v);
}

TEST(Functions, move_as_the_closed_form_does) {
  for (const Function& f : functions) {
    SCOPED_TRACE(f.index());
    const CrankSlider engine(f, true);
    const Plan plan = compile(engine.model, with(Integrator::leapfrog, 1e-3));
    Batch<double> batch(plan, 1, by_tables());
    const auto [x, v] = engine.after_a_second();
    batch.step(1000);
    EXPECT_NEAR(batch.positions()(0, 0), x, 2e-5);
    EXPECT_NEAR(batch.velocities()(0, 0), v, 2e-4);
    EXPECT_NEAR(batch.velocities()(1, 0), reference::value_of(f, x).slope * v, 2e-4);
  }
}

TEST(Functions, keep_the_order_of_the_integrator) {
  const struct {
    Integrator integrator;
    int steps;
    double least, most;
  } cases[] = {{Integrator::euler, 1920, 1.9, 2.1},
               {Integrator::leapfrog, 480, 3.7, 4.3},
               {Integrator::extrapolated, 240, 7.5, 8.5},
               {Integrator::runge_kutta, 240, 14.0, 18.0}};
  for (const auto& c : cases)
    for (const bool loses : {false, true}) {
      const CrankSlider engine(functions[0], loses);
      const double ratio =
          error_after_a_second(engine, c.integrator, c.steps) / error_after_a_second(engine, c.integrator, 2 * c.steps);
      EXPECT_GE(ratio, c.least) << to_string(c.integrator);
      EXPECT_LE(ratio, c.most) << to_string(c.integrator);
    }
}

TEST(Functions, keep_the_energy_with_the_square_of_the_step) {
  double worst[2];
  const CrankSlider engine(functions[0]);
  for (const int finer : {0, 1}) {
    const int steps = 240 << finer;
    Batch<double> batch(compile(engine.model, with(Integrator::leapfrog, 1.0 / steps)), 1, by_tables());
    const double start = engine.energy(batch.positions()(0, 0), batch.velocities()(0, 0));
    worst[finer] = 0.0;
    for (int i = 0; i < 20 * steps; ++i) {
      batch.step();
      const double now = engine.energy(batch.positions()(0, 0), batch.velocities()(0, 0));
      worst[finer] = std::max(worst[finer], std::abs(now - start));
    }
  }
  EXPECT_LT(worst[0], 1e-2);
  EXPECT_NEAR(worst[0] / worst[1], 4.0, 0.6);
}

template <class S>
void expect_exact_positions(Integrator integrator) {
  for (const Function& f : functions) {
    const CrankSlider engine(f);
    Batch<S> batch(compile(engine.model, with(integrator, 1.0 / 240)), 7, by_tables());
    std::mt19937 random(3);
    std::normal_distribution<double> effort(0.0, 3.0);
    for (int i = 0; i < 200; ++i) {
      for (int e = 0; e < 7; ++e) batch.efforts()(0, e) = static_cast<S>(effort(random));
      batch.step();
      for (int e = 0; e < 7; ++e) {
        const auto x = static_cast<double>(batch.positions()(0, e)), v = static_cast<double>(batch.velocities()(0, e));
        const reference::FunctionValue at = reference::value_of(f, x);
        const double rounding = 16.0 * static_cast<double>(std::numeric_limits<S>::epsilon());
        ASSERT_NEAR(static_cast<double>(batch.positions()(1, e)), at.value, rounding * (1.0 + std::abs(x)));
        ASSERT_NEAR(static_cast<double>(batch.velocities()(1, e)), at.slope * v,
                    rounding * (1.0 + std::abs(x)) * (1.0 + std::abs(v)));
      }
    }
    EXPECT_EQ(batch.faulted(), 0);
  }
}

TEST(Functions, place_their_followers_to_rounding) {
  for (const Integrator integrator :
       {Integrator::euler, Integrator::leapfrog, Integrator::extrapolated, Integrator::runge_kutta}) {
    expect_exact_positions<double>(integrator);
    expect_exact_positions<float>(integrator);
  }
}

TEST(Functions, tables_are_smooth_splines) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> anywhere(-3.0, 3.0);
  for (int i = 0; i < 200; ++i) {
    const double x = anywhere(random);
    const simd::Curve<double> ours = curve_at(cam, x);
    const reference::FunctionValue theirs = reference::value_of(cam, x);
    EXPECT_NEAR(ours.value, theirs.value, 1e-14);
    EXPECT_NEAR(ours.slope, theirs.slope, 1e-13);
    EXPECT_NEAR(ours.bend, theirs.bend, 1e-12);
  }
  for (std::size_t i = 0; i < cam.leader.size(); ++i) {
    const double x = cam.leader[i], below = std::nextafter(x, -10.0);
    EXPECT_DOUBLE_EQ(curve_at(cam, x).value, cam.follower[i]);
    EXPECT_NEAR(curve_at(cam, below).value, cam.follower[i], 1e-14);
    EXPECT_NEAR(curve_at(cam, below).slope, curve_at(cam, x).slope, 1e-13);
    EXPECT_NEAR(curve_at(cam, below).bend, curve_at(cam, x).bend, 1e-12);
  }
}

// Two branches on a floating or a bolted base; functions of independent joints and of mimics, mimics of functions.
Model hand(bool floats) {
  Model model;
  model.name = "hand";
  model.links = {link("palm", 2.0, Vector3d(0.02, 0.01, -0.03), 0.05)};
  const JointKind kinds[] = {JointKind::revolute,  JointKind::prismatic, JointKind::revolute, JointKind::revolute,
                             JointKind::prismatic, JointKind::revolute,  JointKind::revolute, JointKind::prismatic};
  const char* parents[] = {"palm", "a0", "a1", "a2", "palm", "a4", "a5", "a6"};
  for (int i = 0; i < 8; ++i) {
    const std::string name = "a" + std::to_string(i);
    model.links.push_back(link(name, 0.3 + 0.1 * i, Vector3d(0.03, -0.02 * i, 0.05), 0.01 + 0.002 * i));
    model.joints.push_back(joint("j" + std::to_string(i), kinds[i], parents[i], name,
                                 Vector3d(0.3 * (i % 3), 1.0, 0.2 * (i % 2)), Vector3d(0.1, 0.02 * i, 0.1)));
    Joint& own = model.joints.back();
    own.armature = 0.01 * (i % 3), own.damping = 0.02 * (i % 2);
    own.stiffness = 0.5 * (i % 4), own.rest = 0.1;
    own.position = 0.2 - 0.05 * i, own.velocity = 0.5 - 0.1 * i;
    if (i % 3 == 2) own.drive.kp = 1.0, own.drive.kd = 0.1, own.drive.position_target = 0.2;
  }
  model.couplings = {Coupling::mimic("j5", "j3", 0.6, -0.05),  // follows the function below it
                     Coupling::cam("j3", "j0", Polynomial{{0.05, 0.8, 0.3, -0.2}}), Coupling::mimic("j6", "j1", -1.5),
                     Coupling::cam("j7", "j6", cam), Coupling::cam("j2", "j4", Harmonic{0.1, 0.4, 0.2, 1.5})};
  model.roots.push_back({"palm", floats});
  return model;
}

void expect_agreement(const Model& model, Integrator integrator, bool impulses = false) {
  SCOPED_TRACE(to_string(integrator));
  StepSettings settings = with(integrator, 1.0 / 240);
  settings.method = Method::reduced;
  settings.record_impulses = impulses;
  const bool floats = model.roots[0].floating;
  const reference::Mechanism mechanism(model);
  constexpr int environments = 5;
  Batch<double> batch(compile(model, settings), environments, by_tables());
  std::mt19937 random(11);
  std::normal_distribution<double> number;
  for (int e = 0; e < environments; ++e)
    for (int i = 0; i < 8; ++i)
      batch.positions()(i, e) += 0.3 * number(random), batch.velocities()(i, e) += number(random);
  for (int i = 0; i < 6; ++i)
    for (int e = 0; e < environments && floats; ++e) batch.root_velocities()(i, e) = number(random);
  batch.project();
  const auto state_of = [&](int e) {
    reference::State state = mechanism.initial_state();
    state.q = batch.positions().col(e).matrix();
    if (floats) {
      const Eigen::Matrix<double, 7, 1> pose = batch.root_poses().col(e).matrix();
      state.roots[0] = {pose.head<3>(), Eigen::Quaterniond(pose[3], pose[4], pose[5], pose[6])};
    }
    state.v.resize(mechanism.velocities());
    state.v << VectorXd(batch.root_velocities().col(e).matrix()), VectorXd(batch.velocities().col(e).matrix());
    return state;
  };
  for (int i = 0; i < 20; ++i) {
    std::vector<reference::State> expected;
    std::vector<VectorXd> expected_impulses;
    for (int e = 0; e < environments; ++e) {
      reference::Inputs inputs = mechanism.initial_inputs();
      for (int j = 0; j < 8; ++j) batch.efforts()(j, e) = inputs.efforts[j] = 2.0 * number(random);
      const reference::State start = reference::placed(mechanism, state_of(e));
      if (integrator == Integrator::euler) {
        const reference::Step step = reference::step(mechanism, settings, start, inputs);
        expected.push_back(step.state), expected_impulses.push_back(step.impulses);
      } else {
        expected.push_back(
            reference::integrated(mechanism, settings, start, [&](double, reference::Inputs& now) { now = inputs; }));
      }
    }
    batch.step();
    for (int e = 0; e < environments; ++e) {
      const reference::State ours = state_of(e);
      EXPECT_LE((ours.q - expected[static_cast<std::size_t>(e)].q).lpNorm<Eigen::Infinity>(), 1e-11);
      EXPECT_LE((ours.v - expected[static_cast<std::size_t>(e)].v).lpNorm<Eigen::Infinity>(), 1e-9);
      if (!impulses) continue;
      const VectorXd own = batch.coupling_impulses().col(e).matrix();
      EXPECT_LE((own - expected_impulses[static_cast<std::size_t>(e)]).lpNorm<Eigen::Infinity>(), 1e-9);
    }
  }
  EXPECT_EQ(batch.faulted(), 0);
}

TEST(Functions, agree_with_the_reference) {
  for (const Integrator integrator :
       {Integrator::euler, Integrator::leapfrog, Integrator::extrapolated, Integrator::runge_kutta})
    for (const bool floats : {false, true}) expect_agreement(hand(floats), integrator);
}

TEST(Functions, agree_with_the_reference_about_impulses) {
  for (const bool floats : {false, true}) expect_agreement(hand(floats), Integrator::euler, true);
}

// A spring pulls at followers of functions, with shares that change.
TEST(Functions, agree_with_the_reference_beside_soft_couplings) {
  for (const bool floats : {false, true}) {
    Model model = hand(floats);
    Coupling spring = Coupling::mimic("j1", "j3", 0.7, 0.1, Spring{30.0, 0.5});
    spring.terms.push_back({"j2", -0.4});
    model.couplings.push_back(spring);
    for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog, Integrator::extrapolated})
      expect_agreement(model, integrator);
  }
}

// Friction and a limited servo of followers act on their leaders; leaders have bounds of their own.
TEST(Functions, agree_with_the_reference_about_bounds) {
  Model model = hand(false);
  model.joints[2].friction = 0.1, model.joints[2].effort_limit = 0.15;
  model.joints[5].friction = 0.05;
  model.joints[1].lower = -0.3, model.joints[1].upper = 0.3;
  model.joints[4].velocity_limit = 0.4;
  expect_agreement(model, Integrator::euler);
}

TEST(Functions, agree_with_the_true_motion) {
  Model model = hand(true);
  const reference::Mechanism mechanism(model);
  Batch<double> batch(compile(model, with(Integrator::leapfrog, 1.0 / 2000)), 1, by_tables());
  batch.project();
  reference::State start = mechanism.initial_state();
  start.q = batch.positions().col(0).matrix();
  start.v << VectorXd(batch.root_velocities().col(0).matrix()), VectorXd(batch.velocities().col(0).matrix());
  const reference::Motion truth = reference::integrate(mechanism, start, reference::held, 0.05, 10, 50);
  batch.step(1000);
  EXPECT_LE((VectorXd(batch.positions().col(0).matrix()) - truth.end.q).lpNorm<Eigen::Infinity>(), 2e-5);
}

TEST(Functions, may_differ_per_environment) {
  StepSettings settings = with(Integrator::leapfrog, 1.0 / 240);
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog})
    for (const Function& f : functions) {
      settings.integrator = integrator;
      settings.per_environment = {Parameter::function};
      const CrankSlider engine(f);
      const Plan plan = compile(engine.model, settings);
      const std::vector<double> numbers = numbers_of(f);
      ASSERT_EQ(plan.parameter_rows(Parameter::function), static_cast<int>(numbers.size()));
      EXPECT_EQ(plan.parameter_row_names(Parameter::function)[0], "slider: crank " + number_names(f)[0]);
      Batch<double> batch(plan, 5, by_tables());
      StepSettings same = settings;
      same.per_environment = {};
      std::vector<Batch<double>> alone;
      for (int e = 0; e < 5; ++e) {
        std::vector<double> own = numbers;
        for (std::size_t k = 0; k < own.size(); ++k) {
          EXPECT_EQ(batch.parameter(Parameter::function)(static_cast<int>(k), e), own[k]);
          own[k] *= 1.0 + 0.1 * e;
          batch.parameter(Parameter::function)(static_cast<int>(k), e) = own[k];
        }
        Function changed = f;
        set_numbers(changed, own);
        alone.emplace_back(compile(CrankSlider(changed).model, same), 1, by_tables());
      }
      EXPECT_TRUE(batch.project().empty());
      batch.step(100);
      for (int e = 0; e < 5; ++e) {
        alone[static_cast<std::size_t>(e)].step(100);
        for (int i = 0; i < 2; ++i)
          EXPECT_NEAR(batch.positions()(i, e), alone[static_cast<std::size_t>(e)].positions()(i, 0), 1e-12);
      }
    }
}

TEST(Functions, give_the_same_bits_in_every_place) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    StepSettings settings = with(integrator, 1.0 / 240);
    settings.per_environment = {Parameter::function};
    const Plan plan = compile(hand(true), settings);
    Batch<float> many(plan, 11, by_tables()), one(plan, 1, by_tables());
    std::mt19937 random(2);
    std::normal_distribution<float> number;
    for (int e = 0; e < 11; ++e)
      for (int i = 0; i < 8; ++i) many.velocities()(i, e) += e == 7 ? 0.0f : number(random);
    many.step(50), one.step(50);
    EXPECT_TRUE((many.positions().col(7) == one.positions().col(0)).all());
    EXPECT_TRUE((many.velocities().col(7) == one.velocities().col(0)).all());
  }
}

TEST(Functions, followers_keep_within_their_bounds) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog})
    for (const bool falls : {false, true}) {
      CrankSlider engine(Polynomial{{0.1, falls ? -0.3 : 0.3, 0.0, falls ? -0.1 : 0.1}});
      engine.model.joints[0].lower = -1.0, engine.model.joints[0].upper = 1.0;
      engine.model.joints[1].lower = -0.05, engine.model.joints[1].upper = 0.2;
      engine.model.joints[1].velocity_limit = 0.5;
      Batch<double> batch(compile(engine.model, with(integrator, 1.0 / 240)), 2, by_tables());
      batch.positions().row(0).setConstant(0.05);
      batch.project();
      batch.efforts()(0, 0) = 30.0, batch.efforts()(0, 1) = -30.0;
      double beyond = 0.0, fastest = 0.0;
      for (int i = 0; i < 480; ++i) {
        batch.step();
        for (int e = 0; e < 2; ++e) {
          beyond = std::max({beyond, batch.positions()(1, e) - 0.2, -0.05 - batch.positions()(1, e)});
          fastest = std::max(fastest, std::abs(batch.velocities()(1, e)));
        }
      }
      EXPECT_LT(beyond, 1e-4);  // f'' (h v)^2 / 2
      EXPECT_LT(fastest, 0.52);
      EXPECT_NEAR(batch.positions()(1, falls ? 1 : 0), 0.2, 1e-6);
      EXPECT_NEAR(batch.positions()(1, falls ? 0 : 1), -0.05, 1e-6);
      EXPECT_NEAR(batch.velocities().abs().maxCoeff(), 0.0, 1e-6);
    }
}

TEST(Functions, friction_of_a_follower_holds_its_leader) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    CrankSlider engine(functions[0]);
    engine.model.joints[1].friction = 40.0;
    Batch<double> batch(compile(engine.model, with(integrator, 1.0 / 240)), 1, by_tables());
    batch.step(480);
    const double x = batch.positions()(0, 0);
    EXPECT_EQ(batch.faulted(), 0);
    EXPECT_NEAR(batch.velocities()(0, 0), 0.0, 1e-9);
    // At rest, friction times the slope is at least what pulls.
    const double pull = std::abs(engine.acceleration(x, 0.0)) *
                        (engine.inertia_of_crank() + (CrankSlider::slider + CrankSlider::armature_of_slider) *
                                                         std::pow(reference::value_of(engine.f, x).slope, 2));
    EXPECT_LE(pull, 40.0 * std::abs(reference::value_of(engine.f, x).slope) + 1e-9);
  }
}

TEST(Functions, leaders_keep_their_bounds_and_drives) {
  CrankSlider engine(functions[0]);
  engine.model.joints[0].lower = -0.2, engine.model.joints[0].upper = 0.6;
  engine.model.joints[0].velocity_limit = 1.0;
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    Batch<double> batch(compile(engine.model, with(integrator, 1.0 / 240)), 1, by_tables());
    batch.efforts()(0, 0) = 50.0;
    batch.step(480);
    EXPECT_NEAR(batch.positions()(0, 0), 0.6, 1e-9);
    EXPECT_NEAR(batch.positions()(1, 0), reference::value_of(engine.f, batch.positions()(0, 0)).value, 1e-14);
  }
  engine.model.joints[0].drive.kinematic = true;
  engine.model.joints[0].drive.position_target = 0.1;
  Batch<double> batch(compile(engine.model, with(Integrator::euler, 1.0 / 240)), 1, by_tables());
  batch.step(480);
  EXPECT_NEAR(batch.positions()(0, 0), 0.1, 1e-9);
}

TEST(Functions, balances_of_energy_close_with_the_step) {
  double missing[2];
  for (const int finer : {0, 1}) {
    StepSettings settings = with(Integrator::euler, 1.0 / (480 << finer));
    settings.record_diagnostics = true;
    const CrankSlider engine(functions[0], true);
    Batch<double> batch(compile(engine.model, settings), 1, by_tables());
    missing[finer] = 0.0;
    for (int i = 0; i < 480 << finer; ++i) {
      batch.step();
      const auto balance = batch.energy_balances();
      missing[finer] += balance(3, 0) - balance(0, 0) + balance(1, 0);
    }
  }
  EXPECT_LT(std::abs(missing[0]), 0.05);
  EXPECT_NEAR(missing[0] / missing[1], 2.0, 0.2);
}

TEST(Functions, are_told_by_the_plan) {
  const Plan plan = compile(hand(false), {});
  EXPECT_EQ(plan.method(), Method::reduced);
  const Following& follows = plan.following(plan.dof("j5"));  // -0.6 f'(j0)
  ASSERT_EQ(follows.leaders.size(), 1u);
  EXPECT_TRUE(follows.curved);
  EXPECT_EQ(follows.leaders[0].dof, plan.dof("j0"));
  EXPECT_NEAR(follows.leaders[0].ratio, -0.6 * reference::value_of(Polynomial{{0.05, 0.8, 0.3, -0.2}}, 0.2).slope,
              1e-12);
  EXPECT_TRUE(plan.locked_joints().empty());
  EXPECT_NE(plan.describe().find("j3 follows j0 as a polynomial of degree 3"), std::string::npos);
  // The start is on the functions.
  Batch<double> batch(plan, 1, by_tables());
  EXPECT_NEAR(batch.positions()(plan.dof("j2"), 0),
              reference::value_of(Harmonic{0.1, 0.4, 0.2, 1.5}, batch.positions()(plan.dof("j4"), 0)).value, 1e-15);
}

template <class E, class Act>
void expect_refusal(const char* words, Act act) {
  try {
    act();
    FAIL() << "no refusal: " << words;
  } catch (const E& error) {
    EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
    EXPECT_FALSE(error.remedy().empty());
  }
}

TEST(Functions, refuse_what_they_do_not_hold) {
  const auto compiled = [](const Model& model, StepSettings settings = {}) {
    return [=] { compile(model, settings); };
  };
  const auto with_function = [](Function f) { return CrankSlider(std::move(f)).model; };
  expect_refusal<ModelError>("1 coefficients", compiled(with_function(Polynomial{{1.0}})));
  expect_refusal<ModelError>("17 coefficients", compiled(with_function(Polynomial{std::vector<double>(17, 1.0)})));
  expect_refusal<ModelError>("coefficient of the polynomial", compiled(with_function(Polynomial{{1.0, NAN}})));
  expect_refusal<ModelError>("2 points", compiled(with_function(CamTable{{0.0, 1.0}, {0.0, 1.0}})));
  expect_refusal<ModelError>("3 positions of the leader and 2", compiled(with_function(CamTable{{0, 1, 2}, {0, 1}})));
  expect_refusal<ModelError>("do not ascend", compiled(with_function(CamTable{{0, 2, 1}, {0, 1, 2}})));
  expect_refusal<ModelError>("rate 0", compiled(with_function(Harmonic{0.0, 1.0, 0.0, 0.0})));

  const CrankSlider engine(functions[0]);
  Model model = engine.model;
  model.couplings[0].softness = Spring{100.0, 1.0};
  expect_refusal<ModelError>("soft", compiled(model));
  model = engine.model;
  model.couplings[0].force_limit = 3.0;
  expect_refusal<ModelError>("force limit", compiled(model));
  model = engine.model;
  model.couplings[0].offset = 0.1;
  expect_refusal<ModelError>("offset", compiled(model));
  model = engine.model;
  model.couplings.push_back(Coupling::mimic("crank", "slider", 1.0));
  expect_refusal<ModelError>("ring", compiled(model));
  model = engine.model;
  model.couplings.push_back(Coupling::mimic("slider", "crank", 1.0));
  expect_refusal<ModelError>("so does coupling", compiled(model));
  model = engine.model;
  model.joints[1].lower = -0.1;  // the crank turns on
  expect_refusal<ModelError>("rises and falls", compiled(model));

  for (const Method method : {Method::direct, Method::pgs, Method::tgs}) {
    StepSettings settings;
    settings.method = method;
    expect_refusal<SettingsError>("functions of a joint", compiled(engine.model, settings));
  }
  for (const Parameter parameter : {Parameter::softness, Parameter::coupling_switch}) {
    StepSettings settings;
    settings.per_environment = {parameter};
    expect_refusal<SettingsError>("functions of a joint", compiled(engine.model, settings));
  }
}

// x^5 and x^3 rise there, far from where their slopes are 0.
TEST(Functions, may_have_a_bounded_follower_where_they_only_rise) {
  const struct {
    std::vector<double> coefficients;
    double lower, upper;
  } cases[] = {{{0, 0, 0, 0, 0, 1}, 25.0, 30.0}, {{0, 0, 0, 1}, 300.0, 400.0}, {{0, 0, 0, 1}, -400.0, -300.0}};
  for (const auto& c : cases) {
    Model model = CrankSlider(functions[0]).model;
    model.couplings[0].function = Polynomial{c.coefficients};
    Joint &crank = model.joints[0], &slider = model.joints[1];
    crank.kind = JointKind::revolute, crank.lower = c.lower, crank.upper = c.upper;
    crank.position = 0.5 * (c.lower + c.upper);
    slider.lower = -1e9, slider.upper = 1e9;
    EXPECT_NO_THROW(compile(model)) << c.lower;
    crank.lower = -400.0, crank.upper = 400.0;  // with the pose in which the slope is 0
    EXPECT_THROW(compile(model), ModelError) << c.lower;
  }
}

}  // namespace
}  // namespace lockstep
