// Generated kernels and compiled steps keep the promises of the tables. SPDX-License-Identifier: Apache-2.0
#include <limits>
#include <sstream>

#include "contract.h"
#include "contract/allocation_counter.h"
#include "plan/program.h"
#include "plans.h"
#include "targets/registry.h"
#include "trace/trace.h"

namespace lockstep {
namespace {

using contract::same_bits;
using contract::scattered;

constexpr Target targets[] = {Target::baseline, Target::avx2, Target::avx512, Target::neon};

struct StepCase {
  std::string plan;
  Engine engine;
};
std::ostream& operator<<(std::ostream& out, const StepCase& step) {
  return out << step.plan << ", " << to_string(step.engine);
}

std::vector<StepCase> all_steps() {
  std::vector<StepCase> all;
  std::stringstream kernels(LOCKSTEP_KERNELS);
  for (std::string name; std::getline(kernels, name, ',');) {
    all.push_back({name, Engine::generated});
    if (!name.ends_with("_bounds"))  // these have limited servos, which machine code refuses
      all.push_back({name, Engine::compiled});
  }
  // The method depends on the seed modulo 4: reduced, direct, pgs, tgs. Not all methods allow all integrators.
  const std::vector<std::vector<const char*>> more = {{"", "_fields", "_leapfrog", "_leapfrog_fields", "_extrapolated"},
                                                      {"", "_fields", "_leapfrog", "_extrapolated"},
                                                      {"", "_fields"},
                                                      {"", "_fields"}};
  for (int seed = 10; seed < 40; ++seed)
    for (const char* what : more[static_cast<std::size_t>(seed % 4)])
      all.push_back({"random_" + std::to_string(seed) + what, Engine::compiled});
  for (int seed = 8; seed < 32; seed += 4)
    for (const char* what : {"_tendons", "_tendons_fields", "_tendons_leapfrog", "_tendons_limits"})
      all.push_back({"random_" + std::to_string(seed) + what, Engine::compiled});
  all.push_back({"chain8_reduced_soft", Engine::compiled});
  for (int seed = 10; seed < 30; ++seed) all.push_back({"forest_" + std::to_string(seed), Engine::compiled});
  for (int seed = 40; seed < 60; ++seed)
    all.push_back({"random_" + std::to_string(seed) + "_limits", Engine::compiled});
  for (int seed = 40; seed < 100; ++seed)
    for (const char* what : {"_limits_efforts", "_limits_leapfrog", "_limits_efforts_leapfrog"})
      if (const std::string plan = "random_" + std::to_string(seed) + what;
          seed % 4 < 2 && trace::traces_bounds(program_of(generated::plan_of(plan)).f64))
        all.push_back({plan, Engine::compiled});
  return all;
}

class StraightLineStep : public testing::TestWithParam<StepCase> {
 protected:
  const Plan plan = generated::plan_of(GetParam().plan);
  // 19 environments fill tiles of 4, 8 and 16 lanes and begin another. 189 fill an odd number of tiles. Random limits
  // get 19: with more, rounding decides in some environment whether limits contradict each other, and there not even
  // the tables of two targets agree.
  const int several =
      GetParam().engine == Engine::compiled && GetParam().plan.find("_limits") == std::string::npos ? 189 : 19;

  bool is_compiled_for(Target target) const {
    return plan.describe().find(GetParam().plan + " for " + to_string(target) + " in f64") != std::string::npos;
  }

  static bool has_machine_code(Target target) { return target == Target::avx2 || target == Target::avx512; }

  // Calls check(options, scalar) in both precisions for every target that this machine has and the plan has a kernel
  // for.
  template <class Check>
  void for_every_kernel(Check check) {
    for (const Target target : targets) {
      const Engine engine = GetParam().engine;
      if (!supported(target) || (engine == Engine::generated ? !is_compiled_for(target) : !has_machine_code(target)))
        continue;
      SCOPED_TRACE(to_string(target));
      const BatchOptions options{.threads = 1, .target = target, .engine = engine};
      check(options, float());
      check(options, double());
    }
  }
};

TEST_P(StraightLineStep, runs_and_is_named_in_the_description) {
  for_every_kernel([&](const BatchOptions& options, auto scalar) {
    const Batch<decltype(scalar)> batch(plan, 1, options);
    EXPECT_EQ(batch.engine(), options.engine);
    EXPECT_EQ(batch.kernel_name(), options.engine == Engine::generated ? GetParam().plan : "");
  });
  if (GetParam().engine == Engine::generated) {
    EXPECT_TRUE(is_compiled_for(Target::avx2) || is_compiled_for(Target::neon)) << plan.describe();
  }
}

// The graph decides how each operation rounds. Neither registers nor their order may change a bit.
TEST_P(StraightLineStep, has_the_bits_of_generated_code_by_machine_code) {
  if (GetParam().engine != Engine::generated || GetParam().plan.ends_with("_bounds")) GTEST_SKIP();
  for_every_kernel([&](BatchOptions options, auto scalar) {
    if (!has_machine_code(options.target)) return;
    Batch<decltype(scalar)> generated = scattered<decltype(scalar)>(plan, several, options);
    options.engine = Engine::compiled;
    Batch<decltype(scalar)> compiled = scattered<decltype(scalar)>(plan, several, options);
    generated.positions()(0, 3) = compiled.positions()(0, 3) = std::numeric_limits<decltype(scalar)>::infinity();
    for (int call = 0; call < 6; ++call) {
      generated.step(5), compiled.step(5);
      for (int e = 0; e < several; ++e) EXPECT_TRUE(same_bits(generated, e, compiled, e)) << e;
      if (HasFailure()) return;
    }
  });
}

// Rounding hardly grows in one step, but some steps are ill-conditioned. The difference between fused and unfused
// tables shows how far rounding moves an environment.
TEST_P(StraightLineStep, agrees_with_the_tables_to_rounding) {
  for_every_kernel([&](BatchOptions options, auto scalar) {
    using S = decltype(scalar);
    const auto stepped = [&](bool by_tables, Target target) {
      Batch<S> batch = scattered<S>(
          plan, several, {.threads = 1, .target = target, .engine = by_tables ? Engine::tables : options.engine});
      batch.step();
      return batch;
    };
    const Batch<S> straight = stepped(false, options.target), tables = stepped(true, options.target);
    const Target other = supported(Target::neon) ? twins::neon_scalar : twins::avx2_scalar;
    const Batch<S> others =
        stepped(true, options.target == Target::baseline && supported(other) ? other : Target::baseline);
    EXPECT_EQ(straight.faulted(), tables.faulted());
    const auto agree = [&](const auto& a, const auto& b, const auto& c, const char* what) {
      for (int e = 0; e < several && a.rows() > 0; ++e) {
        const double size = std::max(1.0, static_cast<double>(b.col(e).abs().maxCoeff()));
        const double rounding = size * 200 * static_cast<double>(std::numeric_limits<S>::epsilon()) +
                                20 * static_cast<double>((c.col(e) - b.col(e)).abs().maxCoeff());
        EXPECT_LE(static_cast<double>((a.col(e) - b.col(e)).abs().maxCoeff()), rounding)
            << what << " of environment " << e;
      }
    };
    agree(straight.positions(), tables.positions(), others.positions(), "positions");
    agree(straight.velocities(), tables.velocities(), others.velocities(), "velocities");
    agree(straight.root_poses(), tables.root_poses(), others.root_poses(), "root poses");
    agree(straight.root_velocities(), tables.root_velocities(), others.root_velocities(), "root velocities");
    if (plan.settings().record_impulses)
      agree(straight.coupling_impulses(), tables.coupling_impulses(), others.coupling_impulses(), "impulses");
  });
}

TEST_P(StraightLineStep, gives_the_same_bits_in_any_batch_and_place) {
  for_every_kernel([&](const BatchOptions& options, auto scalar) {
    using S = decltype(scalar);
    Batch<S> many = scattered<S>(plan, several, options), one_by_one = scattered<S>(plan, several, options);
    many.step(6);
    for (int i = 0; i < 6; ++i) one_by_one.step();
    EXPECT_TRUE(same_bits(many, one_by_one));
    BatchOptions two_threads = options;
    two_threads.threads = 2;
    Batch<S> shared_out = scattered<S>(plan, several, two_threads);
    shared_out.step(6);
    EXPECT_TRUE(same_bits(many, shared_out));
    for (const int place : {0, 5, several - 1}) {
      Batch<S> single(plan, 1, options);
      contract::scatter(single, 0, static_cast<std::uint64_t>(place));
      single.step(6);
      EXPECT_TRUE(same_bits(many, place, single, 0));
    }
  });
}

TEST_P(StraightLineStep, gives_the_same_bits_where_followers_are_consistent) {
  if (!program_of(plan).f64.reduction.consistent_is_shorter) return;
  for_every_kernel([&](const BatchOptions& options, auto scalar) {
    contract::expect_the_same_bits_where_consistent<decltype(scalar)>(plan, several, options);
  });
}

TEST_P(StraightLineStep, freezes_a_failed_environment_and_keeps_the_bits_of_its_neighbours) {
  for_every_kernel([&](const BatchOptions& options, auto scalar) {
    using S = decltype(scalar);
    Batch<S> sound = scattered<S>(plan, several, options), damaged = scattered<S>(plan, several, options);
    const int joint = contract::first_joint(plan);
    damaged.velocities()(joint, 3) = std::numeric_limits<S>::quiet_NaN();
    damaged.positions()(joint, 9) = std::numeric_limits<S>::infinity();
    sound.step(3), damaged.step(3);
    EXPECT_EQ(damaged.faults()[3], Fault::not_finite);
    EXPECT_EQ(damaged.faults()[9], Fault::not_finite);
    EXPECT_TRUE(std::isnan(damaged.velocities()(joint, 3)));
    for (int e = 0; e < several; ++e)
      if (e != 3 && e != 9) {
        EXPECT_TRUE(same_bits(sound, e, damaged, e));
      }
  });
}

// An environment without active bounds keeps the unbounded result, also if its neighbours have active bounds.
TEST_P(StraightLineStep, keeps_its_bits_beside_neighbours_beyond_their_limits) {
  if (program_of(plan).f64.bounds.rows.count == 0) return;
  for_every_kernel([&](const BatchOptions& options, auto scalar) {
    using S = decltype(scalar);
    Batch<S> sound = scattered<S>(plan, several, options), displaced = scattered<S>(plan, several, options);
    displaced.positions().col(3) += S(2);
    sound.step(), displaced.step();
    for (int e = 0; e < several; ++e)
      if (e != 3) {
        EXPECT_TRUE(same_bits(sound, e, displaced, e)) << e;
      }
  });
}

TEST_P(StraightLineStep, allocates_nothing_with_one_thread) {
  for_every_kernel([&](const BatchOptions& options, auto scalar) {
    auto batch = scattered<decltype(scalar)>(plan, several, options);
    const std::size_t before = contract::allocations();
    batch.step(3);
    EXPECT_EQ(contract::allocations() - before, 0u);
  });
}

INSTANTIATE_TEST_SUITE_P(plan, StraightLineStep, testing::ValuesIn(all_steps()), [](const auto& info) {
  return info.param.plan + (info.param.engine == Engine::compiled ? "_compiled" : "");
});

TEST(GeneratedKernel, is_not_used_for_another_plan) {
  Model model = generated::plan_of("chain8_reduced").model();
  model.links.back().inertia.mass *= 1.01;
  const Plan plan = compile(model, generated::plan_of("chain8_reduced").settings());
  EXPECT_NE(kernel_hash(plan), kernel_hash(generated::plan_of("chain8_reduced")));
  EXPECT_EQ(Batch<float>(plan, 1).engine(), Engine::compiled);
}

TEST(GeneratedKernel, has_a_hash_of_what_a_step_does_and_of_nothing_else) {
  Model model = generated::plan_of("chain8_reduced").model();
  const StepSettings settings = generated::plan_of("chain8_reduced").settings();
  const std::uint64_t hash = kernel_hash(compile(model, settings));
  model.joints[0].position += 0.1;  // where environments begin
  model.name = "another";
  EXPECT_EQ(kernel_hash(compile(model, settings)), hash);
  StepSettings other = settings;
  other.dt *= 2;
  EXPECT_NE(kernel_hash(compile(model, other)), hash);
  other = settings;
  other.per_environment.insert(Parameter::damping);
  EXPECT_NE(kernel_hash(compile(model, other)), hash);
}

// Couplings lock some joints of this model, so their velocities are constants in the trace.
TEST(Compiled, agrees_with_the_tables_where_couplings_lock_joints) {
  const Plan plan = compile(scenes::random_model(14), {.method = Method::reduced, .integrator = Integrator::euler});
  Batch<double> compiled(plan, 3, {.threads = 1, .engine = Engine::compiled}),
      tables(plan, 3, {.threads = 1, .engine = Engine::tables});
  ASSERT_EQ(compiled.engine(), Engine::compiled);
  compiled.step(2), tables.step(2);
  EXPECT_EQ(compiled.faulted(), 0);
  EXPECT_LT((compiled.velocities() - tables.velocities()).abs().maxCoeff(), 1e-9);
  EXPECT_GT((tables.velocities().col(0) == 0.0).count(), 3) << "no joints are locked";
}

TEST(Compiled, keeps_the_bits_of_environments_beside_one_beyond_its_limit) {
  Model model = scenes::chain8();
  for (Joint& joint : model.joints) joint.upper = 3.0;
  for (const Method method : {Method::reduced, Method::direct, Method::pgs, Method::tgs}) {
    const Plan plan = compile(model, {.method = method, .integrator = Integrator::euler});
    Batch<float> free = scattered<float>(plan, 19, {.threads = 1, .engine = Engine::compiled});
    Batch<float> beside = scattered<float>(plan, 19, {.threads = 1, .engine = Engine::compiled});
    ASSERT_EQ(free.engine(), Engine::compiled);
    beside.positions().col(3) += 4.0f;
    Model unlimited = model;
    for (Joint& joint : unlimited.joints) joint.upper = infinity;
    Batch<float> unbounded =
        scattered<float>(compile(unlimited, plan.settings()), 19, {.threads = 1, .engine = Engine::compiled});
    unbounded.positions().col(3) += 4.0f;
    free.step(), beside.step(), unbounded.step();
    EXPECT_FALSE(same_bits(beside, 3, unbounded, 3)) << "no limit is active";
    for (int e = 0; e < 19; ++e)
      if (e != 3) {
        EXPECT_TRUE(same_bits(free, e, beside, e)) << to_string(method);
      }
  }
}

// Where bounds are active, each tile uses its own couplings, masses and states, and its own followers decide
// whether it is consistent.
TEST(Compiled, reads_the_numbers_of_the_right_tile_where_bounds_are_active) {
  Model model = scenes::chain8();
  for (Joint& joint : model.joints) joint.lower = -0.35, joint.upper = 0.35;
  for (const ParameterSet& fields : {ParameterSet{}, {Parameter::offset, Parameter::mass}, {Parameter::gear_ratio}})
    for (const Method method : {Method::reduced, Method::direct}) {
      SCOPED_TRACE(testing::Message() << to_string(method) << (fields.contains(Parameter::mass) ? ", masses" : "")
                                      << (fields.contains(Parameter::gear_ratio) ? ", gear ratios" : ""));
      const Plan plan = compile(model, {.method = method, .integrator = Integrator::euler, .per_environment = fields});
      auto compiled = scattered<double>(plan, 40, {.threads = 1, .engine = Engine::compiled});
      auto tables = scattered<double>(plan, 40, {.threads = 1, .engine = Engine::tables});
      ASSERT_EQ(compiled.engine(), Engine::compiled);
      const Batch<double>::Array before = tables.positions();
      compiled.step(5), tables.step(5);
      EXPECT_LT((compiled.velocities() - tables.velocities()).abs().maxCoeff(), 1e-7);
      EXPECT_GT((before - tables.positions()).abs().maxCoeff(), 1e-3);
    }
}

// Two couplings with different ratios lock a pair of joints beside the chain, so no step reads their velocities.
TEST(Compiled, keeps_the_velocities_of_locked_joints_in_a_frozen_environment) {
  Model model = scenes::chain8();
  for (const char* name : {"a", "b"}) {
    Link link = model.links.back();
    Joint joint = model.joints.back();
    link.name = joint.child = joint.name = name;
    joint.parent = name[0] == 'a' ? "base" : "a";
    model.links.push_back(link);
    model.joints.push_back(joint);
  }
  model.couplings.push_back(Coupling::mimic("a", "b", -2.0));
  model.couplings.push_back(Coupling::mimic("a", "b", -3.0));
  const Plan plan = compile(model, {.method = Method::reduced, .integrator = Integrator::euler});
  Batch<float> batch = scattered<float>(plan, 40, {.threads = 1, .engine = Engine::compiled});
  ASSERT_EQ(batch.engine(), Engine::compiled);
  batch.positions()(0, 1) = std::numeric_limits<float>::quiet_NaN();
  const Batch<float>::Array before = batch.velocities();
  batch.step(2);
  EXPECT_NE(batch.faults()[1], Fault::none);
  EXPECT_TRUE((batch.velocities().col(1) == before.col(1)).all()) << batch.velocities().col(1).transpose();
}

TEST(Compiled, is_refused_for_limited_servos_in_sweeps_and_for_a_softness_per_environment_in_tgs) {
  const Plan limited = generated::plan_of("chain8_pgs_bounds");
  EXPECT_THROW(Batch<float>(limited, 1, {.engine = Engine::compiled}), SettingsError);
  StepSettings settings;
  settings.method = Method::tgs;
  settings.per_environment.insert(Parameter::softness);  // tgs solves these lane by lane
  EXPECT_THROW(Batch<float>(compile(scenes::chain8(), settings), 1, {.engine = Engine::compiled}), SettingsError);
  EXPECT_EQ(Batch<float>(compile(scenes::chain8(), settings), 1).engine(), Engine::tables);
}

// Two calls of lockstep_add_kernel() can make one kernel for each precision of one plan.
TEST(GeneratedKernel, is_found_in_either_precision) {
  const Plan plan = compile(scenes::chain8(), {.dt = 1.0 / 777.0, .method = Method::reduced});
  const std::uint64_t hash = kernel_hash(plan);
  const GeneratedKernel kernel = {"one", version(), "baseline", hash, {}, {}, 1, 0};
  static GeneratedKernel kernels[] = {kernel, kernel};
  kernels[0].f32 = [](const Tables<float>&, const StatePointers<float>&, std::ptrdiff_t, std::ptrdiff_t, int, void*) {};
  kernels[1].f64 = [](const Tables<double>&, const StatePointers<double>&, std::ptrdiff_t, std::ptrdiff_t, int, void*) {
  };
  for (const GeneratedKernel& each : kernels) register_kernel(each);
  EXPECT_EQ(find_kernel<float>(hash, Target::baseline), &kernels[0]);
  EXPECT_EQ(find_kernel<double>(hash, Target::baseline), &kernels[1]);
  EXPECT_EQ(Batch<float>(plan, 1, {.target = Target::baseline}).engine(), Engine::generated);
  EXPECT_EQ(Batch<double>(plan, 1, {.target = Target::baseline}).engine(), Engine::generated);
}

TEST(GeneratedKernel, is_refused_for_plans_that_are_solved_lane_by_lane) {
  Model model = scenes::chain8();
  StepSettings settings;
  settings.method = Method::tgs;
  settings.per_environment.insert(Parameter::softness);
  const Plan plan = compile(model, settings);
  EXPECT_EQ(kernel_hash(plan), 0u);
  EXPECT_THROW(generate_kernel(plan), SettingsError);
  EXPECT_NE(plan.describe().find("lane by lane"), std::string::npos);
}

}  // namespace
}  // namespace lockstep
