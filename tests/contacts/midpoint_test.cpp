// Contacts in a leapfrog step: against the reference, and what its order is worth. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "contact_scenes.h"
#include "heaps.h"
#include "physics.h"
#include "reference/contacts.h"

namespace lockstep {
namespace {

using namespace contact_scenes;

StepSettings leapfrog(double rate) {
  StepSettings settings;
  settings.dt = 1.0 / rate;
  settings.integrator = Integrator::leapfrog;
  return settings;
}

// One step of all that the seed decides, compared with the reference. Returns whether a contact presses.
bool agrees(const Model& model, unsigned seed, double tolerance) {
  StepSettings settings = leapfrog(240);
  settings.guard = infinity;
  settings.contacts = {1, 200, 1e-12};  // one pass: the reference allows for the slip of the start
  const reference::Mechanism mechanism(model);
  const reference::State start = mechanism.initial_state();
  const reference::MiddleStep truth = reference::middle_step(mechanism, settings, start, mechanism.initial_inputs());
  Batch<double> batch(compile(model, settings), 1, {.threads = 1});
  batch.step(1);
  EXPECT_EQ(batch.faults()[0], Fault::none) << seed;
  const reference::State ours = physics::state_of(batch);
  for (std::size_t r = 0; r < ours.roots.size(); ++r)
    EXPECT_LT((ours.roots[r].position - truth.end.roots[r].position).norm(), tolerance) << seed;
  EXPECT_LT(physics::distance(ours.q, truth.end.q), tolerance) << seed;
  EXPECT_LT(physics::distance(ours.v, truth.end.v), tolerance) << seed;
  return truth.presses;
}

TEST(MidpointAgreement, of_heaps_that_are_soft_bounce_and_overlap) {
  int pressing = 0;
  for (unsigned seed = 0; seed < 60; ++seed) {
    pressing += agrees(heap(seed), seed, 1e-8);
    pressing += agrees(lively_heap(seed), seed, 1e-7);
    pressing += agrees(turning_heap(seed), seed, 1e-7);
  }
  EXPECT_GE(pressing, 150);
}

TEST(MidpointAgreement, of_a_quadruped_with_coupled_knees_springs_and_servos_from_soft_to_stiff) {
  int pressing = 0;
  for (unsigned seed = 0; seed < 60; ++seed) {
    std::mt19937 generator(seed);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    Model model = quadruped();
    model.contacts.clear();
    for (const char* foot : {"fl_foot", "fr_foot", "hl_foot", "hr_foot"}) model.contacts.push_back({"floor", foot});
    for (Joint& joint : model.joints) {
      joint.lower = -infinity, joint.upper = infinity, joint.effort_limit = joint.velocity_limit = infinity;
      joint.friction = 0.0, joint.damping = std::pow(10.0, uniform(generator) - 1.0);
      joint.stiffness = std::pow(10.0, 2.0 * uniform(generator));
      if (joint.drive.kp == 0.0) continue;
      joint.drive.kp = std::pow(10.0, 2.5 + 2.5 * uniform(generator));
      joint.drive.velocity_target = 0.2 * uniform(generator);
    }
    model.roots[0].pose.translation().z() = 0.3705 + 0.001 * uniform(generator);
    for (int k = 0; k < 6; ++k) model.roots[0].velocity[k] = 0.5 * uniform(generator);
    model.roots[0].velocity[5] -= 0.5;
    pressing += agrees(model, seed, 1e-8);
  }
  EXPECT_GE(pressing, 50);
}

// v^2 / (2 mu g)
TEST(Midpoint, a_box_slides_as_far_as_friction_says) {
  const double right = 9.0 / (2.0 * 0.5 * 9.81);
  for (const auto& [rate, tolerance] : {std::pair(60.0, 1e-3), std::pair(240.0, 1e-4)}) {
    Model model = block();
    model.roots[0].velocity[3] = 3.0;
    Batch<double> batch(compile(model, leapfrog(rate)), 1, {.threads = 1});
    batch.step(static_cast<int>(rate));
    EXPECT_NEAR(batch.root_poses()(0, 0), right, tolerance) << rate;
  }
}

// A spring on a box at rest keeps its energy for ever. Euler takes it away within ten seconds.
TEST(Midpoint, a_spring_on_a_box_at_rest_goes_on_swinging) {
  Model model;
  add_block(model, "box", 1.0, {0.2, 0.2, 0.1}, {0, 0, 0.05}, 1.0);
  add_floor(model, 1.0);
  model.contacts = {{"floor", "box"}};
  Link link;
  link.name = "bob", link.inertia = Inertia::box(0.1, Vector3d(0.02, 0.02, 0.02), Vector3d::Zero());
  model.links.push_back(link);
  Joint joint;
  joint.name = "spring", joint.kind = JointKind::prismatic, joint.parent = "box", joint.child = "bob";
  joint.axis = Vector3d::UnitZ(), joint.stiffness = 20.0;
  joint.position = 0.4;
  model.joints.push_back(joint);
  const double rest = -0.1 * 9.81 / 20.0;
  for (const double rate : {60.0, 240.0}) {
    Batch<double> batch(compile(model, leapfrog(rate)), 1, {.threads = 1});
    double farthest = 0.0;
    for (int i = 0; i < 10 * rate; ++i) {
      batch.step(1);
      if (i > 9 * rate) farthest = std::max(farthest, batch.positions()(0, 0) - rest);
    }
    EXPECT_NEAR(farthest, 0.4 - rest, 0.004) << rate;
    EXPECT_NEAR(batch.root_poses()(2, 0), 0.05, 1e-4) << rate;
  }
}

// The first rebound rises to e^2 of the height, and no bounce of a thousand to more than the start.
TEST(Midpoint, a_ball_bounces_as_high_as_its_restitution_says) {
  for (const double restitution : {0.5, 1.0})
    for (const double rate : {60.0, 240.0, 1000.0}) {
      Model model;
      add_free(model, "ball", {1.0, Vector3d::Zero(), 4e-3 * Eigen::Matrix3d::Identity()}, Shape::sphere(0.1),
               {0, 0, 1.1}, 0.5);
      add_floor(model, 0.5);
      model.contacts = {{"floor", "ball"}};
      model.contacts[0].restitution = restitution;
      Batch<double> batch(compile(model, leapfrog(rate)), 1, {.threads = 1});
      double first = 0.0, most = 0.0;
      bool rose = false, fell = false;
      for (int i = 0; i < 100 * rate; ++i) {
        batch.step(1);
        const double z = batch.root_poses()(2, 0) - 0.1, v = batch.root_velocities()(5, 0);
        const double height = z + 0.5 * v * v / 9.81;
        most = std::max(most, height);
        rose = rose || v > 0.0, fell = fell || (rose && v < 0.0);
        if (rose && !fell) first = std::max(first, height);
      }
      EXPECT_NEAR(first, restitution * restitution, 1e-3) << rate;
      EXPECT_LE(most, 1.0 + 1e-12) << rate;
    }
}

// Servos at a gait on a floor. Feet begin and cease to slide, so both integrators are of first order.
TEST(Midpoint, stamping_feet_are_several_times_as_accurate_as_those_of_euler) {
  Model model = quadruped();
  for (Joint& joint : model.joints) {
    joint.lower = -infinity, joint.upper = infinity, joint.effort_limit = joint.velocity_limit = infinity;
    joint.friction = 0.0;
  }
  const auto end = [&](Integrator integrator, double rate) {
    StepSettings settings = leapfrog(rate);
    settings.integrator = integrator;
    Batch<double> batch(compile(model, settings), 1, {.threads = 1});
    const Eigen::ArrayXd rest = batch.position_targets().col(0);
    for (int i = 0; i < rate / 2; ++i) {
      const double t = (i + 1) / rate, r = t * t / (t * t + 0.01), dr = 0.02 * t / std::pow(t * t + 0.01, 2);
      for (int j = 0; j < rest.size(); ++j) {
        batch.position_targets()(j, 0) = rest[j] + 0.01 * r * std::sin(12.0 * t + j);
        batch.velocity_targets()(j, 0) = 0.01 * (12.0 * r * std::cos(12.0 * t + j) + dr * std::sin(12.0 * t + j));
      }
      batch.step(1);
    }
    EXPECT_EQ(batch.faults()[0], Fault::none);
    return Eigen::ArrayXd(batch.positions().col(0));
  };
  const Eigen::ArrayXd truth = end(Integrator::leapfrog, 3840);
  const auto error = [&](Integrator integrator) { return (end(integrator, 240) - truth).abs().maxCoeff(); };
  EXPECT_LT(4.0 * error(Integrator::leapfrog), error(Integrator::euler));
  EXPECT_LT(error(Integrator::leapfrog), 3e-4);
}

// A tendon pulls with all its effort: the row takes the solve at the midpoint, which small steps of euler confirm.
TEST(Midpoint, rows_over_several_velocities_move_as_small_steps_say) {
  const auto end = [](Integrator integrator, int parts) {
    StepSettings settings = leapfrog(240.0 * parts);
    settings.integrator = integrator;
    Batch<double> batch(compile(finger(), settings), 1, {.threads = 1});
    batch.step(10 * parts);
    EXPECT_EQ(batch.faults()[0], Fault::none);
    return Eigen::ArrayXd(batch.positions().col(0));
  };
  const Eigen::ArrayXd truth = end(Integrator::euler, 128);
  const double ours = (end(Integrator::leapfrog, 1) - truth).abs().maxCoeff();
  EXPECT_LT(ours, 2e-3);
  EXPECT_LT(20.0 * ours, (end(Integrator::euler, 1) - truth).abs().maxCoeff());
}

// Contacts that are declared and far away change no bit, also where the guard takes halves and bounds act.
TEST(Midpoint, contacts_that_nothing_touches_change_no_bit) {
  for (const double guard : {0.01, infinity}) {
    Model with = quadruped();
    with.roots[0].pose.translation().z() = 50.0;
    for (int k = 0; k < 3; ++k) with.roots[0].velocity[k] = 6.0 * (k - 1.3);
    with.joints[0].lower = with.joints[0].position - 0.05, with.joints[0].upper = with.joints[0].position + 0.05;
    with.joints[0].velocity = 2.0;
    Model without = with;
    without.contacts.clear();
    StepSettings settings = leapfrog(120);
    settings.guard = guard;
    Batch<double> a(compile(with, settings), 8, {.threads = 1, .engine = Engine::tables}),
        b(compile(without, settings), 8, {.threads = 1, .engine = Engine::tables});
    for (int i = 0; i < 120; ++i) {
      a.step(1), b.step(1);
      ASSERT_TRUE((a.positions() == b.positions()).all() && (a.velocities() == b.velocities()).all() &&
                  (a.root_poses() == b.root_poses()).all() && (a.root_velocities() == b.root_velocities()).all())
          << "step " << i;
    }
  }
}

// Half of the environments lie on the floor, the others fall: each moves as it does alone.
TEST(Midpoint, what_touches_changes_no_bit_of_its_neighbours) {
  const Plan plan = compile(quadruped(), leapfrog(240));
  const auto raise = [](Batch<float>& batch, int e, int from) { batch.root_poses()(2, e) += 0.05f * from; };
  Batch<float> all(plan, 16, {.threads = 1});
  for (int e = 0; e < 16; ++e) raise(all, e, e);
  all.step(200);
  for (int e = 0; e < 16; ++e) {
    Batch<float> alone(plan, 1, {.threads = 1});
    raise(alone, 0, e);
    alone.step(200);
    EXPECT_TRUE((alone.root_poses().col(0) == all.root_poses().col(e)).all() &&
                (alone.velocities().col(0) == all.velocities().col(e)).all())
        << e;
  }
}

// A plate turns about its middle axis and lands. The guard takes halves in flight and on the ground.
TEST(Midpoint, a_thrown_plate_lands_without_gaining_energy_and_comes_to_rest) {
  for (const double rate : {60.0, 240.0}) {
    Model model;
    add_block(model, "plate", 0.3, {0.1, 0.2, 0.03}, {0, 0, 0.5}, 0.5);
    model.roots.back().velocity << 60.0, 0.01, 0.01, 0, 0, 0;
    add_floor(model, 0.5);
    model.contacts = {{"floor", "plate"}};
    Batch<double> batch(compile(model, leapfrog(rate)), 1, {.threads = 1});
    const auto energy = [&] {
      const Query queries[] = {{Quantity::kinetic_energy}, {Quantity::potential_energy}};
      double numbers[2];
      batch.read(queries, {numbers, 1, 1});
      return numbers[0] + numbers[1];
    };
    const double first = energy();
    double most = first;
    for (int i = 0; i < 4 * rate; ++i) batch.step(1), most = std::max(most, energy());
    ASSERT_EQ(batch.faults()[0], Fault::none) << rate;
    EXPECT_LT(most, first + 0.05 * std::abs(first)) << rate;
    EXPECT_LT(batch.root_velocities().col(0).abs().maxCoeff(), 1e-6) << rate;
  }
}

// Steps of any length leave what rests where it is.
TEST(Midpoint, a_box_on_a_slope_stays_where_it_is_in_halves) {
  Model model;
  add_block(model, "box", 1.0, {0.1, 0.1, 0.1}, {0, 0, 0.05}, 0.5);
  add_floor(model, 0.5);
  model.contacts = {{"floor", "box"}};
  model.contacts[0].friction = 0.5;
  model.gravity = 9.81 * Vector3d(std::sin(std::atan(0.495)), 0.0, -std::cos(std::atan(0.495)));
  // A top on the other side of the world makes the guard halve every step.
  add_block(model, "top", 0.3, {0.1, 0.2, 0.03}, {5, 0, 0.5}, 0.5);
  for (const double spin : {0.0, 40.0}) {
    model.roots.back().velocity << spin, 3.0 * (spin > 0.0), 1.0 * (spin > 0.0), 0, 0, 0;
    Batch<double> batch(compile(model, leapfrog(60)), 1, {.threads = 1});
    batch.step(60);
    const double place = batch.root_poses()(0, 0);
    batch.step(240);
    EXPECT_EQ(batch.faults()[0], Fault::none);
    EXPECT_NEAR(batch.root_poses()(0, 0), place, 1e-8) << spin;
  }
}

// A pendulum with a servo, and elsewhere a box at rest that has a contact.
Model servo_and_box(bool box) {
  Model model;
  const Inertia hangs = Inertia::box(1.0, {0.1, 0.1, 0.4}, {0.0, 0.0, -0.4});
  model.links = {{"base", {}}, {"arm", hangs}};
  Joint joint;
  joint.name = "joint", joint.kind = JointKind::revolute, joint.parent = "base", joint.child = "arm";
  joint.axis = Eigen::Vector3d::UnitY();
  joint.position = 0.5;
  joint.drive = {.kp = 20.0, .kd = 0.5, .position_target = 0.2, .velocity_target = 0.5};
  model.joints = {joint};
  if (!box) return model;
  model.links.push_back({"box", Inertia::box(1.0, {0.2, 0.2, 0.2}, Eigen::Vector3d::Zero())});
  model.roots = {{"base"}, {"box", true, Pose(Eigen::Translation3d(5.0, 0.0, 0.1))}};
  model.colliders = {{.name = "ground", .shape = Shape::half_space()},
                     {.name = "box", .link = "box", .shape = Shape::box({0.2, 0.2, 0.2})}};
  model.contacts = {{"ground", "box"}};
  return model;
}

TEST(MidpointServos, with_inputs_of_each_stage_are_of_second_order) {
  const auto end = [](bool box, int steps) {
    constexpr double duration = 0.4;
    StepSettings settings = leapfrog(steps / duration);
    settings.stage_inputs = true;
    const Plan plan = compile(servo_and_box(box), settings);
    Batch<double> batch(plan, 1, {.threads = 1});
    const std::vector<double> times = plan.stage_times();
    for (int i = 0; i < steps; ++i) {
      for (std::size_t s = 0; s < times.size(); ++s) {
        const auto row = static_cast<Eigen::Index>(s) * plan.dofs();
        const double t = (i + times[s]) * settings.dt;
        batch.position_targets()(row, 0) = 0.2 + 0.6 * std::sin(6.0 * t);
        batch.velocity_targets()(row, 0) = 3.6 * std::cos(6.0 * t);
        batch.efforts()(row, 0) = 2.0 * std::cos(9.0 * t);
      }
      batch.step(1);
    }
    return batch.positions()(0, 0);
  };
  const double truth = end(false, 6400);
  const double coarse = std::abs(end(true, 100) - truth), fine = std::abs(end(true, 200) - truth);
  EXPECT_NEAR(std::log2(coarse / fine), 2.0, 0.15) << coarse << ' ' << fine;
}

}  // namespace
}  // namespace lockstep
