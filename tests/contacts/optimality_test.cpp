// Every step of random scenes solves its convex problem, and its slips are those that it assumed.
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cstring>

#include <Eigen/Dense>
#include <random>
#include <vector>

#include "contact_scenes.h"
#include "kernels/tile/lay_out.h"
#include "plan/program.h"
#include "targets/kernel_set.h"

namespace lockstep {

extern const KernelSet<double> baseline_scalar_f64;  // tests/twins

namespace {

using namespace contact_scenes;

using One = simd::Wide<double, 1, simd::Unfused>;  // that of baseline_scalar

double value(const One& number) {
  double out;
  store(&out, number);
  return out;
}
bool holds(const One::Mask& mask) { return any(mask); }

/// One environment whose tile is in sight.
struct Environment {
  explicit Environment(const Plan& own) : plan(own), t(program_of(plan).f64) {
    batch.stride = 1;
    batch.position = block(t.joints), batch.velocity = block(t.joints), batch.angle = block(t.joints);
    batch.position_target = targets = block(t.joints), batch.velocity_target = block(t.joints);
    batch.effort = block(t.joints);
    batch.root_pose = block(7 * t.roots.count), batch.root_velocity = block(6 * t.roots.count);
    batch.contact_memory = block(t.contacts.remembered(t)), batch.solve_counts = block(solve_count_rows);
    batch.audit = block(2);
    batch.fault = &fault;
    Batch<double> start(plan, 1, {.threads = 1});
    const auto copy = [](const auto& from, double* to) {
      for (Eigen::Index row = 0; row < from.rows(); ++row) to[row] = from(row, 0);
    };
    copy(start.positions(), batch.position), copy(start.positions(), batch.angle);
    copy(start.position_targets(), targets);
    copy(start.root_poses(), batch.root_pose), copy(start.root_velocities(), batch.root_velocity);
    scratch.resize(baseline_scalar_f64.scratch_bytes(t) / sizeof(Line) + 1);
    kernels::lay_out(t, scratch.data(), x);
  }

  void step(int steps = 1) { baseline_scalar_f64.advance(t, batch, 0, 1, steps, scratch.data()); }

  double* block(int rows) { return blocks.emplace_back(static_cast<std::size_t>(rows) + 1, 0.0).data(); }

  struct alignas(64) Line {
    double numbers[8];
  };

  Plan plan;
  Tables<double> t;
  StatePointers<double> batch;
  double* targets = nullptr;
  Fault fault = Fault::none;
  std::vector<std::vector<double>> blocks;
  std::vector<Line> scratch;
  kernels::Tile<One> x;
};

/// The projection of y on the cone |tangents| <= friction * normal, by its three cases.
Vector3d projected(const Vector3d& y, double friction) {
  const double length = y.tail<2>().norm();
  if (length <= friction * y[0]) return y;
  if (friction * length <= -y[0]) return Vector3d::Zero();
  const double normal = (y[0] + friction * length) / (1 + friction * friction);
  return {normal, friction * normal * y[1] / length, friction * normal * y[2] / length};
}

struct Checked {
  double newton_step = 0.0;  ///< what another step of Newton's method would change, by what is allowed
  double slip = 0.0;         ///< by which the slip of a step differs from the one assumed, m
  bool acts = false;
};

/// The gradient of (M106) at the velocities that the step has found, with a law and Jacobians of its own.
Checked check(Environment& e) {
  const Tables<double>& t = e.t;
  auto& x = e.x;
  const int n = t.rounds.columns.n;
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(n, n);
  for (int j = 0; j < n; ++j)
    for (int k = 0; k < t.rounds.columns.size[j]; ++k)
      a(j, j + k) = a(j + k, j) = value(x.held.matrix[t.rounds.columns.offset[j] + k]);
  Eigen::VectorXd z(n), gradient(n);
  for (int k = 0; k < n; ++k) {
    z[k] = value(x.rounds.z[k]);
    gradient[k] = value(x.held.momentum[k]);
  }
  for (int k = 0; k < n; ++k) gradient -= a.col(k) * (z[k] - value(x.held.start[k]));
  Checked found;
  for (int p = 0; p < t.contacts.pairs.count; ++p) {
    const auto& pair = t.contacts.pairs[p];
    if (!holds(x.contacts.patch[p].near)) continue;
    for (int s = pair.slot; s < pair.slot + pair.slots; ++s) {
      const auto& slot = x.contacts.slot[s];
      if (!holds(slot.live)) continue;
      const auto vector = [](const simd::Vec3<One>& v) { return Vector3d(value(v.x), value(v.y), value(v.z)); };
      Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(3, n);
      for (int c = pair.column; c < pair.column + pair.columns; ++c)
        jacobian.col(t.contacts.columns[c].velocity) +=
            vector(x.contacts.moving[c]) + vector(x.contacts.turning[c]).cross(vector(slot.arm));
      const Vector3d u = jacobian * z;
      const double k = value(slot.stiffness), bias = value(slot.bias), slip = value(slot.slip);
      const Vector3d asked(value(slot.push) - k * (u[0] + bias + slip),
                           value(slot.carried[0]) - k * (u[1] + value(slot.drift[0])),
                           value(slot.carried[1]) - k * (u[2] + value(slot.drift[1])));
      const Vector3d impulse = projected(asked, pair.friction);
      for (int i = 0; i < 3; ++i) EXPECT_NEAR(value(slot.force.impulse[i]), impulse[i], 1e-9 * (1 + impulse.norm()));
      gradient += jacobian.transpose() * impulse;
      a += k * jacobian.transpose() * jacobian * (impulse[0] > 0.0 ? 1.0 : 0.0);
      if (impulse[0] <= 0.0) continue;
      found.acts = true;
      const Eigen::Vector2d sliding(u[1] + value(slot.drift[0]), u[2] + value(slot.drift[1]));
      found.slip = std::max(found.slip, t.dt * std::abs(pair.friction * sliding.norm() - slip));
    }
  }
  if (found.acts)
    found.newton_step =
        a.ldlt().solve(gradient).cwiseAbs().maxCoeff() / (t.contacts.tolerance * (1 + z.cwiseAbs().maxCoeff()));
  return found;
}

struct Tally {
  int steps = 0, unfinished = 0, unsettled = 0;
  double newton_step = 0.0;

  void add(Environment& e, double& capped) {
    const Checked found = check(e);
    steps += found.acts;
    const double now = e.batch.contact_memory[e.t.contacts.remembered(e.t) - 1];
    if (now > capped) {
      ++unfinished;
    } else if (found.acts) {
      newton_step = std::max(newton_step, found.newton_step);
      unsettled += found.slip > 1.001e-5;
    }
    capped = now;
  }
};

void turn(Environment& e, unsigned seed) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal;
  for (int r = 0; r < e.t.roots.count; ++r) {
    Eigen::Quaterniond q(normal(generator), normal(generator), normal(generator), normal(generator));
    q.normalize();
    const double wxyz[] = {q.w(), q.x(), q.y(), q.z()};
    for (int k = 0; k < 4; ++k) e.batch.root_pose[7 * r + 3 + k] = wxyz[k];
    for (int k = 0; k < 6; ++k) e.batch.root_velocity[6 * r + k] = normal(generator);
  }
}

Tally piles(int passes) {
  Tally tally;
  for (unsigned seed = 0; seed < 12; ++seed) {
    StepSettings settings;
    settings.contacts.passes = passes;
    Environment e(compile(pile(seed), settings));
    turn(e, seed);
    double capped = 0.0;
    for (int i = 0; i < 300; ++i) {
      e.step();
      tally.add(e, capped);
    }
  }
  return tally;
}

TEST(ContactSteps, of_piles_minimise_the_convex_function_of_their_last_pass) {
  const Tally tally = piles(StepSettings().contacts.passes);
  EXPECT_GT(tally.steps, 2000);
  EXPECT_LT(tally.newton_step, 1.0);
  EXPECT_LT(tally.unfinished, tally.steps / 100);
}

TEST(ContactSteps, of_piles_assume_the_slips_that_they_find_after_enough_passes) {
  const Tally few = piles(StepSettings().contacts.passes), many = piles(40);
  EXPECT_LT(many.unsettled, many.steps / 200);
  EXPECT_LT(few.unsettled, few.steps / 10);
  EXPECT_GT(few.unsettled, many.unsettled);
}

TEST(ContactSteps, of_a_gripper_with_jumping_targets_do_both) {
  Tally tally;
  for (unsigned seed = 0; seed < 6; ++seed) {
    std::mt19937 generator(seed);
    const auto uniform = [&](double low, double high) {
      return std::uniform_real_distribution<double>(low, high)(generator);
    };
    const Plan plan = compile(Grasp{std::pow(10.0, uniform(-2.0, 0.5))}.model());
    Environment e(plan);
    double capped = 0.0;
    for (int i = 0; i < 480; ++i) {
      if (i % 40 == 0) {
        e.targets[plan.dof("y")] = uniform(-0.1, 0.1), e.targets[plan.dof("z")] = uniform(0.0, 0.2);
        e.targets[plan.dof("wrist")] = uniform(-1.5, 1.5), e.targets[plan.dof("left")] = uniform(0.0, 0.05);
      }
      e.step();
      tally.add(e, capped);
    }
  }
  EXPECT_GT(tally.steps, 1000);
  EXPECT_LT(tally.newton_step, 1.0);
  EXPECT_LT(tally.unfinished, tally.steps / 100);
  EXPECT_LT(tally.unsettled, tally.steps / 20);
}

// What a tile has left in memory, of another environment or of nothing at all, says nothing to the next steps.
TEST(Scratch, of_other_environments_changes_no_bit) {
  Model soft = finger();
  soft.joints[0].limit_softness = Spring{30.0, 1.0}, soft.joints[1].friction = 0.01;
  for (const Model& model : {pile(1), quadruped(), finger(), soft, Grasp{0.1}.model()})
    for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
      StepSettings settings;
      settings.integrator = integrator;
      const Plan plan = compile(model, settings);
      Environment clean(plan), dirty(plan);
      for (int i = 0; i < 40; ++i) {
        std::memset(clean.scratch.data(), 0, sizeof(clean.scratch[0]) * clean.scratch.size());
        std::memset(dirty.scratch.data(), 0xff, sizeof(dirty.scratch[0]) * dirty.scratch.size());
        clean.step(6), dirty.step(6);
        ASSERT_EQ(clean.fault, dirty.fault) << model.name << " " << i;
        ASSERT_EQ(clean.blocks, dirty.blocks) << model.name << " " << to_string(integrator) << " " << i;
      }
    }
}

}  // namespace
}  // namespace lockstep
