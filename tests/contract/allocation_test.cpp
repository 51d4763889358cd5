// A step with one thread allocates nothing, and no step throws. SPDX-License-Identifier: Apache-2.0
#include <cstdlib>
#include <new>
#include <utility>

#include "allocation_counter.h"
#include "bounded_scenes.h"
#include "contact_scenes.h"
#include "reference/loop_models.h"

namespace lockstep {
namespace {

template <class Act>
std::size_t allocated_by(Act act) {
  const std::size_t before = contract::allocations();
  act();
  return contract::allocations() - before;
}

// Calls the operators directly, because a compiler may remove pairs of new- and delete-expressions.
TEST(AllocationCounter, counts_every_kind_of_allocation) {
  EXPECT_GT(allocated_by([] { ::operator delete(::operator new(8)); }), 0u);
  EXPECT_GT(allocated_by([] { ::operator delete(::operator new(8, std::nothrow)); }), 0u);
  constexpr std::align_val_t line{64};
  EXPECT_GT(allocated_by([&] { ::operator delete(::operator new(64, line), line); }), 0u);
  EXPECT_GT(allocated_by([] { ::operator delete[](::operator new[](8)); }), 0u);
#ifdef LOCKSTEP_COUNTS_MALLOC
  void* volatile block = nullptr;
  EXPECT_GT(allocated_by([&] { block = std::malloc(8); }), 0u);
  EXPECT_GT(allocated_by([&] { block = std::realloc(block, 4096); }), 0u);
  std::free(block);
  EXPECT_GT(allocated_by([&] { block = std::calloc(4, 4); }), 0u);
  std::free(block);
  EXPECT_GT(allocated_by([&] { block = std::aligned_alloc(64, 64); }), 0u);
  std::free(block);
#endif
  const Plan plan = compile(scenes::chain8());
  Batch<double> batch(plan, 4, {.threads = 1});
  EXPECT_GT(allocated_by([&] { batch.coupling_errors(); }), 0u) << "a readback must allocate its result";
}

class Allocation : public testing::TestWithParam<Method> {};

template <class S>
void expect_no_allocation(const Plan& plan, Target target) {
  Batch<S> batch(plan, 19, {.threads = 1, .target = target});
  for (int e = 0; e < batch.environments(); ++e) contract::scatter(batch, e, static_cast<std::uint64_t>(e));
  EXPECT_EQ(allocated_by([&] { batch.step(); }), 0u) << "the first step";
  EXPECT_EQ(allocated_by([&] { batch.step(4); }), 0u) << "later steps";
  batch.velocities().col(3).setConstant(std::numeric_limits<S>::quiet_NaN());
  EXPECT_EQ(allocated_by([&] { batch.step(2); }), 0u) << "a step that fails";
  EXPECT_GT(batch.faulted(), 0);
}

TEST(AllocationWithContacts, does_not_happen_in_a_step_and_a_readback) {
  const Model models[] = {contact_scenes::stack(10.0), contact_scenes::Grasp{}.model(), contact_scenes::quadruped()};
  for (const Model& model : models) {
    const Plan plan = compile(model);
    Batch<float> batch(plan, 19, {.threads = 1});
    const Query queries[] = {{Quantity::contact_point}, {Quantity::contact_force}};
    std::vector<float> numbers(static_cast<std::size_t>(plan.query_rows(queries[0]) + plan.query_rows(queries[1])) *
                               19);
    EXPECT_EQ(allocated_by([&] { batch.step(60); }), 0u) << model.name;
    EXPECT_EQ(allocated_by([&] { batch.read(queries, {numbers.data(), 19, 1}); }), 0u) << model.name;
    batch.root_velocities().col(3).setConstant(std::numeric_limits<float>::quiet_NaN());
    EXPECT_EQ(allocated_by([&] { batch.step(2); }), 0u) << model.name;
    EXPECT_GT(batch.faulted(), 0);
  }
}

TEST(AllocationWithLoops, does_not_happen_in_a_step_and_a_readback) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog})
    for (const Model& model : {loop_models::gripper(), loop_models::stewart()}) {
      const Plan plan = compile(model, {.integrator = integrator});
      Batch<float> batch(plan, 19, {.threads = 1});
      const Query queries[] = {{Quantity::loop_error}, {Quantity::loop_force}};
      int rows = 0;
      for (const Query& query : queries) rows += plan.query_rows(query);
      Batch<float>::Array numbers(rows, batch.environments());
      EXPECT_EQ(allocated_by([&] {
                  batch.step(20);
                  batch.read(queries, {numbers.data(), batch.environments(), 1});
                }),
                0u);
    }
}

TEST_P(Allocation, does_not_happen_in_a_step_with_one_thread) {
  scenes::RandomOptions options;
  options.redundant = false;
  std::vector<Model> models = {scenes::chain8(), scenes::gripper13(), scenes::chain32()};
  for (std::uint64_t seed = 0; seed < 10; ++seed) models.push_back(scenes::random_model(seed, options));
  for (Model& model : contract::bounded_scenes()) models.push_back(std::move(model));
  for (const Model& model : models)
    for (const ParameterSet& fields : {ParameterSet{}, contract::all_parameters(GetParam(), model)}) {
      SCOPED_TRACE(model.name);
      StepSettings settings = contract::settings(GetParam(), fields);
      settings.record_diagnostics = !fields.empty();
      const Plan plan = compile(model, settings);
      for (Target target : all_targets) {
        if (!supported(target)) continue;
        expect_no_allocation<float>(plan, target);
        expect_no_allocation<double>(plan, target);
      }
    }
}

TEST(AllocationOfIntegrators, does_not_happen_in_a_step_with_one_thread) {
  for (const Integrator integrator : {Integrator::leapfrog, Integrator::extrapolated, Integrator::runge_kutta})
    for (const Model& model : {scenes::chain8(), scenes::chain32()}) {
      SCOPED_TRACE(to_string(integrator));
      const Plan plan = compile(model, {.dt = 1.0 / 480, .integrator = integrator, .stage_inputs = true});
      expect_no_allocation<float>(plan, Target::automatic);
      expect_no_allocation<double>(plan, Target::automatic);
    }
}

TEST_P(Allocation, does_not_happen_in_resets_and_views) {
  Batch<float> batch(compile(scenes::chain32(), contract::settings(GetParam())), 19, {.threads = 1});
  const int ids[] = {3, 5, 18};
  const bool mask[19] = {true, false, true};
  EXPECT_EQ(allocated_by([&] {
              batch.reset();
              batch.reset(ids);
              batch.reset(mask);
              batch.positions().row(2) = 0.25f;
              batch.root_poses().row(0) += 1.0f;
              batch.faults();
              batch.faulted();
            }),
            0u);
}

TEST_P(Allocation, does_not_happen_where_followers_are_placed) {
  Batch<float> batch(compile(scenes::chain32(), contract::settings(GetParam())), 19, {.threads = 1});
  batch.positions().setConstant(0.2f);
  EXPECT_EQ(allocated_by([&] { batch.project(EnvironmentSet::all(), Couplings::all); }), 0u);
  const int ids[] = {3, 5};
  const Batch<float>::Array state = Batch<float>::Array::Constant(32, 2, 0.1f);
  EXPECT_EQ(allocated_by([&] { batch.reset(ids, state, state); }), 0u);
}

TEST_P(Allocation, does_not_happen_in_draws_actions_and_queries_with_one_thread) {
  Model model = scenes::gripper13();
  model.add_site("tip", model.links.back().name);
  const Plan plan = compile(model, contract::settings(GetParam()));
  Batch<float> batch(plan, 19, {.threads = 1});
  const std::vector<Query> queries = {{Quantity::position},
                                      {Quantity::link_pose},
                                      {Quantity::site_velocity, {0}},
                                      {Quantity::coupling_error},
                                      {Quantity::kinetic_energy}};
  int rows = 0;
  for (const Query& query : queries) rows += plan.query_rows(query);
  std::vector<float> memory(static_cast<std::size_t>(rows) * 19);
  const StridedRows<float> out{memory.data(), 1, rows};
  const std::vector<double> low(plan.driven_dofs().size(), -1.0), high(plan.driven_dofs().size(), 1.0);
  const ActionMap map{ActionKind::position, low, high};
  const std::vector<int> places = {3, 5};
  PoseNoise noise;
  noise.position = 0.1, noise.roots = {{.yaw = 1.0, .linear_velocity = 1.0}};
  EXPECT_EQ(allocated_by([&] {
              batch.draw(out, 40);
              batch.draw_normal(out, 40, 1, places);
              batch.set_actions({memory.data(), 1, rows}, map);
              batch.set_actions({memory.data(), 1, rows}, map, places);
              batch.reset_random(places, {.spread = 0.5, .speed = 0.1});
              batch.reset_to(places, -1, noise);
              batch.copy(3, places);
              batch.read(queries, out);
              batch.ids()[3] = 7;
            }),
            0u);
}

// The memory of threads is taken when a batch is made, where it can be refused.
TEST(Threads, take_no_memory_of_their_own_in_a_step) {
  const Plan plan = compile(scenes::chain8());
  Batch<float> batch(plan, 4096, {.threads = 2});
  contract::refuse_aligned(true);
  EXPECT_THROW(Batch<float>(plan, 4096, {.threads = 2}), std::bad_alloc);
  batch.step(8);
  contract::refuse_aligned(false);
  EXPECT_EQ(batch.faulted(), 0);
}

INSTANTIATE_TEST_SUITE_P(method, Allocation, testing::ValuesIn(physics::methods), physics::method_name);

static_assert(noexcept(std::declval<Batch<float>&>().step()));
static_assert(noexcept(std::declval<Batch<double>&>().step(12)));

TEST(Step, does_nothing_for_zero_or_negative_substeps) {
  const Plan plan = compile(scenes::gripper13());
  Batch<double> stepped = contract::scattered<double>(plan, 9), unstepped = contract::scattered<double>(plan, 9);
  for (int substeps : {0, -1, -12, std::numeric_limits<int>::min()}) {
    stepped.step(substeps);
    EXPECT_TRUE(contract::same_bits(stepped, unstepped)) << substeps;
  }
  stepped.step();
  EXPECT_FALSE(contract::same_bits(stepped, unstepped));
}

}  // namespace
}  // namespace lockstep
