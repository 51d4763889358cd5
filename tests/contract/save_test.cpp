// Batch::save and restore: the same bits go on elsewhere, and nothing else is taken. SPDX-License-Identifier:
// Apache-2.0
#include <functional>
#include <limits>
#include <numeric>
#include <set>

#include "batch/blob.h"
#include "bounded_scenes.h"
#include "contact_scenes.h"
#include "interpret/lower.h"
#include "lockstep/error.h"
#include "lockstep/version.h"
#include "plan/program.h"

namespace lockstep {
namespace {

using Bytes = std::vector<std::byte>;

constexpr int several = 19;
constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

// The error that act() throws, in words; empty if none.
template <class Act>
std::string refusal(Act act) {
  try {
    act();
  } catch (const UsageError& error) {
    return error.what();
  }
  return {};
}

void expect_words(const std::string& text, const std::vector<std::string>& parts) {
  for (const std::string& part : parts) EXPECT_NE(text.find(part), std::string::npos) << part << " in: " << text;
}

std::string hex(std::uint64_t hash) {
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(hash));
  return text;
}

// Everything that an environment shows, state, inputs, parameters, counts and faults, without save().
template <class S>
std::vector<S> shown(Batch<S>& batch, int e) {
  std::vector<S> numbers = contract::outcome(batch, e);
  const auto append = [&](const auto& rows) {
    for (Eigen::Index row = 0; row < rows.rows(); ++row) numbers.push_back(rows(row, e));
  };
  append(batch.position_targets());
  append(batch.velocity_targets());
  append(batch.efforts());
  append(batch.angles());
  append(batch.turns());
  for (unsigned p = 0; p < parameter_count; ++p)
    if (batch.plan().settings().per_environment.contains(Parameter{p})) append(batch.parameter(Parameter{p}));
  const FaultReport report = batch.fault_report(e);
  for (const double number : {static_cast<double>(batch.steps()[e]), static_cast<double>(batch.resets()[e]),
                              static_cast<double>(report.fault), static_cast<double>(report.stage),
                              static_cast<double>(report.dof), static_cast<double>(report.step)})
    numbers.push_back(static_cast<S>(number));
  return numbers;
}

template <class S>
testing::AssertionResult same(Batch<S>& a, int i, Batch<S>& b, int j) {
  const std::vector<S> left = shown(a, i), right = shown(b, j);
  if (contract::same_bits(left, right)) return testing::AssertionSuccess();
  for (std::size_t k = 0; k < left.size(); ++k)
    if (std::memcmp(&left[k], &right[k], sizeof(S)) != 0)
      return testing::AssertionFailure() << "environments " << i << " and " << j << ": number " << k << " is "
                                         << left[k] << " and " << right[k];
  return testing::AssertionFailure();
}

// Scattered, with other counts of steps and resets, and with two frozen environments.
template <class S>
Batch<S> used(const Plan& plan, const BatchOptions& options = {.threads = 1}) {
  Batch<S> batch = contract::scattered<S>(plan, several, options);
  batch.step(5);
  batch.reset(std::vector<int>{6, 11});
  batch.reset(std::vector<int>{6});
  contract::scatter(batch, 6, 77);
  batch.velocities()(0, 3) = static_cast<S>(not_a_number);
  batch.positions()(0, 14) = S(1e30);
  batch.step(3);
  EXPECT_NE(batch.faults()[3], Fault::none);
  return batch;
}

std::vector<Engine> engines(const Plan& plan) {
  std::vector<Engine> all = {Engine::tables};
  if (interpret::interpreted_step(program_of(plan))) all.push_back(Engine::interpreter);
  return all;
}

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

// A small batch with sections of every kind, faults among them.
struct Small {
  Plan plan = compile(scenes::chain8(), {.per_environment = {Parameter::damping}});
  Batch<float> batch{plan, 3, {.threads = 1}};
  Bytes blob;
  Small() {
    for (int e = 0; e < 3; ++e) contract::scatter(batch, e, static_cast<std::uint64_t>(e));
    batch.velocities()(0, 1) = static_cast<float>(not_a_number);
    batch.step(2);
    blob = batch.save();
    batch.step(3);
  }
};

// The blob with a section that change() has written to, with right checksums.
template <class Change>
Bytes forged(const Bytes& bytes, const std::string& name, const Change& change) {
  const Blob blob = read_blob(bytes);
  std::vector<BlobSection> sections(blob.sections.size());
  for (std::size_t i = 0; i < sections.size(); ++i) {
    blob.sections[i].name.copy(sections[i].name.data(), sections[i].name.size());
    sections[i].rows = static_cast<std::uint32_t>(blob.sections[i].rows);
    sections[i].number_bytes = static_cast<std::uint32_t>(blob.sections[i].number_bytes);
  }
  int changed = 0;
  const Bytes result = write_blob(blob.head, blob.settings, sections, [&](std::size_t i, std::byte* to) {
    const Blob::Section& own = blob.sections[i];
    std::memcpy(to, own.data, static_cast<std::size_t>(own.rows) * own.number_bytes * blob.head.environments);
    if (own.name == name) change(to), ++changed;
  });
  EXPECT_EQ(changed, 1) << name;
  return result;
}

TEST(Restore, refuses_faults_stages_and_dofs_that_are_none) {
  Small small;
  const Bytes before = small.batch.save();
  const auto put = [&](const char* section, std::size_t at, std::int32_t number) {
    return forged(small.blob, section, [&](std::byte* to) { std::memcpy(to + at, &number, sizeof number); });
  };
  constexpr std::size_t second = 8;  // environment 1 has the fault; a place is a stage and a dof
  for (const std::int32_t fault : {7, 77, -1})
    expect_words(refusal([&] { small.batch.restore(put("fault", 4, fault)); }), {"section 'fault'", "environment 1"});
  for (const std::int32_t stage : {6, 1000, -1})
    expect_words(refusal([&] { small.batch.restore(put("fault place", second, stage)); }),
                 {"section 'fault place'", "environment 1"});
  for (const std::int32_t dof : {-2, small.plan.dofs(), 100000000})
    expect_words(refusal([&] { small.batch.restore(put("fault place", second + 4, dof)); }),
                 {"section 'fault place'", "environment 1"});
  EXPECT_EQ(small.batch.save(), before);
  for (const std::int32_t dof : {-1, 0, small.plan.dofs() - 1}) {
    small.batch.restore(put("fault place", second + 4, dof));
    EXPECT_EQ(small.batch.fault_report(1).dof, dof);
    EXPECT_FALSE(small.batch.explain_fault(1).empty());
  }
}

TEST(Restore, refuses_an_older_format_and_names_both_versions) {
  Small small;
  Bytes old = small.blob;
  old[12] = std::byte(1);                                                       // the format
  old[56] = std::byte('0'), old[57] = std::byte('\n'), old[58] = std::byte(0);  // the version
  expect_words(refusal([&] { small.batch.restore(old); }),
               {"format 1 of lockstep 0\\x0a,", std::string("lockstep ") + version() + " reads format 2"});
}

TEST(Restore, shows_text_of_the_blob_on_one_line) {
  Small small;
  const Blob blob = read_blob(small.blob);
  std::vector<BlobSection> sections(1);
  const std::string name = "fa\n\x1b[31m\xff";
  name.copy(sections[0].name.data(), name.size());
  sections[0].rows = 1, sections[0].number_bytes = 4;
  const Bytes strange = write_blob(blob.head, blob.settings, sections, [](std::size_t, std::byte*) {});
  expect_words(refusal([&] { small.batch.restore(strange); }), {"section 'fa\\x0a\\x1b[31m\\xff' of the blob"});
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

TEST(Restore, refuses_every_flipped_byte_and_changes_nothing) {
  Small small;
  const Bytes before = small.batch.save();
  for (std::size_t i = 0; i < small.blob.size(); ++i)
    for (const unsigned flip : {0x01u, 0x80u, 0xffu}) {
      Bytes damaged = small.blob;
      damaged[i] ^= std::byte(flip);
      const std::string words = refusal([&] { small.batch.restore(damaged); });
      ASSERT_TRUE(words.starts_with("blob: ") || words.starts_with("section '")) << "byte " << i << ": " << words;
      ASSERT_NE(words.find("; "), std::string::npos);
      ASSERT_FALSE(refusal([&] { small.batch.restore(damaged, {.other_settings = true}); }).empty()) << i;
    }
  EXPECT_EQ(small.batch.save(), before);
  small.batch.restore(small.blob);
  EXPECT_NE(small.batch.save(), before);
}

TEST(Restore, names_the_section_that_is_damaged) {
  Small small;
  small.blob.back() ^= std::byte(1);  // the last section is the declared field
  expect_words(refusal([&] { small.batch.restore(small.blob); }), {"section 'damping'", "checksum"});
}

TEST(Restore, refuses_every_truncation_and_extension) {
  Small small;
  const Bytes before = small.batch.save();
  for (std::size_t length = 0; length < small.blob.size(); ++length) {
    const Bytes part(small.blob.begin(), small.blob.begin() + static_cast<std::ptrdiff_t>(length));
    const std::string words = refusal([&] { small.batch.restore(part); });
    ASSERT_TRUE(words.starts_with("blob: has " + std::to_string(length) + " bytes, ")) << words;
  }
  Bytes longer = small.blob;
  for (int more = 0; more < 300; ++more) {
    longer.push_back(more % 2 ? std::byte(0) : small.blob[static_cast<std::size_t>(more)]);
    expect_words(refusal([&] { small.batch.restore(longer); }), {"something was added"});
  }
  EXPECT_EQ(small.batch.save(), before);
}

TEST(Restore, refuses_another_byte_order_format_and_scalar) {
  Small small;
  Bytes other = small.blob;
  std::reverse(other.begin() + 8, other.begin() + 12);
  expect_words(refusal([&] { small.batch.restore(other); }), {"other byte order"});
  other = small.blob;
  other[12] = std::byte(3);
  expect_words(refusal([&] { small.batch.restore(other); }), {"format 3", "format 2"});
  Batch<double> wide(small.plan, 3, {.threads = 1});
  expect_words(refusal([&] { wide.restore(small.blob); }), {"4 bytes", "8", "Batch<float>"});
  expect_words(refusal([&] { small.batch.restore(wide.save()); }), {"8 bytes", "4", "Batch<double>"});
}

TEST(Restore, refuses_another_plan_and_says_what_differs) {
  Small small;
  const StepSettings own = small.plan.settings();
  struct Other {
    std::function<void(StepSettings&)> change;
    const char *there, *here;
  };
  const std::vector<Other> others = {
      {[](StepSettings& s) { s.dt = 0.25; }, "'dt 0.004166666666666667' there", "'dt 0.25' here"},
      {[](StepSettings& s) { s.method = Method::pgs; }, "'method automatic' there", "'method pgs' here"},
      {[](StepSettings& s) { s.iterations = 40; }, "'iterations 4' there", "'iterations 40' here"},
      {[](StepSettings& s) { s.guard = infinity, s.position_bound = 7.0; }, "'guard 0.01' there", "'guard inf' here"},
      {[](StepSettings& s) { s.per_environment.insert(Parameter::mass); }, "'per_environment damping' there",
       "'per_environment damping mass' here"},
      {[](StepSettings& s) { s.velocity_bound = 100.0; }, "'velocity_bound 100000' there",
       "'velocity_bound 100' here"}};
  for (const Other& other : others) {
    StepSettings settings = own;
    other.change(settings);
    const Plan plan = compile(scenes::chain8(), settings);
    EXPECT_EQ(plan.model_hash(), small.plan.model_hash());
    Batch<float> batch(plan, 3, {.threads = 1});
    const Bytes before = batch.save();
    expect_words(refusal([&] { batch.restore(small.blob); }),
                 {hex(plan.hash()), hex(small.plan.hash()), other.there, other.here, "other_settings"});
    EXPECT_EQ(batch.save(), before);
  }
  Model model = scenes::chain8();
  model.links[2].inertia.mass *= 1.5;
  const Plan plan = compile(model, own);
  Batch<float> batch(plan, 3, {.threads = 1});
  for (const bool other_settings : {false, true})
    expect_words(refusal([&] { batch.restore(small.blob, {.other_settings = other_settings}); }),
                 {hex(plan.hash()), hex(small.plan.hash()), hex(plan.model_hash()), hex(small.plan.model_hash())});
}

TEST(Restore, takes_a_blob_of_other_settings_where_asked) {
  Small small;
  StepSettings settings = small.plan.settings();
  settings.dt /= 2.0, settings.guard = infinity;
  settings.per_environment.insert(Parameter::armature);
  Batch<float> finer(compile(scenes::chain8(), settings), 3, {.threads = 1});
  finer.parameter(Parameter::armature).setConstant(0.75f);
  finer.parameter(Parameter::damping).setConstant(0.75f);
  finer.restore(small.blob, {.other_settings = true});
  Batch<float> saved(small.plan, 3, {.threads = 1});
  saved.restore(small.blob);
  for (int e = 0; e < 3; ++e) EXPECT_TRUE(contract::same_bits(finer, e, saved, e));
  EXPECT_TRUE((finer.parameter(Parameter::damping) == saved.parameter(Parameter::damping)).all());
  EXPECT_TRUE((finer.parameter(Parameter::armature) == 0.75f).all()) << "the blob has none";
  EXPECT_EQ(finer.fault_report(1).stage, saved.fault_report(1).stage);
  EXPECT_EQ(finer.steps()[0], 2u);

  // What the batch cannot hold is refused.
  const Bytes own = finer.save(), before = saved.save();
  expect_words(refusal([&] { saved.restore(own, {.other_settings = true}); }),
               {"section 'armature'", "StepSettings::per_environment"});
  settings.per_environment = {Parameter::damping}, settings.stage_inputs = true;
  settings.integrator = Integrator::leapfrog;
  Batch<float> staged(compile(scenes::chain8(), settings), 3, {.threads = 1});
  ASSERT_GT(staged.efforts().rows(), 8);
  expect_words(refusal([&] { staged.restore(small.blob, {.other_settings = true}); }),
               {"section 'position target'", "8 rows", "stage_inputs"});
  EXPECT_EQ(saved.save(), before);

  // An audit under these settings is not one under those.
  settings = small.plan.settings();
  settings.velocity_bound = 1e4;
  Batch<float> audited(compile(scenes::chain8(), settings), 3, {.threads = 1}),
      fresh(audited.plan(), 3, {.threads = 1});
  ASSERT_TRUE(program_of(audited.plan()).f32.audited);
  for (int e = 0; e < 3; ++e) audited.velocities().col(e).setConstant(40.0f);
  audited.step(40);
  audited.restore(small.blob, {.other_settings = true});
  fresh.restore(small.blob, {.other_settings = true});
  EXPECT_EQ(audited.save(), fresh.save());
}

TEST(Restore, refuses_sizes_and_environments_that_do_not_fit) {
  Small small;
  Batch<float> five(small.plan, 5, {.threads = 1});
  const Bytes before = five.save();
  using Ids = std::vector<int>;
  expect_words(refusal([&] { five.restore(small.blob); }), {"3 environments to 5"});
  expect_words(refusal([&] { five.restore(small.blob, Ids{0, 1}); }), {"3 environments to 2"});
  expect_words(refusal([&] { five.restore(small.blob, Ids{0, 1}, Ids{0}); }), {"1 environments to 2"});
  expect_words(refusal([&] { five.restore(small.blob, Ids{0, 5}, Ids{0, 1}); }), {"environment 5", "0 to 4"});
  expect_words(refusal([&] { five.restore(small.blob, Ids{0, -1}, Ids{0, 1}); }), {"environment -1", "0 to 4"});
  for (const int id : {3, -1})
    expect_words(refusal([&] {
                   five.restore(small.blob, Ids{0, 1}, Ids{0, id});
                 }),
                 {"environment " + std::to_string(id) + " of the blob", "0 to 2"});
  expect_words(refusal([&] { five.save(Ids{0, 5}); }), {"environment 5", "0 to 4"});
  EXPECT_EQ(five.save(), before);
}

}  // namespace
}  // namespace lockstep
