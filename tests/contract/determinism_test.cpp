// The same bits for any thread count, batch size, place and neighbour. SPDX-License-Identifier: Apache-2.0
//
// Every comparison here is of bits. Only across arithmetic classes, where a multiply-add rounds once or twice,
// results agree to rounding instead; how far that may take them apart is said there.
#include <cmath>
#include <limits>

#include "bounded_scenes.h"
#include "plan/program.h"
#include "reference/step.h"

namespace lockstep {
namespace {

using contract::same_bits;
using contract::scattered;

constexpr BatchOptions serial = {.threads = 1};
struct ArithmeticClass {
  Target twin;
  std::vector<Target> wide;
};
const ArithmeticClass classes[] = {{twins::baseline_scalar, {Target::baseline}},
                                   {twins::avx2_scalar, {Target::avx2, Target::avx512}},
                                   {twins::neon_scalar, {Target::neon}}};
constexpr int several = 17;  // one more than the lanes of the widest tile
constexpr int places[] = {0, 3, 7, 8, 12, 15, 16};
constexpr int a_task_each = 2100;     // more lines of the cache, the least tasks, than eight threads take at once
constexpr std::uint64_t same = 4242;  // seed of the environment that changes its place

std::vector<Model> scenes_and_random_models(int random_models) {
  std::vector<Model> models = {scenes::chain8(), scenes::gripper13(), scenes::chain32()};
  scenes::RandomOptions options;
  options.redundant = false;  // reduced refuses them under gear ratios per environment
  for (std::uint64_t seed = 0; seed < static_cast<std::uint64_t>(random_models); ++seed)
    models.push_back(scenes::random_model(seed, options));
  return models;
}

// Calls check(plan, scalar) for the scenes without and with bounds and random models, without and with all fields per
// environment, in single and double precision.
template <class Check>
void for_every_plan(Method method, int random_models, const std::vector<Model>& bounded, Check check) {
  std::vector<Model> models = scenes_and_random_models(random_models);
  for (const Model& model : bounded) models.push_back(model);
  for (const Model& model : models)
    for (const ParameterSet& fields : {ParameterSet{}, contract::all_parameters(method, model)}) {
      SCOPED_TRACE(model.name + (fields.empty() ? "" : " with all fields"));
      StepSettings settings = contract::settings(method, fields);
      settings.record_impulses = !fields.empty();  // without, direct prescribes speeds
      const Plan plan = compile(model, settings);
      check(plan, float());
      check(plan, double());
      if (testing::Test::HasFailure()) return;
    }
}

class Determinism : public testing::TestWithParam<Method> {};

TEST_P(Determinism, wide_kernels_and_their_scalar_twins_agree_to_the_last_bit) {
  for_every_plan(GetParam(), 30, contract::bounded_scenes(), [](const Plan& plan, auto scalar) {
    for (const auto& [narrow, all_wide] : classes) {
      if (!supported(narrow)) continue;
      auto b = scattered<decltype(scalar)>(plan, 19, {.threads = 1, .target = narrow});
      b.step(5);
      for (Target wide : all_wide) {
        if (!supported(wide)) continue;
        auto a = scattered<decltype(scalar)>(plan, 19, {.threads = 1, .target = wide});
        a.step(5);
        EXPECT_TRUE(same_bits(a, b)) << to_string(wide);
        if (!plan.settings().record_impulses) continue;
        EXPECT_TRUE((a.coupling_impulses() == b.coupling_impulses()).all()) << to_string(wide);
      }
    }
  });
}

TEST_P(Determinism, thread_count_does_not_change_a_bit) {
  for_every_plan(GetParam(), 2, contract::small_bounded_scenes(), [](const Plan& plan, auto scalar) {
    auto one = scattered<decltype(scalar)>(plan, a_task_each, serial);
    one.step(2);
    for (int threads : {0, 2, 3, 8}) {
      auto many = scattered<decltype(scalar)>(plan, a_task_each, {.threads = threads});
      many.step(2);
      EXPECT_TRUE(same_bits(one, many)) << threads << " threads";
    }
  });
}

TEST_P(Determinism, batch_size_does_not_change_a_bit) {
  for_every_plan(GetParam(), 2, contract::small_bounded_scenes(), [](const Plan& plan, auto scalar) {
    auto largest = scattered<decltype(scalar)>(plan, 4096);
    largest.step(2);
    for (int environments : {1, 7, 9}) {
      auto batch = scattered<decltype(scalar)>(plan, environments);
      batch.step(2);
      EXPECT_TRUE(same_bits(batch, largest)) << environments << " environments";
    }
  });
}

TEST_P(Determinism, place_in_the_batch_does_not_change_a_bit) {
  for_every_plan(GetParam(), 12, contract::bounded_scenes(), [](const Plan& plan, auto scalar) {
    using S = decltype(scalar);
    Batch<S> alone(plan, 1, serial);
    contract::scatter(alone, 0, same);
    alone.step(3);
    for (int place : places) {
      Batch<S> batch(plan, several, serial);
      for (int e = 0; e < several; ++e) contract::scatter(batch, e, e == place ? same : static_cast<std::uint64_t>(e));
      batch.step(3);
      EXPECT_TRUE(same_bits(batch, place, alone, 0));
    }
  });
}

TEST(InPlace, neighbours_that_are_not_do_not_change_a_bit) {
  int shorter = 0;
  for_every_plan(Method::reduced, 60, contract::bounded_scenes(), [&](const Plan& plan, auto scalar) {
    if (!program_of(plan).f64.reduction.consistent_is_shorter) return;
    contract::expect_the_same_bits_where_consistent<decltype(scalar)>(plan, several, serial);
    ++shorter;
  });
  EXPECT_GT(shorter, 100);
}

TEST_P(Determinism, twelve_steps_at_once_are_twelve_steps) {
  for_every_plan(GetParam(), 30, contract::bounded_scenes(), [](const Plan& plan, auto scalar) {
    auto once = scattered<decltype(scalar)>(plan, several), often = scattered<decltype(scalar)>(plan, several);
    once.step(12);
    for (int i = 0; i < 12; ++i) often.step();
    EXPECT_TRUE(same_bits(once, often));
    if (!plan.settings().record_impulses) return;
    EXPECT_TRUE((once.coupling_impulses() == often.coupling_impulses()).all());
  });
}

TEST_P(Determinism, a_neighbour_without_numbers_does_not_change_a_bit) {
  for_every_plan(GetParam(), 12, contract::bounded_scenes(), [](const Plan& plan, auto scalar) {
    using S = decltype(scalar);
    Batch<S> sound = scattered<S>(plan, several);
    sound.step(4);
    for (int sick : places) {
      Batch<S> batch = scattered<S>(plan, several);
      batch.positions().col(sick).setConstant(std::numeric_limits<S>::quiet_NaN());
      batch.velocities().col(sick).setConstant(std::numeric_limits<S>::infinity());
      batch.step(4);
      EXPECT_TRUE(same_bits(batch, sound, sick));
      EXPECT_EQ(batch.faulted(), sound.faulted() + (sound.faults()[sick] == Fault::none ? 1 : 0));
    }
  });
}

// One step in both classes from the model's state. A multiply-add that rounds once or twice is a matter of the last
// bit in each operation, and a solve with A, then with K + cfm, multiplies that by their condition (the same bound
// as in the reference's tests); the kernels' sums have some ten terms in each entry of A.
template <class S>
void expect_classes_agree(const Plan& plan) {
  Batch<S> fused(plan, 1, {.threads = 1, .target = Target::avx2});
  Batch<S> unfused(plan, 1, {.threads = 1, .target = Target::baseline});
  const reference::Mechanism mechanism(plan.model());
  const reference::Stage stage(mechanism, plan.settings().dt, mechanism.initial_state(), mechanism.initial_inputs());
  Eigen::MatrixXd k = stage.response;
  for (Eigen::Index r = 0; r < k.rows(); ++r) k(r, r) += stage.rows[static_cast<std::size_t>(r)].cfm;
  const double kappa = physics::condition(stage.implicit) * physics::condition(k);
  const double rounding = 10.0 * mechanism.velocities() * std::numeric_limits<S>::epsilon() * kappa;
  fused.step(), unfused.step();
  const reference::State a = physics::state_of(fused), b = physics::state_of(unfused);
  const double moving = std::max(1.0, physics::size(stage.free));
  EXPECT_LE(physics::distance(a.v, b.v), rounding * moving);
  EXPECT_LE(physics::distance(a.q, b.q), rounding * moving);
  EXPECT_LE(physics::distance(a.position, b.position), rounding * moving);
  EXPECT_LE(physics::distance(a.orientation.coeffs(), b.orientation.coeffs()), rounding * moving);
}

TEST_P(Determinism, arithmetic_classes_agree_to_rounding) {
  if (!supported(Target::avx2)) GTEST_SKIP() << "this machine has no AVX2";
  for (const Model& model : scenes_and_random_models(60)) {
    SCOPED_TRACE(model.name);
    const Plan plan = compile(model, contract::settings(GetParam()));
    expect_classes_agree<float>(plan);
    expect_classes_agree<double>(plan);
  }
}

INSTANTIATE_TEST_SUITE_P(method, Determinism, testing::ValuesIn(physics::methods), physics::method_name);

}  // namespace
}  // namespace lockstep
