// Plan::hash() and model_hash(): every name and number counts. SPDX-License-Identifier: Apache-2.0
#include <functional>
#include <set>

#include "bounded_scenes.h"
#include "plan/hash.h"

namespace lockstep {
namespace {

// Each number and name of a model counts, and each setting.
TEST(PlanHash, differs_where_anything_does_and_nowhere_else) {
  const Model model = contract::bounded_scenes().front();
  const StepSettings settings = contract::settings(Method::direct);
  const Plan plan = compile(model, settings);
  EXPECT_EQ(compile(model, settings).hash(), plan.hash());
  EXPECT_NE(plan.hash(), plan.model_hash());
  const std::vector<std::function<void(Model&)>> changes = {
      [](Model& m) { m.name += "x"; },
      [](Model& m) { m.links[1].inertia.mass *= 1.5; },
      [](Model& m) { m.links[1].inertia.center[2] += 1e-9; },
      [](Model& m) { m.links[1].inertia.about_center *= 1.01; },
      [](Model& m) {
        for (std::string* name : {&m.couplings[0].joint, &m.joints[m.joint_index(m.couplings[0].joint)].name})
          *name += "x";
      },
      [](Model& m) { m.joints[0].origin.translation()[0] += 1e-9; },
      [](Model& m) { m.joints[0].axis *= 2.0; },
      [](Model& m) { m.joints[7].damping += 1e-9; },
      [](Model& m) { m.joints[7].armature += 1e-9; },
      [](Model& m) { m.joints[7].stiffness += 1e-9; },
      [](Model& m) { m.joints[7].rest += 1e-9; },
      [](Model& m) { m.joints[7].effort += 1e-9; },
      [](Model& m) { m.joints[0].drive.kp += 1e-9; },
      [](Model& m) { m.joints[0].drive.position_target += 1e-9; },
      [](Model& m) { m.joints[0].drive.delay = 1; },
      [](Model& m) { m.joints[0].drive.lag = 0.01; },
      [](Model& m) { m.joints[0].lower -= 1e-9; },
      [](Model& m) { m.joints[0].restitution = 0.25; },
      [](Model& m) {
        m.joints[1].limit_softness = Spring{60.0, 2.0};
      },
      [](Model& m) {
        m.joints[1].limit_softness = Frequency{60.0, 1.0};
      },
      [](Model& m) { m.joints[1].friction += 1e-9; },
      [](Model& m) { m.joints[1].velocity += 1e-9; },
      [](Model& m) { m.joints[1].position += 1e-9; },
      [](Model& m) { m.couplings[0].offset += 1e-9; },
      [](Model& m) { m.couplings[0].terms[0].ratio += 1e-9; },
      [](Model& m) { m.couplings[0].force_limit = 1e9; },
      [](Model& m) {
        m.sites.push_back({"tip", m.links.back().name, Pose::Identity()});
      },
      [](Model& m) { m.gravity[0] = -0.0; },
      [](Model& m) { m.gravity[1] = 1.0; },
      [](Model& m) { m.links[0].gravity = 0.5; }};
  std::set<std::uint64_t> models = {plan.model_hash()}, plans = {plan.hash()};
  for (std::size_t i = 0; i < changes.size(); ++i) {
    Model other = model;
    changes[i](other);
    const Plan changed = compile(other, settings);
    EXPECT_TRUE(models.insert(changed.model_hash()).second) << i;
    EXPECT_TRUE(plans.insert(changed.hash()).second) << i;
  }
  Model rooted = model;  // as it is where no root is named
  rooted.roots = plan.model().roots;
  EXPECT_EQ(compile(rooted, settings).hash(), plan.hash());
  const std::vector<std::function<void(StepSettings&)>> other_settings = {
      [](StepSettings& s) { s.dt *= 1.0 + 1e-15; },
      [](StepSettings& s) { s.method = Method::reduced; },
      [](StepSettings& s) { s.integrator = Integrator::automatic; },
      [](StepSettings& s) { s.iterations += 1; },
      [](StepSettings& s) { s.velocity_iterations += 1; },
      [](StepSettings& s) { s.per_environment = {Parameter::damping}; },
      [](StepSettings& s) { s.ignore.position_limits = true; },
      [](StepSettings& s) { s.ignore.position_limits = JointSet::of_followers(); },
      [](StepSettings& s) { s.ignore.velocity_limits = true; },
      [](StepSettings& s) { s.ignore.effort_limits = true; },
      [](StepSettings& s) { s.ignore.friction = true; },
      [&](StepSettings& s) { s.ignore.friction = {model.joints[0].name}; },
      [&](StepSettings& s) {
        s.ignore.friction = {model.joints[0].name, model.joints[1].name};
      },
      [](StepSettings& s) { s.stage_inputs = true; },
      [](StepSettings& s) { s.record_impulses = false; },
      [](StepSettings& s) { s.record_diagnostics = true; },
      [](StepSettings& s) { s.record_contacts = true; },
      [](StepSettings& s) { s.record_accelerations = true; },
      [](StepSettings& s) { s.guard = 0.02; },
      [](StepSettings& s) { s.position_bound += 1.0; },
      [](StepSettings& s) { s.velocity_bound += 1.0; }};
  for (std::size_t i = 0; i < other_settings.size(); ++i) {
    StepSettings other = settings;
    other_settings[i](other);
    const Plan changed = compile(model, other);
    EXPECT_EQ(changed.model_hash(), plan.model_hash()) << i;
    EXPECT_TRUE(plans.insert(changed.hash()).second) << i;
  }
  Model servos = model;  // efforts of kinematic drives are not recorded
  for (Joint& joint : servos.joints) joint.drive = {};
  StepSettings recorded = settings;
  recorded.record_efforts = true;
  EXPECT_NE(compile(servos, recorded).hash(), compile(servos, settings).hash());
}

// The vectors that the authors of FNV publish.
TEST(PlanHash, is_fnv_1a) {
  const auto hash_of = [](std::string_view text) {
    Hash hash;
    hash.add(text);
    return hash.value();
  };
  EXPECT_EQ(hash_of(""), 0xcbf29ce484222325u);
  EXPECT_EQ(hash_of("a"), 0xaf63dc4c8601ec8cu);
  EXPECT_EQ(hash_of("foobar"), 0x85944171f73967e8u);
  Hash number;
  number.add(std::uint64_t{0x7261626f6f66});  // "foobar", the lowest byte first, then two zeros
  EXPECT_EQ(number.value(), hash_of(std::string_view("foobar\0\0", 8)));
}

}  // namespace
}  // namespace lockstep
