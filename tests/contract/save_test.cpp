// Batch::save: the same bits go on elsewhere. SPDX-License-Identifier: Apache-2.0
#include "saves.h"

namespace lockstep {
namespace {

using namespace saves;

using physics::engines;

std::vector<Model> models() {
  std::vector<Model> all = {scenes::chain8(), scenes::gripper13(), contract::small_bounded_scenes().front()};
  scenes::RandomOptions options = scenes::forests();
  options.redundant = false;
  for (std::uint64_t seed = 0; seed < 6; ++seed) all.push_back(scenes::random_model(seed, options));
  for (Joint& joint : all[0].joints) joint.velocity = 60.0;  // they turn for ever
  return all;
}

class Save : public testing::TestWithParam<Method> {};

template <class S>
void expect_continuation(const Plan& plan) {
  Batch<S> original = used<S>(plan);
  const Bytes blob = original.save();
  Batch<S> copy(plan, several, {.threads = 3});
  copy.restore(blob);
  EXPECT_EQ(copy.save(), blob);

  // Environments 2 to 15, backwards, among others.
  std::vector<int> from(14), into(14);
  for (int k = 0; k < 14; ++k) from[k] = 15 - k, into[k] = 40 + 3 * k;
  Batch<S> larger = contract::scattered<S>(plan, 90), control = contract::scattered<S>(plan, 90);
  larger.step(2), control.step(2);
  larger.restore(blob, into, from);
  Batch<S> again(plan, 14, {.threads = 1});
  again.restore(original.save(from));
  EXPECT_EQ(again.save(), larger.save(into));

  original.step(30);
  for (Batch<S>* batch : {&copy, &larger, &control, &again}) batch->step(13), batch->step(17);
  const std::set<int> restored(into.begin(), into.end());
  for (int e = 0; e < several; ++e) ASSERT_TRUE(same(original, e, copy, e));
  for (int k = 0; k < 14; ++k) {
    ASSERT_TRUE(same(original, from[k], larger, into[k]));
    ASSERT_TRUE(same(original, from[k], again, k));
  }
  for (int e = 0; e < 90; ++e) {
    if (restored.contains(e)) continue;
    ASSERT_TRUE(same(control, e, larger, e));
  }
}

TEST_P(Save, continues_with_the_same_bits_in_any_place_with_any_threads) {
  for (const Model& model : models())
    for (const ParameterSet& fields : {ParameterSet{}, contract::all_parameters(GetParam(), model)}) {
      SCOPED_TRACE(model.name + (fields.empty() ? "" : " with all parameters"));
      const Plan plan = compile(model, contract::settings(GetParam(), fields));
      expect_continuation<float>(plan);
      expect_continuation<double>(plan);
    }
}

INSTANTIATE_TEST_SUITE_P(method, Save, testing::ValuesIn(physics::methods), physics::method_name);

TEST(Save, gives_every_engine_the_same_bytes) {
  for (const Model& model : models()) {
    SCOPED_TRACE(model.name);
    const Plan plan = compile(model, {.guard = 0.5});
    for (const Engine from : engines(plan))
      for (const Engine to : engines(plan)) {
        Batch<double> original = used<double>(plan, {.threads = 1, .engine = from});
        const Bytes blob = original.save();
        Batch<double> alone(plan, several, {.threads = 1, .engine = to}), other(plan, 33, {.threads = 2, .engine = to});
        std::vector<int> into(several);
        std::iota(into.begin(), into.end(), 9);
        alone.restore(blob);
        other.restore(blob, into);
        ASSERT_EQ(alone.save(), blob);
        ASSERT_EQ(other.save(into), blob);
        alone.step(20), other.step(20);
        for (int e = 0; e < several; ++e) ASSERT_TRUE(same(alone, e, other, into[e]));
        if (from != to) continue;
        original.step(20);
        for (int e = 0; e < several; ++e) ASSERT_TRUE(same(alone, e, original, e));
      }
  }
}

// The library remembers an angle apart from the whole turns, and energy for the audit.
TEST(Save, keeps_what_no_view_shows) {
  Model wheel;
  wheel.links = {{"base", {}}};
  physics::append_link(wheel, "base", {0, 0, 0}, Eigen::Vector3d::UnitZ());
  wheel.joints[0].velocity = 300.0;
  Batch<float> turning(compile(wheel), 1, {.threads = 1}), copied(turning.plan(), 1, {.threads = 1}),
      by_views(turning.plan(), 1, {.threads = 1});
  turning.step(100000);
  copied.restore(turning.save());
  by_views.positions() = turning.positions(), by_views.velocities() = turning.velocities();
  for (Batch<float>* batch : {&turning, &copied, &by_views}) batch->step();
  EXPECT_TRUE((copied.angles() == turning.angles()).all());
  EXPECT_FALSE((by_views.angles() == turning.angles()).all()) << "the scene needs no angle";

  Model arm = scenes::chain8();
  arm.couplings.clear();
  for (Joint& joint : arm.joints) joint.drive = {}, joint.damping = 0.0;
  Batch<double> loose(compile(arm, {.dt = 1.0 / 60, .integrator = Integrator::euler}), 16, {.threads = 1});
  for (int e = 0; e < 16; ++e) contract::scatter(loose, e, static_cast<std::uint64_t>(e));
  loose.velocities() += 3.0;
  loose.efforts().setZero();
  std::vector<Batch<double>> copies;
  for (int i = 0; i < 100; ++i) {
    copies.emplace_back(loose.plan(), 16, BatchOptions{.threads = 1}).restore(loose.save());
    for (Batch<double>& copy : copies) copy.step();
    loose.step();
  }
  std::set<std::uint32_t> found;  // in these steps
  for (int e = 0; e < 16; ++e) {
    if (loose.fault_report(e).stage == FaultStage::energy) found.insert(loose.steps()[e]);
    for (Batch<double>& copy : copies) ASSERT_TRUE(same(loose, e, copy, e));
  }
  EXPECT_GE(found.size(), 3u);
}

TEST(Save, takes_the_last_of_several_and_nothing_for_empty_lists) {
  const Plan plan = compile(scenes::chain8());
  Batch<double> source = used<double>(plan), target(plan, 4, {.threads = 1});
  const Bytes blob = source.save(), before = target.save();
  target.restore(blob, {}, {});
  EXPECT_EQ(target.save(), before);
  target.restore(source.save(std::vector<int>{}), std::vector<int>{});
  EXPECT_EQ(target.save(), before);
  target.restore(blob, std::vector<int>{2, 2, 0}, std::vector<int>{5, 8, 8});
  EXPECT_TRUE(same(target, 2, source, 8));
  EXPECT_TRUE(same(target, 0, source, 8));
  EXPECT_EQ(source.save(std::vector<int>{8, 8}), target.save(std::vector<int>{0, 2}));
}

// The state that it belongs to is none. All other numbers are zero.
TEST(Save, has_a_memory_of_contacts_that_begins_with_zeros) {
  Batch<double> batch(compile(contact_scenes::block()), 1, {.threads = 1}), fresh(batch.plan(), 1, {.threads = 1});
  batch.step(5);
  batch.reset();
  batch.resets()[0] = 0;
  const Bytes bytes = batch.save();
  EXPECT_EQ(bytes, fresh.save());
  const Blob blob = read_blob(bytes);
  const auto memory = std::find_if(blob.sections.begin(), blob.sections.end(),
                                   [](const Blob::Section& section) { return section.name == "contacts"; });
  ASSERT_NE(memory, blob.sections.end());
  const int state = batch.plan().dofs() + batch.plan().dofs() + 13;  // one floating root
  ASSERT_GT(memory->rows, state + 1);
  for (int row = 0; row < memory->rows; ++row) {
    double number;
    std::memcpy(&number, memory->data + sizeof number * static_cast<std::size_t>(row), sizeof number);
    if (row < memory->rows - 1 - state || row == memory->rows - 1)
      EXPECT_EQ(number, 0.0) << row;
    else
      EXPECT_TRUE(std::isnan(number)) << row;
  }
}

}  // namespace
}  // namespace lockstep
