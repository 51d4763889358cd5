// Batch::restore takes nothing but what save() gave. SPDX-License-Identifier: Apache-2.0
#include "saves.h"

namespace lockstep {
namespace {

using namespace saves;

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
               {"format 1 of lockstep 0\\x0a,", std::string("lockstep ") + version() + " reads format 11"});
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
  other[12] = std::byte(12);
  expect_words(refusal([&] { small.batch.restore(other); }), {"format 12", "format 11"});
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

// They are of a step that the restored state has not made.
TEST(Restore, and_reset_leave_no_readings_of_another_state) {
  Model model = physics::sliders({1.0, 2.0});
  model.couplings = {Coupling::mimic("s1", "s0", 0.5)};
  StepSettings settings;
  settings.integrator = Integrator::euler, settings.record_impulses = settings.record_diagnostics = true;
  Batch<double> batch(compile(model, settings), 3, {.threads = 1});
  batch.efforts().row(0) << 1.0, 2.0, 3.0;
  const Bytes start = batch.save();
  const auto read_all = [&](int e) {
    return std::abs(batch.coupling_impulses()(0, e)) + batch.energy_balances().col(e).abs().sum();
  };
  batch.step(5);
  for (int e = 0; e < 3; ++e) EXPECT_GT(read_all(e), 1e-3);
  const int into[] = {1}, from[] = {0}, again[] = {2};
  const double kept = read_all(0);
  batch.restore(start, into, from);
  batch.reset(EnvironmentSet(again));
  EXPECT_EQ(read_all(0), kept);
  EXPECT_EQ(read_all(1), 0.0);
  EXPECT_EQ(read_all(2), 0.0);
}

}  // namespace
}  // namespace lockstep
