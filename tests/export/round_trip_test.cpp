// Models written and read again: they mean the same. SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <set>

#include "export/mechanism.h"
#include "lockstep/batch.h"
#include "lockstep/error.h"
#include "lockstep/export_model.h"
#include "lockstep/plan.h"
#include "scenes/scenes.h"
#include "unit/import_helpers.h"

namespace lockstep {
namespace {

namespace fs = std::filesystem;
using std::string;

// Without the sites that hold loops.
Model again_by_mjcf(const Model& model) {
  Model again = import_mjcf(export_mjcf(model).text, "exported", {.colliders = true, .keyframe = "start"}).model;
  std::erase_if(again.sites, [&](const Site& site) {
    return std::none_of(model.sites.begin(), model.sites.end(), [&](const Site& own) { return own.name == site.name; });
  });
  return again;
}
Model again_by_urdf(const Model& model) { return import_urdf(export_urdf(model).text).model; }

// To the last leader of each chain, as the reader of URDF does it.
void resolve_chains(Model& model) {
  const auto follows = [&](const string& joint) {
    return std::find_if(model.couplings.begin(), model.couplings.end(),
                        [&](const Coupling& c) { return c.joint == joint; });
  };
  for (Coupling& coupling : model.couplings) {
    CouplingTerm& term = coupling.terms.front();
    for (auto above = follows(term.joint); above != model.couplings.end(); above = follows(term.joint)) {
      coupling.offset -= term.ratio * above->offset;
      term = {above->terms.front().joint, -term.ratio * above->terms.front().ratio};
    }
  }
}

// Without what URDF does not have.
Model within_urdf(Model model) {
  model.gravity = Model().gravity;
  for (Link& link : model.links) link.gravity = 1.0;
  for (Root& root : model.roots) root.velocity.setZero();
  for (Joint& joint : model.joints) {
    joint.drive = {};
    joint.effort = joint.armature = joint.stiffness = joint.position = joint.velocity = 0.0;
  }
  std::erase_if(model.couplings, [&](const Coupling& coupling) {
    return coupling.terms.size() > 1 || coupling.function || joint(model, coupling.joint).kind == JointKind::tendon;
  });
  std::erase_if(model.joints, [](const Joint& joint) { return joint.kind == JointKind::tendon; });
  resolve_chains(model);
  for (const Coupling& coupling : model.couplings) {
    Joint& follower = model.joints[static_cast<std::size_t>(model.joint_index(coupling.joint))];
    follower.position = -coupling.offset;
  }
  return model;
}

void expect_round_trips(const Model& model) {
  {
    SCOPED_TRACE("MJCF");
    expect_same(mechanism_of(again_by_mjcf(model)), mechanism_of(model));
  }
  if (std::any_of(model.joints.begin(), model.joints.end(),
                  [](const Joint& joint) { return joint.kind == JointKind::ball; }))
    return;  // which URDF does not have
  SCOPED_TRACE("URDF");
  const Except except = {.softness = true, .colliders = true, .sites = true};
  const Model wanted = within_urdf(model);
  expect_same(mechanism_of(again_by_urdf(model), except), mechanism_of(wanted, except));
}

// In the folder, or below it.
template <class Iterator = fs::directory_iterator>
std::vector<string> files(const fs::path& folder, const std::set<string>& extensions) {
  std::vector<string> found;
  if (fs::is_directory(folder))
    for (const fs::directory_entry& entry : Iterator(folder))
      if (extensions.contains(entry.path().extension().string())) found.push_back(entry.path().string());
  std::sort(found.begin(), found.end());
  return found;
}

const auto name_of_file = [](const auto& info) {
  string name = fs::path(info.param).filename().string();
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  return name;
};

class RoundTrip : public testing::TestWithParam<string> {};

TEST_P(RoundTrip, gives_the_same_mechanism) { expect_round_trips(import_file(GetParam(), {.colliders = true}).model); }

INSTANTIATE_TEST_SUITE_P(urdf, RoundTrip, testing::ValuesIn(files(LOCKSTEP_MODELS, {".urdf"})), name_of_file);
INSTANTIATE_TEST_SUITE_P(mjcf, RoundTrip, testing::ValuesIn(files(LOCKSTEP_MJCF "/models", {".xml"})), name_of_file);

TEST(RoundTripOfRobots, gives_the_same_mechanism) {
  const char* variable = std::getenv("LOCKSTEP_TEST_DATA");
  const string folder = variable ? variable : LOCKSTEP_TEST_DATA;
  std::vector<string> robots = files(fs::path(folder) / "robots", {".urdf", ".xml"});
  for (const string& file : files<fs::recursive_directory_iterator>(fs::path(folder) / "mjcf", {".xml"}))
    robots.push_back(file);
  if (folder.empty() || robots.empty()) GTEST_SKIP() << "LOCKSTEP_TEST_DATA has no robots";
  int read = 0;
  for (const string& file : robots) {
    SCOPED_TRACE(file);
    const ImportOptions options{.least_mass = 1e-3, .least_inertia = 1e-7, .colliders = true, .leave_out_meshes = true};
    Model model;
    try {
      model = import_file(file, options).model;
    } catch (const Error&) {
      continue;  // a part of another file, or a mechanism that lockstep lacks
    }
    expect_round_trips(model);
    ++read;
  }
  EXPECT_GT(read, 15);
}

// The file is drawn with all joints at 0, and the springs are those of another pose.
TEST(RoundTripOfSoftContacts, gives_the_same_springs) {
  Model model = import_file(LOCKSTEP_EXAMPLES "/quadruped.xml", {.colliders = true, .keyframe = "stand"}).model;
  for (std::size_t i = 0; i < model.contacts.size(); ++i)
    model.contacts[i].softness = Spring{200.0 * std::pow(10.0, static_cast<double>(i)), 3.0 * static_cast<double>(i)};
  model.contacts[0].torsional_friction = 0.01, model.contacts[1].rolling_friction = 0.002;
  ASSERT_GT(model.contacts.size(), 4u);
  const Export made = export_mjcf(model);
  for (const string& line : made.warnings) EXPECT_EQ(line.find("softness"), string::npos) << line;
  expect_same(mechanism_of(again_by_mjcf(model)), mechanism_of(model));
}

TEST(RoundTripOfScenes, gives_the_same_mechanism) {
  for (const string& name : scenes::names()) {
    SCOPED_TRACE(name);
    const Model model = scenes::scene(name).model;
    expect_same(mechanism_of(again_by_mjcf(model)), mechanism_of(model));
  }
}

TEST(RoundTripOfRandomModels, gives_the_same_mechanism) {
  int compared = 0;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    SCOPED_TRACE(seed);
    scenes::RandomOptions options = scenes::forests();
    options.coupling_error = false;
    // What a soft coupling does beside hard ones can be said in several ways.
    options.soft = seed % 2 == 0 ? scenes::RandomOptions::Soft::never : scenes::RandomOptions::Soft::always;
    Model model = scenes::random_model(seed, options);
    for (Coupling& coupling : model.couplings)
      if (!is_hard(coupling.softness)) coupling.softness = Spring{30.0 * static_cast<double>(seed), 0.7};
    const Export made = export_mjcf(model);
    const Import again = import_mjcf(made.text, "exported", {.keyframe = "start"});
    if (warns(again, "acts on what no joint moves")) continue;  // a drive without effect is not read
    Mechanism wanted = mechanism_of(model);
    if (report_of(again).find("stand still beside floating ones") != string::npos) wanted.erase("body on world");
    expect_same(mechanism_of(again.model), wanted, 1e-11);
    ++compared;
  }
  EXPECT_GT(compared, 80);
}

// MJCF has no offset of a tendon: what it has is shifted.
TEST(RoundTripOfTendons, moves_the_same_with_an_offset) {
  Model model = scenes::scene("chain8").model;
  model.couplings.clear();
  Joint tendon;
  tendon.name = "sum", tendon.kind = JointKind::tendon;
  tendon.lower = -0.2, tendon.upper = 0.9, tendon.stiffness = 3.0, tendon.rest = 0.4, tendon.damping = 0.1;
  tendon.drive.kp = 5.0, tendon.drive.kd = 0.2, tendon.drive.position_target = 0.7;
  model.joints.push_back(tendon);
  model.couplings.push_back(
      {"sum", {{model.joints[1].name, -1.0}, {model.joints[3].name, -0.5}}, 0.3, Hard{}, infinity});
  tendon.name = "slack", tendon.stiffness = 0.0, tendon.drive = {}, tendon.limit_softness = Spring{20.0, 0.0};
  model.joints.push_back(tendon);
  model.couplings.push_back(
      {"slack", {{model.joints[2].name, -1.0}, {model.joints[4].name, 2.0}}, -0.2, Hard{}, infinity});
  const Export made = export_mjcf(model);
  EXPECT_NE(report_of(Import{{}, made.report, {}, {}, {}}).find("tendons whose length has their offset"), string::npos);
  const Model again = import_mjcf(made.text, "exported", {.keyframe = "start"}).model;
  StepSettings settings;
  settings.integrator = Integrator::euler;
  Batch<double> one(compile(model, settings), 1), other(compile(again, settings), 1);
  one.step(200), other.step(200);
  double moved = 0.0;
  for (const Joint& own : model.joints) {
    if (own.kind == JointKind::tendon || !own.moves()) continue;
    const double q = one.positions()(one.plan().dof(own.name), 0);
    EXPECT_NEAR(other.positions()(other.plan().dof(own.name), 0), q, 1e-9) << own.name;
    moved = std::max(moved, std::abs(q - own.position));
  }
  EXPECT_GT(moved, 0.1);
  EXPECT_NEAR(other.positions()(other.plan().dof("sum"), 0), one.positions()(one.plan().dof("sum"), 0) + 0.3, 1e-9);
}

}  // namespace
}  // namespace lockstep
