// MJCF files of others against what MuJoCo makes of them, from the folder LOCKSTEP_TEST_DATA.
// SPDX-License-Identifier: Apache-2.0
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "import_helpers.h"
#include "lockstep/batch.h"
#include "lockstep/error.h"
#include "lockstep/plan.h"

namespace lockstep {
namespace {

using nlohmann::json;
using std::string;

struct File {
  const char* model;  // below LOCKSTEP_TEST_DATA
  const char* expected;
};

void PrintTo(const File& file, std::ostream* stream) { *stream << file.model; }

class MjcfRobots : public testing::TestWithParam<File> {
 protected:
  void SetUp() override {
    const char* variable = std::getenv("LOCKSTEP_TEST_DATA");
    const string folder = variable ? variable : LOCKSTEP_TEST_DATA;
    path = folder + "/" + GetParam().model;
    if (folder.empty() || !std::filesystem::exists(path)) GTEST_SKIP() << "LOCKSTEP_TEST_DATA has no MJCF files";
    std::ifstream stream(folder + "/" + GetParam().expected);
    expected = json::parse(stream);
  }

  string path;
  json expected;
};

// What once had to be refused is read.
TEST_P(MjcfRobots, are_read_with_their_loops) {
  const std::vector<string> obstacles = expected["refused_because"];
  const auto has = [&](const string& start) {
    return std::any_of(obstacles.begin(), obstacles.end(), [&](const string& one) { return one.starts_with(start); });
  };
  const Import import = import_mjcf_file(path);
  EXPECT_EQ(!import.model.loops.empty(), has("closed loop"));
  EXPECT_FALSE(warns(import, "endons")) << report_of(import);
  EXPECT_FALSE(warns(import, "actuators left out")) << report_of(import);
}

// Of numbers that may be infinite.
void expect_near(double own, double wanted) {
  if (own == wanted) return;
  EXPECT_NEAR(own, wanted, 1e-9);
}

// The rest holds for trees without loops.
class MjcfModels : public MjcfRobots {
 protected:
  void SetUp() override {
    MjcfRobots::SetUp();
    if (IsSkipped()) return;
    import = import_mjcf_file(path, {.loops = Loops::leave_out});
  }
  Import import;
};

TEST_P(MjcfModels, have_joints_as_expected) {
  const Model& model = import.model;
  int moving = 0;
  for (const Joint& own : model.joints) moving += own.moves() && own.kind != JointKind::tendon;
  EXPECT_EQ(moving, expected["moving_joints"].get<int>());
  EXPECT_EQ(model.roots.size(), 1u);
  EXPECT_EQ(model.roots.at(0).floating, expected["root"] == "floating");
  for (int i = 0; i < 3; ++i)
    EXPECT_EQ(model.gravity[i], expected["gravity"][static_cast<std::size_t>(i)].get<double>());
  for (const json& wanted : expected["joints"]) {
    const Joint& own = joint(model, wanted["name"]);
    SCOPED_TRACE(own.name);
    const string kind = wanted["kind"];
    EXPECT_EQ(own.kind, kind == "prismatic"  ? JointKind::prismatic
                        : kind == "revolute" ? JointKind::revolute
                                             : JointKind::continuous);
    EXPECT_NEAR(own.position, wanted["position"].get<double>(), 1e-9);
    EXPECT_NEAR(own.damping, wanted["damping"].get<double>(), 1e-9);
    EXPECT_NEAR(own.armature, wanted["armature"].get<double>(), 1e-9);
    EXPECT_NEAR(own.friction, wanted["friction"].get<double>(), 1e-9);
    expect_near(own.lower, wanted.value("lower", -infinity));
    expect_near(own.upper, wanted.value("upper", infinity));
    const json spring = wanted.value("spring", json::object()), drive = wanted.value("drive", json::object());
    EXPECT_NEAR(own.stiffness, spring.value("stiffness", 0.0), 1e-9);
    EXPECT_NEAR(own.rest, spring.value("rest", own.rest), 1e-9);
    EXPECT_NEAR(own.drive.kp, drive.value("kp", 0.0), 1e-9 * (1.0 + own.drive.kp));
    EXPECT_NEAR(own.drive.kd, drive.value("kd", 0.0), 1e-9 * (1.0 + own.drive.kd));
    expect_near(own.effort_limit, wanted.value("effort_limit", infinity));
  }
}

TEST_P(MjcfModels, have_couplings_as_expected) {
  const json& wanted = expected["couplings"];
  std::erase_if(import.model.couplings, [&](const Coupling& coupling) {
    return joint(import.model, coupling.joint).kind == JointKind::tendon;
  });
  ASSERT_EQ(import.model.couplings.size(), wanted.size());
  for (std::size_t c = 0; c < wanted.size(); ++c) {
    const Coupling& own = import.model.couplings[c];
    EXPECT_EQ(own.joint, wanted[c]["joint"]);
    EXPECT_NEAR(own.offset, wanted[c]["offset"].get<double>(), 1e-12);
    ASSERT_EQ(own.terms.size(), wanted[c]["terms"].size());
    for (std::size_t t = 0; t < own.terms.size(); ++t) {
      EXPECT_EQ(own.terms[t].joint, wanted[c]["terms"][t]["joint"]);
      EXPECT_NEAR(own.terms[t].ratio, wanted[c]["terms"][t]["ratio"].get<double>(), 1e-9);
    }
  }
}

// MuJoCo's energies, and the diagonal of its mass matrix as twice the kinetic energy of unit velocities.
TEST_P(MjcfModels, have_the_energies_of_mujoco) {
  Model model = import.model;
  model.couplings.clear();
  std::erase_if(model.joints, [](const Joint& own) { return own.kind == JointKind::tendon; });
  for (Joint& own : model.joints) own.lower = -infinity, own.upper = infinity, own.drive = {};
  const Plan plan = compile(model, {.ignore = {.position_limits = true}});
  Batch<double> batch(plan, 1);
  const bool floats = model.roots[0].floating;
  const json& at_start = expected["at_qpos0"]["mass_matrix_diagonal"];
  const auto motion = [&](std::size_t dof, double velocity) {
    if (!floats || dof >= 6) {
      const string name = expected["joints"][dof - (floats ? 6 : 0)]["name"];
      batch.velocities()(plan.dof(name), 0) = velocity;
      return;
    }
    if (dof >= 3) {
      batch.root_velocities()(static_cast<Eigen::Index>(dof - 3), 0) = velocity;
      return;
    }
    batch.root_velocities()(static_cast<Eigen::Index>(dof + 3), 0) = velocity;  // all directions weigh the same
  };
  const auto expect = [&](const json& facts) {
    const json& diagonal = facts["mass_matrix_diagonal"];
    for (std::size_t dof = 0; dof < diagonal.size(); ++dof) {
      motion(dof, 1.0);
      const double wanted = diagonal[dof];
      EXPECT_NEAR(2.0 * batch.kinetic_energies()(0, 0), wanted, 1e-6 * wanted) << "dof " << dof;
      motion(dof, 0.0);
    }
    return batch.potential_energies()(0, 0) - facts["energy_gravity"].get<double>();
  };
  ASSERT_EQ(at_start.size(), expected["joints"].size() + (floats ? 6 : 0));
  for (const json& wanted : expected["joints"])
    batch.positions()(plan.dof(wanted["name"].get<string>()), 0) = wanted["position"].get<double>();
  // What stands still in the world has a constant energy, of meshes in some files.
  const double constant = expect(expected["at_qpos0"]);
  const json& test = expected["at_test"]["qpos"];
  for (std::size_t j = 0; j < expected["joints"].size(); ++j)
    batch.positions()(plan.dof(expected["joints"][j]["name"].get<string>()), 0) =
        test[j + (floats ? 7 : 0)].get<double>();
  EXPECT_NEAR(expect(expected["at_test"]), constant, 1e-6);
  double mass = 0.0;
  for (const Link& own : model.links) mass += own.inertia.mass;
  if (report_of(import).find("meshes that give") == string::npos) {
    EXPECT_NEAR(mass, expected["total_mass"].get<double>(), 1e-9);
    EXPECT_NEAR(constant, 0.0, 1e-6);
  }
}

const auto name_of_file = [](const auto& file) {
  string name = std::filesystem::path(file.param.expected).parent_path().filename();
  if (name == "of_shared_robots") name = std::filesystem::path(file.param.model).stem();
  return name;
};
const auto readable = testing::Values(
    File{"mjcf/panda_hand/hand.xml", "mjcf/panda_hand/expected.json"},
    File{"mjcf/panda/panda.xml", "mjcf/panda/expected.json"},
    File{"mjcf/talos/talos_position.xml", "mjcf/talos/expected.json"},
    File{"mjcf/wx250s/wx250s.xml", "mjcf/wx250s/expected.json"},
    File{"mjcf/lite6_gripper/lite6_gripper_narrow.xml", "mjcf/lite6_gripper/expected.json"},
    File{"mjcf/robotiq_2f85_v4/2f85.xml", "mjcf/robotiq_2f85_v4/expected.json"},
    File{"mjcf/robotiq_140/robotiq_gripper_140.xml", "mjcf/robotiq_140/expected.json"},
    File{"mjcf/jaco_gripper/jaco_three_finger_gripper.xml", "mjcf/jaco_gripper/expected.json"},
    File{"mjcf/manipulator/manipulator.xml", "mjcf/manipulator/expected.json"},
    File{"mjcf/shadow_hand/right_hand.xml", "mjcf/shadow_hand/expected.json"},
    File{"mjcf/openarm/openarm.xml", "mjcf/openarm/expected.json"},
    File{"mjcf/toddlerbot/toddlerbot_2xc_mjx.xml", "mjcf/toddlerbot/expected.json"},
    File{"robots/mjcf_armature_equivalence.xml", "mjcf/of_shared_robots/mjcf_armature_equivalence.expected.json"},
    File{"robots/mjcf_car.xml", "mjcf/of_shared_robots/mjcf_car.expected.json"},
    File{"robots/mjcf_xarm_gripper.xml", "mjcf/of_shared_robots/mjcf_xarm_gripper.expected.json"});
// A coupling that is not linear.
const auto curved = testing::Values(
    File{"robots/mjcf_newton_constraints.xml", "mjcf/of_shared_robots/mjcf_newton_constraints.expected.json"});

INSTANTIATE_TEST_SUITE_P(readable, MjcfRobots, readable, name_of_file);
INSTANTIATE_TEST_SUITE_P(curved, MjcfRobots, curved, name_of_file);
INSTANTIATE_TEST_SUITE_P(readable, MjcfModels, readable, name_of_file);

}  // namespace
}  // namespace lockstep
