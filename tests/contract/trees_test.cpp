// Several trees in a Model: each steps as it does alone. SPDX-License-Identifier: Apache-2.0
#include <string>
#include <vector>

#include "contract.h"
#include "plan/program.h"

namespace lockstep {
namespace {

using Eigen::Vector3d;

// Puts the trees of several models into one. Names begin with the number of the part.
Model together(const std::vector<Model>& parts) {
  Model all;
  all.name = "together";
  all.gravity = parts[0].gravity;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    Model part = parts[i];
    const auto rename = [&](std::string& name) { name = physics::numbered("", i).append(".").append(name); };
    if (part.roots.empty()) part.roots = {{part.links[0].name}};
    for (Link& link : part.links) rename(link.name);
    for (Root& root : part.roots) rename(root.link);
    for (Joint& joint : part.joints) rename(joint.name), rename(joint.parent), rename(joint.child);
    for (Coupling& coupling : part.couplings) {
      rename(coupling.joint);
      for (CouplingTerm& term : coupling.terms) rename(term.joint);
    }
    all.links.insert(all.links.end(), part.links.begin(), part.links.end());
    all.joints.insert(all.joints.end(), part.joints.begin(), part.joints.end());
    all.couplings.insert(all.couplings.end(), part.couplings.begin(), part.couplings.end());
    all.roots.insert(all.roots.end(), part.roots.begin(), part.roots.end());
  }
  return all;
}

Model box(const Vector3d& spin) {
  Model model;
  model.links = {{"box", Inertia::box(0.3, {0.1, 0.2, 0.05}, {0.01, 0.0, 0.02})}};
  model.roots = {{"box", true}};
  model.roots[0].pose.translation() = Vector3d(0.2, -0.1, 1.0);
  model.roots[0].velocity << spin, 0.1, -0.2, 0.3;
  return model;
}

// Two boxes, a bolted arm and a floating one, in this order or the other way round. Some seeds have a long chain, which
// is stepped by articulated bodies where A is not needed.
std::vector<Model> parts(int seed, bool soft) {
  scenes::RandomOptions options;
  options.redundant = false,
  options.soft = soft ? scenes::RandomOptions::Soft::sometimes : scenes::RandomOptions::Soft::never;
  options.max_dofs = seed % 4 == 3 ? 20 : 9;
  std::vector<Model> all = {box({0.3, 4.0, -0.5}), box({0.0, 0.0, 0.0})};
  options.root = scenes::RandomOptions::Root::fixed;
  all.push_back(scenes::random_model(static_cast<std::uint64_t>(seed), options));
  options.root = scenes::RandomOptions::Root::floating;
  options.couplings = seed % 3 != 0;
  all.push_back(scenes::random_model(static_cast<std::uint64_t>(seed + 1000), options));
  if (seed % 4 == 2) all.push_back(scenes::chain32());
  for (Model& model : all) model.gravity = {0.4, -0.3, -9.81};
  if (seed % 2 == 1) std::reverse(all.begin(), all.end());
  return all;
}

// Expects each part's rows of a batch of all parts to have the bits of a batch of the part. The guard is off: it judges
// an environment as a whole.
template <class S>
void expect_the_bits_of_parts(const std::vector<Model>& models, StepSettings settings, const BatchOptions& options) {
  SCOPED_TRACE(testing::Message() << to_string(options.engine) << ", " << sizeof(S) << " bytes");
  settings.guard = infinity;
  constexpr int environments = 5;
  Batch<S> all(compile(together(models), settings), environments, options);
  int dof = 0, root = 0;
  std::vector<Batch<S>> alone;
  std::vector<std::array<int, 2>> first;  // by part: dof, root
  for (const Model& model : models) {
    alone.emplace_back(compile(model, settings), environments, options);
    first.push_back({dof, root});
    dof += static_cast<int>(alone.back().positions().rows());
    root += static_cast<int>(alone.back().root_poses().rows()) / 7;
  }
  const auto each = [&](const auto& act) {
    for (std::size_t i = 0; i < alone.size(); ++i) {
      const auto [d, r] = first[i];
      act(all.positions(), alone[i].positions(), d);
      act(all.velocities(), alone[i].velocities(), d);
      act(all.efforts(), alone[i].efforts(), d);
      act(all.root_poses(), alone[i].root_poses(), 7 * r);
      act(all.root_velocities(), alone[i].root_velocities(), 6 * r);
    }
  };
  contract::Random random(1);
  for (Batch<S>& batch : alone)
    for (auto view : {batch.positions(), batch.velocities(), batch.efforts(), batch.root_velocities()})
      for (auto& number : view.reshaped()) number += static_cast<S>(random.uniform(-0.1, 0.1));
  each([](auto of_all, auto own, int row) { of_all.middleRows(row, own.rows()) = own; });
  for (int step = 0; step < 12; ++step) {
    all.step();
    for (Batch<S>& batch : alone) batch.step();
    ASSERT_EQ(all.faulted(), 0);
    each([&](auto of_all, auto own, int row) {
      for (Eigen::Index i = 0; i < own.rows(); ++i)
        for (int e = 0; e < environments; ++e)
          ASSERT_EQ(of_all(row + i, e), own(i, e)) << "step " << step << ", row " << row + i << ", environment " << e;
    });
    if (testing::Test::HasFailure()) return;
  }
}

struct Case {
  Method method;
  Integrator integrator;
  bool soft;
};

class Trees : public testing::TestWithParam<Case> {};

TEST_P(Trees, step_with_the_bits_that_they_have_alone) {
  const auto [method, integrator, soft] = GetParam();
  StepSettings settings;
  settings.method = method, settings.integrator = integrator;
  int articulated = 0, columns = 0;
  for (int seed = 0; seed < 24; ++seed) {
    SCOPED_TRACE(seed);
    const std::vector<Model> models = parts(seed, soft);
    const Plan plan = compile(together(models), settings);
    const Tables<double>& t = program_of(plan).f64;
    const auto has = [&](InertiaKind kind) {
      for (int i = 0; i < t.tree.count; ++i)
        if (t.tree[i].inertia == kind) return true;
      return false;
    };
    articulated += has(InertiaKind::articulated_bodies) && t.factored.count > 0;
    columns += has(InertiaKind::composite_columns) && has(InertiaKind::matrix);
    const BatchOptions tables{.threads = 1, .engine = Engine::tables};
    expect_the_bits_of_parts<double>(models, settings, tables);
    if (HasFailure()) return;
    expect_the_bits_of_parts<float>(models, settings, tables);
    if (HasFailure()) return;
    if (seed % 4 != 0 || physics::engines(plan).size() < 2) continue;
    const BatchOptions by_code{.threads = 1, .engine = Engine::compiled};
    expect_the_bits_of_parts<double>(models, settings, by_code);
    expect_the_bits_of_parts<float>(models, settings, by_code);
    if (HasFailure()) return;
  }
  EXPECT_GT(articulated, 0);
  if (method == Method::reduced && integrator == Integrator::euler) {
    EXPECT_GT(columns, 0);
  }
}

INSTANTIATE_TEST_SUITE_P(
    method, Trees,
    testing::Values(Case{Method::reduced, Integrator::euler, false}, Case{Method::reduced, Integrator::euler, true},
                    Case{Method::direct, Integrator::euler, false}, Case{Method::direct, Integrator::euler, true},
                    Case{Method::pgs, Integrator::euler, true}, Case{Method::tgs, Integrator::euler, true},
                    Case{Method::reduced, Integrator::leapfrog, true}, Case{Method::direct, Integrator::leapfrog, true},
                    Case{Method::reduced, Integrator::extrapolated, true}),
    [](const auto& info) {
      return std::string(to_string(info.param.method)) + "_" + to_string(info.param.integrator) +
             (info.param.soft ? "_soft" : "");
    });

// A coupling joins the first two of three trees.
TEST(Trees, cost_no_row_of_other_trees) {
  Model model = together({scenes::chain8(), scenes::chain8(), scenes::chain8()});
  model.couplings = {Coupling::mimic("0.j3", "1.j4", 0.7)};
  const Plan plan = compile(model, {.method = Method::pgs, .integrator = Integrator::euler});
  const Tables<double>& t = program_of(plan).f64;
  ASSERT_EQ(t.rows.count, 1);
  for (int i = 0; i < t.rows.support.count; ++i)
    EXPECT_LT(t.rows.support[i].end, t.body[t.tree[2].first_body].velocity + 1);
}

TEST(Trees, have_rows_of_their_own_in_views) {
  const Plan plan = compile(together({box({0, 0, 0}), scenes::chain8(), scenes::chain32()}));
  EXPECT_EQ(plan.root_names(), (std::vector<std::string>{"0.box", "2.base"}));
  ASSERT_EQ(plan.trees().size(), 3u);
  EXPECT_EQ(plan.trees()[0].floating_root, 0);
  EXPECT_TRUE(plan.trees()[0].dofs.empty());
  EXPECT_EQ(plan.trees()[1].floating_root, -1);
  EXPECT_EQ(plan.trees()[1].dofs.front(), 0);
  EXPECT_EQ(plan.trees()[1].dofs.back(), 7);
  EXPECT_EQ(plan.trees()[2].root, "2.base");
  EXPECT_EQ(plan.trees()[2].floating_root, 1);
  EXPECT_EQ(plan.trees()[2].dofs.back(), 39);
  Batch<double> batch(plan, 3, {.threads = 1});
  EXPECT_EQ(batch.root_poses().rows(), 14);
  EXPECT_EQ(batch.root_velocities().rows(), 12);
  EXPECT_EQ(batch.root_poses()(2, 1), 1.0);
}

}  // namespace
}  // namespace lockstep
