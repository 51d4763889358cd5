// Rollouts take the steps that loops of step() take. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cstring>
#include <random>

#include "contact_scenes.h"
#include "lockstep/lockstep.h"

namespace lockstep {
namespace {

const Query record[] = {{Quantity::position}, {Quantity::velocity}, {Quantity::root_pose}, {Quantity::contact_force}};

// A geared pair of drives whose second link pushes a free block over a floor.
Model pusher() {
  Model model = contact_scenes::block();
  model.links.push_back({"base", {}});
  Root base;
  base.link = "base", base.pose = contact_scenes::at({-0.3, 0, 0.05});
  model.roots.push_back(base);
  const auto add = [&](const char* name, const char* parent, double x) {
    model.links.push_back({name, Inertia::box(0.5, {0.1, 0.05, 0.05}, {0, 0, 0})});
    Joint joint;
    joint.name = name, joint.parent = parent, joint.child = name, joint.kind = JointKind::prismatic;
    joint.axis = {1, 0, 0}, joint.origin.translation() = Eigen::Vector3d(x, 0, 0);
    joint.lower = -0.1, joint.upper = 0.3;
    model.joints.push_back(joint);
  };
  add("slow", "base", 0.0), add("fast", "base", 0.12);
  model.joints[0].drive.kp = 400, model.joints[0].drive.kd = 40;
  model.couplings.push_back(Coupling::mimic("fast", "slow", -0.8));
  model.colliders.push_back({.name = "fast", .link = "fast", .shape = Shape::box({0.1, 0.05, 0.05}), .friction = 0.4});
  model.contacts.push_back({"fast", "block"});
  return model;
}

template <class S>
std::vector<S> random_controls(int count) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> number(-1.2, 1.2);
  std::vector<S> controls(static_cast<std::size_t>(count));
  for (S& control : controls) control = static_cast<S>(number(random));
  return controls;
}

template <class S>
struct Result {
  std::vector<S> rows;
  std::vector<Fault> faults;
};

constexpr int rollouts = 37, steps = 30, substeps = 3;

int rows_of_record(const Plan& plan) {
  int rows = 0;
  for (const Query& query : record) rows += plan.query_rows(query);
  return rows;
}

template <class S>
Result<S> rolled_out(const Plan& plan, std::span<const std::byte> start, int environments, int threads) {
  Batch<S> batch(plan, environments, {.threads = threads});
  const int rows = rows_of_record(plan);
  const std::vector<S> controls = random_controls<S>(rollouts * steps);
  Result<S> result{std::vector<S>(static_cast<std::size_t>(rollouts * steps * rows)), {}};
  result.faults =
      batch.rollout(start, {controls.data(), steps, 1, 1}, record, {result.rows.data(), steps * rows, rows, 1},
                    {.rollouts = rollouts, .steps = steps, .substeps = substeps});
  return result;
}

template <class S>
std::vector<std::byte> pushed(const Plan& plan) {  // a state that remembers contacts
  Batch<S> batch(plan, 1, {.threads = 1});
  batch.position_targets().setConstant(S(0.2));
  batch.step(40);
  return batch.save();
}

template <class S>
class Rollout : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(Rollout, Scalars);

TYPED_TEST(Rollout, takes_the_steps_of_a_loop_over_step_bit_by_bit) {
  using S = TypeParam;
  const Plan plan = compile(pusher());
  const std::vector<std::byte> start = pushed<S>(plan);
  const Result<S> result = rolled_out<S>(plan, start, rollouts, 1);
  const int rows = rows_of_record(plan);
  const std::vector<S> controls = random_controls<S>(rollouts * steps);
  Batch<S> batch(plan, rollouts, {.threads = 1});
  std::vector<int> all(rollouts), first(rollouts, 0);
  for (int i = 0; i < rollouts; ++i) all[static_cast<std::size_t>(i)] = i;
  batch.restore(start, all, first);
  std::vector<S> read(static_cast<std::size_t>(rollouts * rows));
  bool pressed = false;
  for (int t = 0; t < steps; ++t) {
    batch.set_actions({controls.data() + t, 1, steps});
    batch.step(substeps);
    batch.read(record, {read.data(), 1, rows});
    for (int i = 0; i < rollouts; ++i)
      for (int k = 0; k < rows; ++k) {
        const S number = result.rows[static_cast<std::size_t>((i * steps + t) * rows + k)];
        ASSERT_EQ(number, read[static_cast<std::size_t>(i * rows + k)]) << i << ' ' << t << ' ' << k;
        pressed |= k >= rows - 3 && number != S(0);
      }
  }
  EXPECT_TRUE(pressed);
}

TYPED_TEST(Rollout, has_the_same_bits_for_any_number_of_environments_and_threads) {
  using S = TypeParam;
  const Plan plan = compile(pusher());
  const std::vector<std::byte> start = pushed<S>(plan);
  const Result<S> whole = rolled_out<S>(plan, start, rollouts, 1);
  for (const int environments : {1, 5, 16, 64})
    for (const int threads : {1, 2}) {
      const Result<S> part = rolled_out<S>(plan, start, environments, threads);
      EXPECT_EQ(0, std::memcmp(whole.rows.data(), part.rows.data(), whole.rows.size() * sizeof(S))) << environments;
    }
}

TEST(RolloutStarts, are_one_environment_one_for_each_or_the_batch_itself) {
  const Plan plan = compile(pusher(), {.per_environment = {Parameter::mass}});
  Batch<double> batch(plan, 3, {.threads = 1});
  for (int e = 0; e < 3; ++e) batch.parameter(Parameter::mass).col(e) *= 1.0 + e;
  batch.step(20);
  const std::vector<std::byte> start = batch.save();
  const std::vector<double> controls(3 * 4, 1.0);
  const int rows = rows_of_record(plan);
  const auto rolled = [&](Batch<double>& own, std::span<const std::byte> from, int count) {
    std::vector<double> out(static_cast<std::size_t>(count * 4 * rows));
    own.rollout(from, {controls.data(), 4, 1, 1}, record, {out.data(), 4 * rows, rows, 1},
                {.rollouts = count, .steps = 4});
    return out;
  };
  const std::vector<double> own = rolled(batch, {}, 3);
  Batch<double> other(plan, 2, {.threads = 1});
  EXPECT_EQ(own, rolled(other, start, 3));
  batch.restore(start);
  for (int e = 0; e < 3; ++e) {
    const std::vector<double> one = rolled(other, batch.save(std::vector<int>{e}), 1);
    EXPECT_TRUE(std::equal(one.begin(), one.end(), own.begin() + e * 4 * rows));
    if (e > 0) {
      EXPECT_FALSE(std::equal(one.begin(), one.end(), own.begin()));
    }
  }
}

TEST(RolloutFaults, are_returned_and_stay_alone) {
  const Plan plan = compile(pusher(), {.per_environment = {Parameter::mass}});
  Batch<double> batch(plan, 4, {.threads = 1});
  batch.parameter(Parameter::mass).col(2) = -1.0;
  const std::vector<std::byte> start = batch.save();
  const std::vector<double> controls(4 * 5, 0.3);
  Batch<double> other(plan, 3, {.threads = 1});
  const auto faults = other.rollout(start, {controls.data(), 5, 1, 1}, {}, {}, {.rollouts = 4, .steps = 5});
  EXPECT_EQ(faults, (std::vector<Fault>{Fault::none, Fault::none, Fault::bad_value, Fault::none}));
}

TEST(RawControls, are_targets_themselves) {
  const Plan plan = compile(pusher());
  const std::vector<double> controls = {0.123, 0.05};
  Batch<double> batch(plan, 2, {.threads = 1});
  batch.rollout({}, {controls.data(), 1, 1, 1}, {}, {}, {.rollouts = 2, .map = {.raw = true}});
  EXPECT_EQ(batch.position_targets()(0, 0), 0.123);
  EXPECT_EQ(batch.position_targets()(0, 1), 0.05);
}

TEST(RolloutRefuses, what_does_not_fit_and_changes_nothing) {
  const Plan plan = compile(pusher());
  Batch<double> batch(plan, 2, {.threads = 1});
  batch.step(5);
  const std::vector<std::byte> before = batch.save();
  std::vector<double> controls(3 * 2, 0.5), out(1000);
  const auto refused = [&](std::span<const std::byte> start, RolloutOptions options, double* at, double* to) {
    EXPECT_THROW(batch.rollout(start, {at, 2, 1, 1}, record, {to, 100, 50, 1}, options), UsageError);
    EXPECT_EQ(batch.save(), before);
  };
  refused({}, {.rollouts = 0}, controls.data(), out.data());
  refused({}, {.rollouts = 2, .steps = 0}, controls.data(), out.data());
  refused({}, {.rollouts = 2, .substeps = 0}, controls.data(), out.data());
  refused({}, {.rollouts = 3, .steps = 2}, controls.data(), out.data());
  refused(before, {.rollouts = 3, .steps = 2}, controls.data(), out.data());
  refused({}, {.rollouts = 2, .steps = 2}, nullptr, out.data());
  refused({}, {.rollouts = 2, .steps = 2}, controls.data(), nullptr);
  refused({}, {.rollouts = 2, .steps = 2, .map = {.low = {0.0}}}, controls.data(), out.data());
  refused({}, {.rollouts = 2, .steps = 2, .map = {.low = {0.0}, .high = {0.1}, .raw = true}}, controls.data(),
          out.data());
  controls[3] = std::nan("");
  refused({}, {.rollouts = 2, .steps = 2}, controls.data(), out.data());
}

// What is recorded would overwrite controls that are read later, or the state.
TEST(RolloutRefuses, memory_that_it_reads_later) {
  const Plan plan = compile(pusher());
  Batch<double> batch(plan, 2, {.threads = 1});
  const std::vector<std::byte> before = batch.save();
  const std::vector<Query> positions = {{Quantity::position}};
  const int n = plan.dofs();
  std::vector<double> both(2 * 4 * (1 + n), 0.1);
  const auto rollout = [&](double* controls, double* out, std::ptrdiff_t step) {
    return batch.rollout(before, {controls, 4 * step, step, 1}, positions, {out, 4 * step, step, 1},
                         {.rollouts = 2, .steps = 4});
  };
  EXPECT_THROW(rollout(both.data(), both.data(), 1 + n), UsageError);
  EXPECT_THROW(rollout(both.data(), both.data() + 1, 1), UsageError);
  EXPECT_THROW(rollout(batch.efforts().data(), both.data(), 0), UsageError);
  EXPECT_EQ(batch.save(), before);
  // Side by side in each step, whichever comes first.
  std::vector<double> apart(both.size(), 0.1);
  EXPECT_EQ(rollout(both.data(), both.data() + 1, 1 + n), rollout(apart.data() + n, apart.data(), 1 + n));
  for (int i = 0; i < 8; ++i)
    for (int k = 0; k < n; ++k)
      EXPECT_EQ(both[static_cast<std::size_t>(i * (1 + n) + 1 + k)], apart[static_cast<std::size_t>(i * (1 + n) + k)]);
}

}  // namespace
}  // namespace lockstep
