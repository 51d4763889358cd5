// Impacts and push-outs of single bodies and short chains, against theory. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <random>

#include "contact_scenes.h"

namespace lockstep {
namespace {

using namespace contact_scenes;

template <class S>
struct Impacts : testing::Test {
  static constexpr bool is_double = sizeof(S) == 8;
};
using Precisions = testing::Types<double, float>;
TYPED_TEST_SUITE(Impacts, Precisions);

template <class S>
Batch<S> batch_of(const Model& model, double dt, int environments = 1, Integrator integrator = Integrator::automatic) {
  StepSettings settings;
  settings.dt = dt, settings.integrator = integrator;
  return Batch<S>(compile(model, settings), environments, {.threads = 1});
}

template <class S>
Eigen::ArrayXXd read(const Batch<S>& batch, Quantity quantity) {
  const Query query{quantity};
  Eigen::Array<S, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> numbers(batch.plan().query_rows({quantity}),
                                                                           batch.environments());
  batch.read(std::span(&query, 1), {numbers.data(), batch.environments(), 1});
  return numbers.template cast<double>();
}

template <class S>
Eigen::ArrayXd energy(const Batch<S>& batch) {
  return (read(batch, Quantity::kinetic_energy).row(0) + read(batch, Quantity::potential_energy).row(0)).transpose();
}

// A rod of 0.5 kg and 0.2 m that hangs from a pivot, with a round tip of 2 cm over the floor.
Model pendulum(double height, double friction, double restitution) {
  Model m;
  m.name = "pendulum";
  m.links = {{"base", {}}, {"rod", Inertia::box(0.5, {0.04, 0.04, 0.2}, {0, 0, -0.1})}};
  m.roots = {{"base"}};
  m.joints = {joint("pivot", JointKind::revolute, "base", "rod", {0, 0, height}, {0, 1, 0})};
  m.joints[0].lower = -infinity, m.joints[0].upper = infinity;
  m.colliders.push_back({.name = "tip", .link = "rod", .shape = Shape::sphere(0.02), .pose = at({0, 0, -0.2})});
  add_floor(m, friction);
  for (Collider& collider : m.colliders) collider.friction = friction, collider.restitution = restitution;
  m.contacts = {{"floor", "tip"}};
  return m;
}

// A locked tip, nearly below its pivot, has friction that no slip can follow. It loses energy all the same. The slack
// is gravity's way of a step: a state shows speeds of half a step before it.
template <class S>
void pendulums_gain_no_energy(Integrator integrator, double slack) {
  constexpr int environments = 40;
  std::mt19937 generator(1);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(generator);
  };
  for (const double friction : {0.0, 0.5, 0.8, 1.5})
    for (const double restitution : {0.0, 0.3, 0.8, 1.0})
      for (const int rate : {60, 240, 1000}) {
        const double height = uniform(0.12, 0.26);
        Batch<S> batch = batch_of<S>(pendulum(height, friction, restitution), 1.0 / rate, environments, integrator);
        for (int e = 0; e < environments; ++e) {
          double angle = uniform(-1.5, 1.5);
          while (height - 0.2 * std::cos(angle) < 0.021) angle = uniform(-1.5, 1.5);
          batch.positions()(0, e) = static_cast<S>(angle);
          batch.velocities()(0, e) = static_cast<S>(uniform(-3, 3));
        }
        Eigen::ArrayXd before = energy(batch);
        for (int i = 0; i < rate; ++i) {
          const double fastest = batch.velocities().abs().maxCoeff() + 9.81 / rate;
          batch.step(1);
          const Eigen::ArrayXd now = energy(batch);
          EXPECT_LT((now - before).maxCoeff(), slack + 1.5 * 9.81 / rate * 0.5 * 0.2 * fastest)
              << friction << ' ' << restitution << ' ' << rate << ' ' << i;
          before = now;
        }
        // Perfect bounces at 60 Hz gain half a per cent each in a leapfrog, as the tip turns. The audit stops them.
        const bool may_stop = integrator == Integrator::leapfrog && restitution == 1.0 && rate == 60;
        for (const Fault fault : batch.faults())
          EXPECT_TRUE(fault == Fault::none || (may_stop && fault == Fault::too_fast))
              << friction << " " << restitution << " " << rate << " " << height;
      }
}
TYPED_TEST(Impacts, of_a_pendulums_tip_give_no_energy) { pendulums_gain_no_energy<TypeParam>(Integrator::euler, 1e-4); }

// Here what jams in an overlap is lifted out by more in a step: 0.1 mm.
TYPED_TEST(Impacts, of_a_pendulums_tip_give_no_energy_in_leapfrog) {
  pendulums_gain_no_energy<TypeParam>(Integrator::leapfrog, 5e-4);
}

// The tip begins inside of the floor at rest, without friction. Near its dead point a push-out needs much turning for
// little lift.
TYPED_TEST(Impacts, a_push_out_leaves_no_speed_and_turns_no_joint_by_much) {
  for (const auto& [height, angle] :
       {std::pair(0.219, 0.02), {0.21, 0.02}, {0.19, 0.02}, {0.15, 0.02}, {0.19, 0.1}, {0.15, 0.1}, {0.15, 0.8}}) {
    Batch<TypeParam> batch = batch_of<TypeParam>(pendulum(height, 0.0, 0.0), 1.0 / 240);
    batch.positions()(0, 0) = static_cast<TypeParam>(angle);
    // (M104): 3 m/s times 3 sqrt(r_n / sum r), of a point at 0.2 m that is 9 m/s along its circle.
    const double most = 1.01 * 9.0 / 240 / 0.2;
    double last = angle;
    for (int i = 0; i < 480; ++i) {
      batch.step(1);
      EXPECT_LT(read(batch, Quantity::kinetic_energy)(0, 0), 1e-3) << height << ' ' << angle << ' ' << i;
      EXPECT_LT(std::abs(batch.positions()(0, 0) - last), most) << height << ' ' << angle << ' ' << i;
      last = batch.positions()(0, 0);
    }
  }
}

Model round_body(double mass, double radius, const Vector3d& place, const Vector3d& velocity) {
  Model model;
  const double moment = 0.4 * mass * radius * radius;
  add_free(model, "ball", {mass, Vector3d::Zero(), moment * Eigen::Matrix3d::Identity()}, Shape::sphere(radius), place,
           1.0);
  model.roots[0].velocity.tail<3>() = velocity;
  return model;
}

// Friction ends the slip within an impact, so the ball leaves rolling, at 5/7 of its speed whatever its radius.
TYPED_TEST(Impacts, a_skidding_ball_leaves_rolling) {
  for (const auto& [rate, radius] :
       {std::pair(240, 0.1), {240, 0.02}, {240, 0.005}, {240, 0.001}, {60, 0.02}, {1000, 0.005}}) {
    Model model = round_body(1.0, radius, {0, 0, 0.2}, {5, 0, -3});
    model.gravity.setZero();
    add_floor(model, 1.0);
    model.contacts = {{"floor", "ball"}};
    model.contacts[0].restitution = 0.5;
    Batch<TypeParam> batch = batch_of<TypeParam>(model, 1.0 / rate);
    batch.step(static_cast<int>(std::lround((0.2 - radius) / 3.0 * rate)) + 3);
    const Eigen::ArrayXXd v = read(batch, Quantity::link_velocity);
    EXPECT_NEAR(v(3, 0), 25.0 / 7.0, 0.02 * 25 / 7) << rate << ' ' << radius;
    EXPECT_NEAR(v(1, 0) * radius, 25.0 / 7.0, 0.02 * 25 / 7) << rate << ' ' << radius;
    EXPECT_NEAR(v(5, 0), 1.5, 0.02) << rate << ' ' << radius;
  }
}

// Two balls that spin alike meet across the gap of a step. Each has its friction on its own surface: the slip ends when
// each moves at 2/7 of the speed that its surface had, away from the other, as it would on a standing floor.
TYPED_TEST(Impacts, two_spinning_balls_leave_rolling_on_each_other) {
  for (const double radius : {0.1, 0.02, 0.005}) {
    Model model = round_body(1.0, radius, {0, 0, 0.15}, {0, 0, -3});
    Model other = round_body(1.0, radius, {0, 0, -0.15}, {0, 0, 3});
    model.gravity.setZero();
    model.links.push_back(other.links[0]), model.links.back().name = "second";
    model.roots.push_back(other.roots[0]), model.roots.back().link = "second";
    model.colliders.push_back(other.colliders[0]);
    model.colliders.back().name = model.colliders.back().link = "second";
    for (Root& root : model.roots) root.velocity[1] = 5.0 / radius;
    model.contacts = {{"ball", "second"}};
    model.contacts[0].restitution = 0.5;
    Batch<TypeParam> batch = batch_of<TypeParam>(model, 1.0 / 240);
    batch.step(static_cast<int>(std::lround((0.15 - radius) / 3.0 * 240)) + 2);
    const Eigen::ArrayXXd v = read(batch, Quantity::link_velocity);
    EXPECT_NEAR(v(3, 0), 10.0 / 7.0, 0.03) << radius;
    EXPECT_NEAR(v(1, 0) * radius, 10.0 / 7.0, 0.03) << radius;
    EXPECT_NEAR(v(3, 0), -v(9, 0), 1e-3) << radius;
    // A slip of 1e-5 m in the step is not renewed.
    EXPECT_NEAR(v(1, 0) * radius, v(7, 0) * radius, this->is_double ? 1e-3 : 3e-5 * 240) << radius;
  }
}

TYPED_TEST(Impacts, pellets_stop_on_thin_plates) {
  for (const auto& [radius, speed, thickness] :
       {std::tuple(5e-4, 2.0, 1e-3), {5e-4, 5.0, 1e-3}, {1e-3, 10.0, 2e-3}, {2.5e-3, 20.0, 2e-3}, {0.01, 20.0, 0.02}}) {
    const double mass = 4000.0 / 3.0 * 3.14159265358979 * radius * radius * radius;
    Model model = round_body(mass, radius, {0.011, 0.003, radius + 0.7 * speed / 240}, {0, 0, -speed});
    Collider plate{.name = "plate", .shape = Shape::box({0.2, 0.2, thickness})};
    plate.pose = at({0, 0, -thickness / 2});
    model.colliders.push_back(plate);
    model.contacts = {{"plate", "ball"}};
    Batch<TypeParam> batch = batch_of<TypeParam>(model, 1.0 / 240);
    batch.step(240);
    EXPECT_NEAR(batch.root_poses()(2, 0), radius, 1e-4) << radius << " m, " << speed << " m/s";
  }
}

// The apex after bounce n is e^(2n) of the first, and with e = 1 never above it.
TYPED_TEST(Impacts, bounces_have_apexes_of_e_to_the_2n) {
  for (const auto& [rate, e, bounces] : {std::tuple(30, 1.0, 20),
                                         {60, 1.0, 100},
                                         {240, 1.0, 100},
                                         {1000, 1.0, 100},
                                         {30, 0.9, 12},
                                         {60, 0.9, 15},
                                         {240, 0.9, 15},
                                         {240, 0.5, 4}}) {
    Batch<TypeParam> batch = batch_of<TypeParam>(ball({0, 0, 1.1}, 0.0, e), 1.0 / rate);
    double before = 0.0, top = 0.0;
    int count = 0;
    for (int i = 0; i < 200 * rate && count <= bounces; ++i) {
      batch.step(1);
      const double v = batch.root_velocities()(5, 0), height = batch.root_poses()(2, 0) - 0.1;
      if (v > 0.0 && before <= 0.0) {
        // What a step of the parabola between two states hides: g h^2 / 8.
        if (count > 0) {
          EXPECT_NEAR(top, std::pow(e, 2 * count), 0.02 * std::pow(e, 2 * count) + 9.81 / (8.0 * rate * rate))
              << rate << " Hz, e " << e << ", bounce " << count;
          EXPECT_LT(top, 1.0 + 9.81 / (8.0 * rate * rate) + (this->is_double ? 1e-12 : 3e-5));
        }
        ++count, top = 0.0;
      }
      if (count > 0) top = std::max(top, height);
      before = v;
    }
    EXPECT_GT(count, bounces) << rate;
  }
}

TYPED_TEST(Impacts, restitution_holds_beside_softness) {
  for (const int rate : {240, 1000})
    for (const double e : {0.5, 1.0})
      for (const Softness& softness : {Softness(Hard{}), Softness(Spring{1e4, 20}), Softness(Frequency{100, 0.3})}) {
        Model model = round_body(1.0, 0.05, {0, 0, 0.55}, {0, 0, 0});
        add_floor(model, 0.0);
        model.contacts = {{"floor", "ball"}};
        model.contacts[0].friction = 0.0, model.contacts[0].restitution = e, model.contacts[0].softness = softness;
        Batch<TypeParam> batch = batch_of<TypeParam>(model, 1.0 / rate);
        batch.step(static_cast<int>(0.36 * rate));
        const double v = batch.root_velocities()(5, 0), z = batch.root_poses()(2, 0) - 0.05;
        EXPECT_GT(v, 0.0);
        EXPECT_NEAR(std::sqrt((z + v * v / (2 * 9.81)) / 0.5), e, 0.05 * e) << rate << ' ' << softness.index();
      }
}

TYPED_TEST(Impacts, a_soft_ground_sinks_by_its_stiffness_at_every_step) {
  for (const auto& [dt, kp, kd, mass] : {std::tuple(1.0 / 240, 1e4, 5.0, 10.0),
                                         {1e-3, 1e4, 5.0, 10.0},
                                         {1e-3, 1e4, 100.0, 10.0},
                                         {1e-3, 1e3, 20.0, 5.0},
                                         {1e-3, 1e4, 20.0, 30.0}}) {
    Model model = round_body(mass, 0.1, {0, 0, 0.1}, {0, 0, 0});
    add_floor(model, 1.0);
    model.contacts = {{"floor", "ball"}};
    model.contacts[0].softness = Spring{kp, kd};
    Batch<TypeParam> batch = batch_of<TypeParam>(model, dt);
    batch.step(static_cast<int>(10.0 / dt));
    EXPECT_NEAR(0.1 - batch.root_poses()(2, 0), mass * 9.81 / kp, 0.02 * mass * 9.81 / kp)
        << dt << ' ' << kp << ' ' << kd;
  }
}

void add_pad(Model& model, const std::string& name, const std::string& parent, const Vector3d& place,
             const Vector3d& axis, const Vector3d& size, double kp, double press, double friction) {
  model.links.push_back({name, Inertia::box(0.05, size, Vector3d::Zero())});
  Joint slider = joint(name, JointKind::prismatic, parent, name, place, axis);
  slider.drive = {.kp = kp, .kd = 2 * std::sqrt(kp * 0.05), .position_target = press / kp};
  model.joints.push_back(slider);
  model.colliders.push_back({.name = name, .link = name, .shape = Shape::box(size), .friction = friction});
}

// Two pads hold a box with 20 N each on a boom that turns at 3 rad/s: a box that sticks has no slip.
TYPED_TEST(Impacts, a_turning_hand_goes_on_pressing) {
  for (const auto& [rate, kp] : {std::pair(240, 1e3), {240, 1e4}, {240, 1e5}, {120, 1e5}}) {
    Model model;
    model.name = "hand";
    model.links = {{"base", {}}, {"boom", Inertia::box(5.0, {1, 0.05, 0.05}, Vector3d::Zero())}};
    model.roots = {{"base"}};
    model.joints = {joint("turn", JointKind::revolute, "base", "boom", {0, 0, 0}, {0, 0, 1})};
    model.joints[0].lower = -infinity, model.joints[0].upper = infinity;
    model.joints[0].drive.kinematic = true;
    add_pad(model, "left", "boom", {0.8, -0.025, 0}, {0, 1, 0}, {0.03, 0.01, 0.03}, kp, 20.0, 0.7);
    add_pad(model, "right", "boom", {0.8, 0.025, 0}, {0, -1, 0}, {0.03, 0.01, 0.03}, kp, 20.0, 0.7);
    add_block(model, "box", 0.2, {0.04, 0.04, 0.04}, {0.8, 0, 0}, 0.7);
    model.contacts = {{"left", "box"}, {"right", "box"}};
    const Plan plan = compile(model, [rate = rate] {
      StepSettings settings;
      settings.dt = 1.0 / rate;
      return settings;
    }());
    Batch<TypeParam> batch(plan, 1, {.threads = 1});
    double angle = 0.0, still = 0.0;
    for (int i = 0; i < 6 * rate; ++i) {
      const double t = static_cast<double>(i + 1) / rate, speed = t < 1.0 ? 0.0 : 3.0 * std::min(1.0, (t - 1.0) / 2.0);
      angle += speed / rate;
      batch.position_targets()(plan.dof("turn"), 0) = static_cast<TypeParam>(angle);
      batch.velocity_targets()(plan.dof("turn"), 0) = static_cast<TypeParam>(speed);
      batch.step(1);
      if (i == rate - 10) still = read(batch, Quantity::contact_normal_force)(0, 0);
    }
    EXPECT_NEAR(read(batch, Quantity::contact_normal_force)(0, 0), still, 0.02 * still) << rate << ' ' << kp;
    EXPECT_GT(still, 15.0);
    const Eigen::Vector3d place = batch.root_poses().col(0).head(3).matrix().template cast<double>();
    const Eigen::Vector3d held = Eigen::AngleAxisd(-angle, Vector3d::UnitZ()) * place;
    // What a step drifts is taken back a step later, a quarter at a time in single precision.
    const double drift = 0.5 * 9.0 * 0.8 / (rate * rate) * (this->is_double ? 1 : 4);
    EXPECT_LT((held - Vector3d(0.8, 0, 0)).norm(), 1.05 * drift + 1e-4) << rate << ' ' << kp;
  }
}

// A block slides between two pads: its way is v^2 / (2 a) with a = 2 mu N / m, but for a half step of euler.
TYPED_TEST(Impacts, braking_pads_brake_whatever_their_servos_stiffness) {
  for (const auto& [rate, kp, mass] :
       {std::tuple(240, 1e3, 20.0), {240, 1e4, 20.0}, {240, 1e5, 20.0}, {240, 1e5, 80.0}, {60, 1e5, 20.0}}) {
    Model model;
    model.name = "brake";
    model.gravity.setZero();
    model.links = {{"base", {}}};
    model.roots = {{"base"}};
    add_pad(model, "left", "base", {-0.055, 0, 0}, {1, 0, 0}, {0.01, 0.03, 0.03}, kp, 20.0, 0.5);
    add_pad(model, "right", "base", {0.055, 0, 0}, {-1, 0, 0}, {0.01, 0.03, 0.03}, kp, 20.0, 0.5);
    add_block(model, "block", mass, {0.1, 0.05, 1.0}, {0, 0, 0}, 0.5);
    model.roots.back().velocity[5] = 0.5;
    model.contacts = {{"left", "block"}, {"right", "block"}};
    const double way = 0.25 * mass / (4 * 0.5 * 20.0);
    for (const auto& [integrator, half_step] :
         {std::pair(Integrator::euler, 0.25 / rate), {Integrator::leapfrog, 0.0}}) {
      Batch<TypeParam> batch = batch_of<TypeParam>(model, 1.0 / rate, 1, integrator);
      batch.step(static_cast<int>(6 * way / 0.5 * rate) + 10);
      EXPECT_NEAR(batch.root_poses()(2, 0), way - half_step, 0.02 * way) << rate << ' ' << kp << ' ' << mass;
    }
  }
}

// A driven roller turns a second one, which a slider presses on with 20 N.
TYPED_TEST(Impacts, rollers_press_and_turn_each_other_at_any_speed) {
  for (const auto& [rate, speed] :
       {std::pair(240, 3.0), {240, 10.0}, {240, 30.0}, {240, 100.0}, {1000, 100.0}, {60, 10.0}}) {
    Model model;
    model.name = "rollers";
    model.gravity.setZero();
    const auto roller = [](double radius) {
      return Inertia{0.5, Vector3d::Zero(), 0.2 * radius * radius * Eigen::Matrix3d::Identity()};
    };
    model.links = {{"base", {}},
                   {"first", roller(0.05)},
                   {"arm", Inertia::box(0.2, {0.05, 0.05, 0.05}, Vector3d::Zero())},
                   {"second", roller(0.1)}};
    model.roots = {{"base"}};
    model.joints = {joint("drive", JointKind::revolute, "base", "first", {0, 0, 0}, {0, 1, 0}),
                    joint("slide", JointKind::prismatic, "base", "arm", {0.15, 0, 0}, {-1, 0, 0}),
                    joint("roll", JointKind::revolute, "arm", "second", {0, 0, 0}, {0, 1, 0})};
    for (Joint& j : model.joints) j.lower = -infinity, j.upper = infinity;
    model.joints[0].drive = {.kd = 5.0, .velocity_target = speed};
    model.joints[1].effort = 20.0, model.joints[1].damping = 10.0;
    model.joints[2].damping = 0.01;
    for (const auto& [name, radius] : {std::pair("first", 0.05), {"second", 0.1}})
      model.colliders.push_back({.name = name, .link = name, .shape = Shape::sphere(radius), .friction = 0.6});
    model.contacts = {{"first", "second"}};
    Batch<TypeParam> batch = batch_of<TypeParam>(model, 1.0 / rate);
    batch.step(20 * rate);
    const Plan& plan = batch.plan();
    EXPECT_NEAR(-batch.velocities()(plan.dof("roll"), 0) / batch.velocities()(plan.dof("drive"), 0), 0.5, 0.0025);
    EXPECT_NEAR(read(batch, Quantity::contact_normal_force)(0, 0), 20.0, 0.4) << rate << ' ' << speed;
    EXPECT_NEAR(batch.velocities()(plan.dof("slide"), 0), 0.0, 1e-4) << rate << ' ' << speed;
    EXPECT_NEAR(batch.positions()(plan.dof("slide"), 0), 0.0, 2e-5 * std::max(1.0, std::pow(240.0 / rate, 2)));
  }
}

// A turntable whose round collider lies on its axis, and a slider along the floor: no impulse moves the first at all,
// and none along the normal moves the second.
TYPED_TEST(Impacts, a_contact_that_can_move_nothing_is_none) {
  Model model;
  model.name = "turntable";
  model.links = {{"base", {}},
                 {"table", Inertia::box(1.0, {0.1, 0.1, 0.1}, Vector3d::Zero())},
                 {"cart", Inertia::box(1.0, {0.1, 0.1, 0.1}, Vector3d::Zero())}};
  model.roots = {{"base"}};
  model.joints = {joint("turn", JointKind::revolute, "base", "table", {0, 0, 0.04}, {0, 0, 1}),
                  joint("cart", JointKind::prismatic, "base", "cart", {1, 0, 0.04}, {1, 0, 0})};
  for (Joint& j : model.joints) j.lower = -infinity, j.upper = infinity;
  model.joints[0].velocity = 2.0, model.joints[1].velocity = 1.0;
  for (const char* name : {"table", "cart"})
    model.colliders.push_back({.name = name, .link = name, .shape = Shape::sphere(0.05), .friction = 0.5});
  add_floor(model, 0.5);
  model.contacts = {{"floor", "table"}, {"floor", "cart"}};
  Batch<TypeParam> batch = batch_of<TypeParam>(model, 1.0 / 240);
  batch.step(240);
  EXPECT_EQ(batch.faults()[0], Fault::none);
  EXPECT_NEAR(batch.velocities()(0, 0), 2.0, 1e-6);
  EXPECT_LE(std::abs(batch.velocities()(1, 0)), 1.0);
}

}  // namespace
}  // namespace lockstep
