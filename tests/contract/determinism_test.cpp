// The same bits for any thread count, batch size, place and neighbour. SPDX-License-Identifier: Apache-2.0
//
// Every test compares bits, except the one of fused and unfused targets: these agree to rounding.
#include <cmath>
#include <limits>

#include "batch/engine.h"
#include "bounded_scenes.h"
#include "plan/program.h"
#include "reference/random_bounds.h"
#include "reference/step.h"

namespace lockstep {
namespace {

using contract::same_bits;
using contract::scattered;
using contract::serial;

struct ArithmeticClass {  // targets that give the same bits
  Target twin;
  std::vector<Target> wide;
};
const ArithmeticClass classes[] = {{twins::baseline_scalar, {Target::baseline}},
                                   {twins::avx2_scalar, {Target::avx2, Target::avx512}},
                                   {twins::neon_scalar, {Target::neon}}};
constexpr int several = 17;  // one more than the lanes of the widest tile
constexpr int places[] = {0, 3, 7, 8, 12, 15, 16};
constexpr int many_tasks = 2100;      // environments: their cache lines, the smallest tasks, occupy eight threads
constexpr std::uint64_t same = 4242;  // seed of the environment that changes its place

std::vector<Model> scenes_and_random_models(int random_models) {
  std::vector<Model> models = {scenes::chain8(), scenes::gripper13(), scenes::chain32()};
  scenes::RandomOptions options;
  options.redundant = false;  // reduced refuses redundant couplings with gear ratios per environment
  for (std::uint64_t seed = 0; seed < static_cast<std::uint64_t>(random_models); ++seed)
    models.push_back(scenes::random_model(seed, options));
  return models;
}

// With and without bounds. Other methods refuse them.
std::vector<Model> models_with_tendons() {
  scenes::RandomOptions options;
  options.redundant = false, options.springs = true, options.max_dofs = 10, options.max_tendons = 3;
  std::vector<Model> models;
  for (std::uint64_t seed = 0; seed < 6; ++seed) {
    models.push_back(scenes::random_model(seed, options));
    models.push_back(physics::random_bounds(seed, 1.0 / 240, options));
  }
  return models;
}

// Calls check(plan, scalar) for scenes, bounded scenes and random models, without and with all parameters per
// environment, in single and double precision.
template <class Check>
void for_every_plan(Method method, int random_models, const std::vector<Model>& bounded, Check check) {
  std::vector<Model> models = scenes_and_random_models(random_models);
  for (const Model& model : bounded) models.push_back(model);
  if (method == Method::reduced)
    for (const Model& model : models_with_tendons()) models.push_back(model);
  for (const Model& model : models)
    for (const ParameterSet& fields : {ParameterSet{}, contract::all_parameters(method, model)}) {
      SCOPED_TRACE(model.name + (fields.empty() ? "" : " with all parameters"));
      StepSettings settings = contract::settings(method, fields);
      settings.record_impulses = !fields.empty();  // without them, direct takes constraint velocities as known
      const Plan plan = compile(model, settings);
      check(plan, float());
      check(plan, double());
      if (testing::Test::HasFailure()) return;
    }
}

class Determinism : public testing::TestWithParam<Method> {};

TEST_P(Determinism, wide_kernels_and_their_scalar_twins_agree_to_the_last_bit) {
  for_every_plan(GetParam(), 30, contract::bounded_scenes(), [](const Plan& plan, auto scalar) {
    for (const auto& [twin, all_wide] : classes) {
      if (!supported(twin)) continue;
      auto b = scattered<decltype(scalar)>(plan, 19, {.threads = 1, .target = twin, .engine = Engine::tables});
      b.step(5);
      for (Target wide : all_wide) {
        if (!supported(wide)) continue;
        auto a = scattered<decltype(scalar)>(plan, 19, {.threads = 1, .target = wide, .engine = Engine::tables});
        a.step(5);
        EXPECT_TRUE(same_bits(a, b)) << to_string(wide);
        if (!plan.settings().record_impulses) continue;
        EXPECT_TRUE((a.coupling_impulses() == b.coupling_impulses()).all()) << to_string(wide);
      }
    }
  });
}

TEST_P(Determinism, machine_code_for_avx2_and_avx512_agrees_to_the_last_bit) {
  if (!supported(Target::avx2) || !supported(Target::avx512)) GTEST_SKIP();
  int compared = 0;
  for_every_plan(GetParam(), 30, contract::bounded_scenes(), [&](const Plan& plan, auto scalar) {
    using S = decltype(scalar);
    if (!code_obstacle<S>(plan, Target::avx2).empty()) return;
    const auto stepped = [&](Target target) {
      auto batch = scattered<S>(plan, 19, {.threads = 1, .target = target, .engine = Engine::compiled});
      batch.step(5);
      return batch;
    };
    EXPECT_TRUE(same_bits(stepped(Target::avx2), stepped(Target::avx512)));
    ++compared;
  });
  EXPECT_GT(compared, 30);
}

TEST_P(Determinism, thread_count_does_not_change_a_bit) {
  for_every_plan(GetParam(), 2, contract::small_bounded_scenes(), [](const Plan& plan, auto scalar) {
    auto one = scattered<decltype(scalar)>(plan, many_tasks, serial);
    one.step(2);
    for (int threads : {0, 2, 3, 8}) {
      auto many = scattered<decltype(scalar)>(plan, many_tasks, {.threads = threads});
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
    Batch<S> single(plan, 1, serial);
    contract::scatter(single, 0, same);
    single.step(3);
    for (int place : places) {
      Batch<S> batch(plan, several, serial);
      for (int e = 0; e < several; ++e) contract::scatter(batch, e, e == place ? same : static_cast<std::uint64_t>(e));
      batch.step(3);
      EXPECT_TRUE(same_bits(batch, place, single, 0));
    }
  });
}

TEST(ConsistentFollowers, keep_their_bits_beside_inconsistent_neighbours) {
  int shorter = 0;
  for_every_plan(Method::reduced, 60, contract::bounded_scenes(), [&](const Plan& plan, auto scalar) {
    if (!program_of(plan).f64.reduction.consistent_is_shorter) return;
    contract::expect_the_same_bits_where_consistent<decltype(scalar)>(plan, several, serial);
    ++shorter;
  });
  EXPECT_GT(shorter, 100);
}

// Machine code takes two tiles through the parts of a long step together.
TEST(ConsistentFollowers, keep_their_bits_beside_an_inconsistent_tile_of_a_long_step) {
  Model limited = scenes::chain32();
  for (Joint& joint : limited.joints) joint.lower = -0.5, joint.upper = 0.5;
  for (const Model& model : {scenes::chain32(), limited}) {
    const Plan plan = compile(model, {.method = Method::reduced, .integrator = Integrator::euler});
    contract::expect_the_same_bits_where_consistent<float>(plan, 40, serial);
    contract::expect_the_same_bits_where_consistent<double>(plan, 40, serial);
  }
}

TEST_P(Determinism, one_call_of_twelve_substeps_gives_the_bits_of_twelve_calls) {
  for_every_plan(GetParam(), 30, contract::bounded_scenes(), [](const Plan& plan, auto scalar) {
    auto once = scattered<decltype(scalar)>(plan, several), often = scattered<decltype(scalar)>(plan, several);
    once.step(12);
    for (int i = 0; i < 12; ++i) often.step();
    EXPECT_TRUE(same_bits(once, often));
    if (!plan.settings().record_impulses) return;
    EXPECT_TRUE((once.coupling_impulses() == often.coupling_impulses()).all());
  });
}

TEST_P(Determinism, a_neighbour_with_nan_does_not_change_a_bit) {
  for_every_plan(GetParam(), 12, contract::bounded_scenes(), [](const Plan& plan, auto scalar) {
    using S = decltype(scalar);
    Batch<S> sound = scattered<S>(plan, several);
    sound.step(4);
    for (int damaged : places) {
      Batch<S> batch = scattered<S>(plan, several);
      batch.positions().col(damaged).setConstant(std::numeric_limits<S>::quiet_NaN());
      batch.velocities().col(damaged).setConstant(std::numeric_limits<S>::infinity());
      batch.step(4);
      EXPECT_TRUE(same_bits(batch, sound, damaged));
      EXPECT_EQ(batch.faulted(), sound.faulted() + (sound.faults()[damaged] == Fault::none ? 1 : 0));
    }
  });
}

// Takes one step on both targets from the model's state. Whether a multiply-add rounds once or twice changes the last
// bit of an operation. The solves with A and with K + cfm amplify that by their condition numbers, as in the tests of
// the reference. The factor 10 is for the sums of about ten terms in each entry of A.
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
  physics::expect_same_poses(a, b, rounding * moving);
}

TEST_P(Determinism, fused_and_unfused_targets_agree_to_rounding) {
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
