// Active bounds change no bit of other environments, and recording changes no bit. SPDX-License-Identifier: Apache-2.0
#include <map>

#include "bounded_scenes.h"
#include "lockstep/error.h"

namespace lockstep {
namespace {

using contract::same_bits;
using contract::scattered;
using contract::serial;

constexpr int environments = 19;  // two full tiles of eight lanes and a part of a third
constexpr int steps = 50;

StepSettings recording(Method method, ParameterSet fields = {}) {
  StepSettings settings = contract::settings(method, fields);
  settings.record_diagnostics = true;
  return settings;
}

// Calls check(model, fields, scalar) for the bounded scenes, without and with all parameters per environment.
template <class Check>
void for_every_scene(Method method, Check check) {
  for (const Model& model : contract::bounded_scenes())
    for (const ParameterSet& fields : {ParameterSet{}, contract::all_parameters(method, model)}) {
      SCOPED_TRACE(model.name + (fields.empty() ? "" : " with all parameters"));
      check(model, fields, float());
      check(model, fields, double());
      if (testing::Test::HasFailure()) return;
    }
}

class BoundsContract : public testing::TestWithParam<Method> {};

// Compares each environment of a crowd with the same one in a batch of its own and among neighbours at rest. Half of
// the single ones run on the scalar twin, which has one lane; the others share their tile with padding.
TEST_P(BoundsContract, lanes_with_different_active_sets_do_not_change_a_bit) {
  for_every_scene(GetParam(), [](const Model& model, const ParameterSet& fields, auto scalar) {
    using S = decltype(scalar);
    const Plan plan = compile(model, contract::settings(GetParam(), fields));
    Batch<S> crowd = scattered<S>(plan, environments);
    const Target twin = twins::twin_of(crowd.target());
    std::vector<Batch<S>> single, amid_rest;
    for (int e = 0; e < environments; ++e) {
      const Target target = e % 2 == 0 ? crowd.target() : twin;
      contract::scatter(single.emplace_back(plan, 1, BatchOptions{1, target}), 0, static_cast<std::uint64_t>(e));
      contract::scatter(amid_rest.emplace_back(plan, 8, serial), e % 8, static_cast<std::uint64_t>(e));
    }
    for (int step = 1; step <= steps && !testing::Test::HasFailure(); ++step) {
      SCOPED_TRACE(step);
      crowd.step();
      for (int e = 0; e < environments; ++e) {
        const auto i = static_cast<std::size_t>(e);
        single[i].step(), amid_rest[i].step();
        EXPECT_TRUE(same_bits(crowd, e, single[i], 0));
        EXPECT_TRUE(same_bits(crowd, e, amid_rest[i], e % 8));
      }
    }
    EXPECT_EQ(crowd.faulted(), 0) << "frozen environments prove nothing";
  });
}

// The test above needs lanes of one tile with different active sets, whatever its width.
TEST_P(BoundsContract, lanes_of_the_scenes_have_different_active_sets) {
  for_every_scene(GetParam(), [](const Model& model, const ParameterSet& fields, auto scalar) {
    const Plan plan = compile(model, recording(GetParam(), fields));
    const auto rows = static_cast<Eigen::Index>(plan.row_names().size());
    auto batch = scattered<decltype(scalar)>(plan, 8);
    std::vector<bool> differs(plan.row_names().size(), false), full = differs;
    for (int step = 0; step < steps; ++step) {
      batch.step();
      const auto states = batch.row_states();
      EXPECT_FALSE((states.col(0) == states.col(1)).all()) << step;
      for (int e = 0; e < 8; ++e)
        for (int other = 0; step == 0 && other < e; ++other)
          EXPECT_FALSE((states.col(e) == states.col(other)).all()) << e << " and " << other;
      for (Eigen::Index r = 0; r < rows; ++r) {
        const auto i = static_cast<std::size_t>(r);
        differs[i] = differs[i] || (states.row(r) != states(r, 0)).any();
        full[i] = full[i] || ((states.row(r).abs() == 2).any() && !(states.row(r).abs() == 2).all());
      }
    }
    int tight = 0;
    std::map<std::string, bool> kinds;
    for (std::size_t r = 0; r < differs.size(); ++r) {
      const std::string& name = plan.row_names()[r];
      bool& kind = kinds[r == contract::limited_coupling ? "limited" : name.substr(0, name.rfind(' '))];
      kind = kind || differs[r];
      tight += name.starts_with("effort limit") && full[r];
    }
    EXPECT_EQ(kinds.size(), 7u);
    for (const auto& [kind, found] : kinds)
      EXPECT_EQ(found, kind != "kinematic drive" && (kind != "coupling" || fields.contains(Parameter::coupling_switch)))
          << kind;
    EXPECT_GT(tight, 0) << "effort limits are reached in all lanes or none";
    EXPECT_TRUE(!fields.empty() || full[contract::limited_coupling]) << "the coupling slips in all lanes or none";
  });
}

TEST_P(BoundsContract, recording_does_not_change_a_bit) {
  for_every_scene(GetParam(), [](const Model& model, const ParameterSet& fields, auto scalar) {
    using S = decltype(scalar);
    std::vector<Batch<S>> batches;
    for (int recorded = 0; recorded < 4; ++recorded) {
      StepSettings settings = contract::settings(GetParam(), fields);
      settings.record_impulses = recorded & 1, settings.record_diagnostics = recorded & 2;
      batches.push_back(scattered<S>(compile(model, settings), environments));
    }
    for (int step = 1; step <= steps; ++step) {
      for (Batch<S>& batch : batches) batch.step();
      for (std::size_t i = 1; i < batches.size(); ++i) ASSERT_TRUE(same_bits(batches[0], batches[i])) << step;
    }
  });
}

// With diagnostics, kernels look for active bounds more closely, but must not find others. These bodies are at a limit
// to the last bit and drift by less than their positions can show, so no bound is active in every step.
TEST_P(BoundsContract, recording_does_not_change_a_bit_at_the_very_limit) {
  Model model = physics::sliders({1.0, 1.0, 1.0});
  for (Joint& joint : model.joints) joint.position = joint.upper = 0.3;
  model.joints[0].velocity = 1e-9;
  model.joints[1].velocity = 1.0, model.joints[1].upper = infinity;
  model.joints[1].velocity_limit = 1.0 - 1e-7;
  model.joints[2].velocity = -1e-9, model.joints[2].upper = 1.0, model.joints[2].lower = 0.3;
  StepSettings settings = contract::settings(GetParam());
  Batch<float> plain(compile(model, settings), 1, serial);
  settings.record_diagnostics = true;
  Batch<float> recorded(compile(model, settings), 1, serial);
  for (int step = 0; step < 5; ++step) {
    plain.step(), recorded.step();
    EXPECT_TRUE(same_bits(plain, 0, recorded, 0)) << step;
  }
}

// One slider carries a second one against its end stop. The first stops, which leaves the second a speed that is tiny
// beside that of the third body. The third body of the neighbour exceeds its velocity limit, so the tile has an active
// row for it. Its speed must not decide in the first environment whether the tiny speed counts as rounding.
TEST_P(BoundsContract, neighbours_do_not_change_what_counts_as_rounding) {
  Model model = physics::sliders({1.0, 1.0, 1.0});
  model.joints[1].parent = model.joints[0].child;
  for (Joint& joint : model.joints) joint.lower = joint.position = 0.0;
  model.joints[0].velocity = -1.0, model.joints[1].velocity = 0.999;
  model.joints[2].velocity = 1000.0, model.joints[2].velocity_limit = 2000.0;
  const Plan plan = compile(model, contract::settings(GetParam()));
  Batch<float> single(plan, 1, serial), beside(plan, 2, serial);
  beside.velocities()(2, 1) = 3000.0f;
  single.step(), beside.step();
  EXPECT_TRUE(same_bits(single, 0, beside, 0));
  EXPECT_GE(single.velocities()(1, 0), -1e-5f);
}

INSTANTIATE_TEST_SUITE_P(method, BoundsContract, testing::ValuesIn(physics::methods), physics::method_name);

}  // namespace
}  // namespace lockstep
