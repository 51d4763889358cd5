// Every dynamic attribute of files of others matters, from the folder LOCKSTEP_TEST_DATA.
// SPDX-License-Identifier: Apache-2.0
#include <cstdlib>

#include "deletion.h"

namespace lockstep {
namespace {

using std::string;

// What moves, drives or resists a mechanism.
const std::set<string> dynamic = {"damping",      "armature",
                                  "frictionloss", "stiffness",
                                  "springref",    "ref",
                                  "range",        "gear",
                                  "kp",           "kv",
                                  "gainprm",      "biasprm",
                                  "biastype",     "forcerange",
                                  "ctrlrange",    "coef",
                                  "polycoef",     "mass",
                                  "diaginertia",  "fullinertia",
                                  "dampratio",    "actuatorfrcrange",
                                  "springlength", "gravcomp",
                                  "axis",         "joint1",
                                  "joint2",       "tendon1",
                                  "joint",        "tendon",
                                  "limited",      "springdamper",
                                  "inheritrange", "gravity",
                                  "friction",     "contype",
                                  "conaffinity",  "condim",
                                  "density",      "margin"};

struct File {
  const char* path;
  std::set<string> allowed;  // default numbers, numbers that others override, and what an equality holds
};

void PrintTo(const File& file, std::ostream* stream) { *stream << file.path; }

class PackedDeletion : public testing::TestWithParam<File> {};

TEST_P(PackedDeletion, of_a_dynamic_attribute_changes_the_model_or_the_report) {
  const char* variable = std::getenv("LOCKSTEP_TEST_DATA");
  const std::filesystem::path path =
      std::filesystem::path(variable ? variable : LOCKSTEP_TEST_DATA) / "mjcf" / GetParam().path;
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "LOCKSTEP_TEST_DATA has no MJCF files";
  std::set<string> found;
  for (const string& one : without_effect(contents(path), {.colliders = true, .loops = Loops::leave_out})) {
    const std::size_t name = one.find(": ") + 2;
    if (dynamic.contains(one.substr(name, one.find('=') - name))) found.insert(one);
  }
  EXPECT_EQ(found, GetParam().allowed);
}

INSTANTIATE_TEST_SUITE_P(
    data, PackedDeletion,
    testing::Values(
        File{"panda_hand/hand.xml",
             {R"(general: ctrlrange="-2.8973 2.8973")", R"(general: forcerange="-87 87")", R"(joint: axis="0 0 1")",
              R"(joint: range="-2.8973 2.8973")"}},
        File{"jaco_gripper/jaco_three_finger_gripper.xml",
             {R"(fixed: limited="true")", R"(fixed: springlength="0.2")", R"(joint: limited="true")"}},
        File{"panda/panda.xml", {R"(joint: axis="0 0 1")"}}, File{"wx250s/wx250s.xml", {R"(joint: axis="0 1 0")"}},
        File{"lite6_gripper/lite6_gripper_narrow.xml",
             {R"(inertial: diaginertia="0 0 0")", R"(joint: axis="0 0 1")", R"(joint: limited="true")",
              R"(motor: ctrlrange="-10 10")", R"(motor: forcerange="-10 10")"}},
        File{"robotiq_140/robotiq_gripper_140.xml", {R"(fixed: limited="true")", R"(joint: limited="true")"}},
        File{"robotiq_2f85_v4/2f85.xml", {R"(joint: axis="0 0 1")", R"(joint: polycoef="0 1 0 0 0")"}},
        File{"shadow_hand/right_hand.xml", {}},
        File{"openarm/openarm.xml", {R"(geom: conaffinity="1")", R"(joint: axis="0 0 1")", R"(joint: ref="0.0")"}},
        File{"toddlerbot/toddlerbot_2xc_mjx.xml",
             {R"(fixed: limited="true")", R"(geom: conaffinity="1")", R"(geom: condim="1")", R"(geom: contype="1")",
              R"(joint: armature="0")"}}),
    [](const auto& file) { return std::filesystem::path(file.param.path).parent_path().string(); });

}  // namespace
}  // namespace lockstep
