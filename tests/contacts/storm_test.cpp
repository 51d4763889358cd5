// Random drops, piles and jumping targets: nothing breaks, nothing depends on neighbours. SPDX-License-Identifier:
// Apache-2.0
#include <gtest/gtest.h>

#include <random>

#include "contact_scenes.h"

namespace lockstep {
namespace {

using namespace contact_scenes;

constexpr int environments = 32;

// Kinetic and potential energy of every environment.
template <class S>
Eigen::ArrayXXd energies(const Batch<S>& batch) {
  const Query queries[] = {{Quantity::kinetic_energy}, {Quantity::potential_energy}};
  Eigen::Array<S, 2, environments, Eigen::RowMajor> numbers;
  batch.read(queries, {numbers.data(), environments, 1});
  return numbers.template cast<double>();
}

template <class S>
void turn(Batch<S>& batch, unsigned seed) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal;
  for (int e = 0; e < batch.environments(); ++e)
    for (int r = 0; 7 * r < batch.root_poses().rows(); ++r) {
      const Eigen::Quaterniond q =
          Eigen::Quaterniond(normal(generator), normal(generator), normal(generator), normal(generator)).normalized();
      const double wxyz[] = {q.w(), q.x(), q.y(), q.z()};
      for (int k = 0; k < 4; ++k) batch.root_poses()(7 * r + 3 + k, e) = static_cast<S>(wxyz[k]);
      for (int k = 0; k < 6; ++k) batch.root_velocities()(6 * r + k, e) = static_cast<S>(normal(generator));
    }
}

template <class S>
struct Storms : testing::Test {};
using Precisions = testing::Types<double, float>;
TYPED_TEST_SUITE(Storms, Precisions);

TYPED_TEST(Storms, piles_fall_and_come_to_rest_without_energy_from_nowhere) {
  int unfinished = 0;
  for (unsigned seed = 0; seed < 8; ++seed) {
    Batch<TypeParam> batch(compile(pile(seed)), environments, {.threads = 1});
    turn(batch, seed);
    Eigen::ArrayXd before = energies(batch).colwise().sum(), first = before;
    for (int i = 0; i < 480; ++i) {
      batch.step(1);
      const Eigen::ArrayXd now = energies(batch).colwise().sum();
      // An overlap may be pushed out, which lifts what lies on it by less than a hundredth of what has fallen.
      EXPECT_LT((now - before).maxCoeff(), 0.01 * first.abs().maxCoeff()) << "seed " << seed << ", step " << i;
      before = now;
    }
    EXPECT_LT((before - first).maxCoeff(), 0.0) << seed;
    for (const Fault fault : batch.faults()) EXPECT_EQ(fault, Fault::none) << seed;
    Eigen::Array<TypeParam, 1, environments> counts;
    const Query query{Quantity::unfinished_contacts};
    batch.read(std::span(&query, 1), {counts.data(), environments, 1});
    unfinished += static_cast<int>(counts.sum());
    EXPECT_GT(static_cast<double>(batch.root_poses().row(2).minCoeff()), 0.0) << seed;
  }
  EXPECT_LT(unfinished, 8 * 480 * environments / 1000);  // a tenth of a per cent of the steps
}

// Slots appear, merge and change places, and pairs part: the forces are those of the step all the same. One solve, so
// the velocity that moves the positions is the one that stays.
TEST(Piles, are_moved_by_gravity_and_the_reported_forces_alone) {
  for (unsigned seed = 0; seed < 6; ++seed) {
    const Model model = pile(seed);
    StepSettings settings;
    settings.velocity_iterations = 0;
    settings.contacts = {3, 200, 1e-12};
    const Plan plan = compile(model, settings);
    Batch<double> batch(plan, environments, {.threads = 1});
    turn(batch, seed);
    const auto velocities = [&] {  // of the bodies, along the world's axes
      Eigen::ArrayXXd v(3 * model.roots.size(), environments);
      for (int e = 0; e < environments; ++e)
        for (std::size_t r = 0; r < model.roots.size(); ++r) {
          const auto pose = batch.root_poses().col(e).segment<7>(7 * static_cast<Eigen::Index>(r));
          const Eigen::Quaterniond turn(pose[3], pose[4], pose[5], pose[6]);
          v.col(e).segment<3>(3 * static_cast<Eigen::Index>(r)) =
              turn * batch.root_velocities().col(e).segment<3>(6 * static_cast<Eigen::Index>(r) + 3).matrix();
        }
      return v;
    };
    const Query query{Quantity::contact_force};
    Batch<double>::Array forces(plan.query_rows(query), environments);
    Eigen::ArrayXXd before = velocities();
    for (int i = 0; i < 200; ++i) {
      batch.step(1);
      batch.read(std::span(&query, 1), {forces.data(), environments, 1});
      const Eigen::ArrayXXd after = velocities();
      Eigen::ArrayXXd momentum = Eigen::ArrayXXd::Zero(before.rows(), environments), largest = momentum;
      for (std::size_t r = 0; r < model.roots.size(); ++r) {
        const double mass = model.links[r].inertia.mass;
        const auto rows = Eigen::seqN(3 * static_cast<Eigen::Index>(r), 3);
        momentum(rows, Eigen::all) = mass * (after - before)(rows, Eigen::all);
        momentum.row(3 * static_cast<Eigen::Index>(r) + 2) += mass * 9.81 * settings.dt;
      }
      for (std::size_t c = 0; c < plan.contacts().size(); ++c)
        for (const auto& [collider, sign] :
             {std::pair(plan.contacts()[c].first, -1.0), {plan.contacts()[c].second, 1.0}})
          for (std::size_t r = 0; r < model.roots.size(); ++r) {
            if (model.roots[r].link != model.colliders[static_cast<std::size_t>(collider)].link) continue;
            const auto rows = Eigen::seqN(3 * static_cast<Eigen::Index>(r), 3);
            const Eigen::ArrayXXd impulse = settings.dt * forces.middleRows(3 * static_cast<Eigen::Index>(c), 3);
            momentum(rows, Eigen::all) -= sign * impulse;
            largest(rows, Eigen::all) += impulse.abs();
          }
      EXPECT_LT((momentum.abs() - 1e-9 * largest).maxCoeff(), 1e-9) << "seed " << seed << ", step " << i;
      before = after;
    }
  }
}

TYPED_TEST(Storms, a_gripper_with_jumping_targets_keeps_its_couplings_and_limits) {
  Grasp grasp{0.5};
  Model model = grasp.model();
  for (Joint& joint : model.joints)
    if (joint.name == "left") joint.lower = -0.01, joint.upper = 0.05, joint.velocity_limit = 2.0;
  const Plan plan = compile(model);
  Batch<TypeParam> batch(plan, environments, {.threads = 1});
  std::mt19937 generator(3);
  for (int i = 0; i < 1200; ++i) {
    if (i % 60 == 0)
      for (int e = 0; e < environments; ++e) {
        const auto uniform = [&](double low, double high) {
          return static_cast<TypeParam>(std::uniform_real_distribution<double>(low, high)(generator));
        };
        batch.position_targets()(plan.dof("y"), e) = uniform(-0.1, 0.1);
        batch.position_targets()(plan.dof("z"), e) = uniform(0.0, 0.2);
        batch.position_targets()(plan.dof("wrist"), e) = uniform(-1.5, 1.5);
        batch.position_targets()(plan.dof("left"), e) = uniform(0.0, 0.05);
      }
    batch.step(1);
  }
  for (const Fault fault : batch.faults()) EXPECT_EQ(fault, Fault::none);
  EXPECT_LT(static_cast<double>(batch.coupling_errors().abs().maxCoeff()), 1e-12);
  const auto left = batch.positions().row(plan.dof("left"));
  EXPECT_LE(static_cast<double>(left.maxCoeff()), 0.05 * (1 + 1e-6));
  EXPECT_GE(static_cast<double>(left.minCoeff()), -0.01 * (1 + 1e-6));
}

TYPED_TEST(Storms, no_environment_sees_threads_batch_place_or_neighbours) {
  const Plan plan = compile(pile(5));
  Batch<TypeParam> all(plan, environments, {.threads = 2}), one(plan, 1, {.threads = 1});
  turn(all, 11);
  for (const int e : {0, 7, 19, 31}) {
    one.reset();
    one.root_poses() = all.root_poses().col(e), one.root_velocities() = all.root_velocities().col(e);
    Batch<TypeParam> copy(plan, environments, {.threads = 1});
    turn(copy, 11);
    copy.root_velocities().col((e + 1) % environments)[2] = std::numeric_limits<TypeParam>::quiet_NaN();
    for (int i = 0; i < 150; ++i) one.step(1);
    copy.step(150);
    EXPECT_TRUE((one.root_poses().col(0) == copy.root_poses().col(e)).all()) << e;
    EXPECT_TRUE((one.root_velocities().col(0) == copy.root_velocities().col(e)).all()) << e;
    EXPECT_NE(copy.faults()[static_cast<std::size_t>((e + 1) % environments)], Fault::none);
  }
  Batch<TypeParam> start(plan, environments, {.threads = 1});
  turn(start, 11);
  start.step(150), all.step(150);
  EXPECT_TRUE((start.root_poses() == all.root_poses()).all());
}

// Bounces, push-outs and carried impulses make lanes be solved up to six times in a step, each beside others.
TYPED_TEST(Storms, no_environment_sees_its_neighbours_bounce) {
  Model model = pile(7);
  for (Collider& collider : model.colliders) collider.restitution = 0.97;
  for (Root& root : model.roots) root.pose.translation().z() -= 0.06;
  const Plan plan = compile(model);
  Batch<TypeParam> all(plan, environments, {.threads = 1}), one(plan, 1, {.threads = 1});
  turn(all, 13);
  const Eigen::ArrayXXd poses = all.root_poses().template cast<double>(),
                        twists = all.root_velocities().template cast<double>();
  all.step(150);
  for (int e = 0; e < environments; ++e) {
    one.reset();
    one.root_poses() = poses.col(e).template cast<TypeParam>();
    one.root_velocities() = twists.col(e).template cast<TypeParam>();
    one.step(150);
    EXPECT_TRUE((one.root_poses().col(0) == all.root_poses().col(e)).all()) << e;
    EXPECT_TRUE((one.root_velocities().col(0) == all.root_velocities().col(e)).all()) << e;
  }
}

TYPED_TEST(Storms, save_and_restore_go_on_with_the_same_bits) {
  const Plan plan = compile(pile(2));
  Batch<TypeParam> batch(plan, environments, {.threads = 1}), other(plan, environments, {.threads = 1});
  turn(batch, 4);
  batch.step(200);
  other.restore(batch.save());
  batch.step(100), other.step(100);
  EXPECT_TRUE((batch.root_poses() == other.root_poses()).all());
  EXPECT_TRUE((batch.root_velocities() == other.root_velocities()).all());
}

// A block rests on a slope: its memory holds it. Pushes and small corrections of all kinds leave the memory, so the
// block moves as those say and no further. Without memory, each would let it creep.
TYPED_TEST(Storms, a_write_to_the_state_keeps_contacts) {
  const Plan plan = compile(slope(0.9));
  constexpr int kinds = 4;  // nothing, a velocity, a position, another place on the slope
  Batch<TypeParam> batch(plan, kinds, {.threads = 1}), forgetful(plan, kinds, {.threads = 1});
  const auto force = [](const Batch<TypeParam>& b, int e) {
    Eigen::Array<TypeParam, 1, kinds> numbers;
    const Query query{Quantity::contact_normal_force};
    b.read(std::span(&query, 1), {numbers.data(), kinds, 1});
    return static_cast<double>(numbers[e]);
  };
  const auto write = [&](Batch<TypeParam>& b) {
    const double tiny = sizeof(TypeParam) == 4 ? 1e-6 : 1e-9;
    b.root_velocities()(4, 1) += TypeParam(tiny);
    b.root_poses()(1, 2) += TypeParam(tiny);
    b.root_poses()(0, 3) += TypeParam(0.01);
  };
  batch.step(240), forgetful.step(240);
  const Eigen::Array<TypeParam, 1, kinds> start = batch.root_poses().row(0);
  for (int i = 0; i < 50; ++i) {
    write(batch), write(forgetful);
    forgetful.forget_contacts();
    for (int e = 0; e < kinds; ++e) {
      EXPECT_NEAR(force(batch, e), 9.81 * std::cos(0.9 * std::atan(0.5)), 2e-3) << e;
      EXPECT_EQ(force(forgetful, e), 0.0) << e;
    }
    batch.step(4), forgetful.step(4);
  }
  for (int e = 0; e < kinds; ++e) {
    const auto crept = [&](const Batch<TypeParam>& b) {
      return static_cast<double>(b.root_poses()(0, e) - start[e]) - (e == 3 ? 50 * 0.01 : 0.0);
    };
    EXPECT_LT(std::abs(crept(batch)), sizeof(TypeParam) == 4 ? 1e-6 : 1e-12) << e;
    EXPECT_GT(crept(forgetful), 3e-6) << e;
  }
}

// What was moved apart has no memory, nor has what was reset: it falls as a new block does.
TYPED_TEST(Storms, what_was_moved_apart_begins_anew) {
  const Plan plan = compile(slope(0.9));
  Batch<TypeParam> batch(plan, 2, {.threads = 1}), fresh(plan, 2, {.threads = 1});
  batch.step(240);
  fresh.root_poses().col(0) = batch.root_poses().col(0),
  fresh.root_velocities().col(0) = batch.root_velocities().col(0);
  batch.root_poses()(2, 0) += TypeParam(1), fresh.root_poses()(2, 0) += TypeParam(1);
  const int second[] = {1};
  batch.reset(second);
  batch.step(1), fresh.step(1);
  batch.step(239), fresh.step(239);
  EXPECT_TRUE((batch.root_poses() == fresh.root_poses()).all());
  EXPECT_TRUE((batch.root_velocities() == fresh.root_velocities()).all());
}

}  // namespace
}  // namespace lockstep
