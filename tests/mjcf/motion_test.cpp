// What is read from MJCF moves as in MuJoCo. SPDX-License-Identifier: Apache-2.0
//
// Couplings are stiff in MuJoCo; contacts, limits and dry friction are off on both sides. Servos, springs, damping and
// limits of effort are those of the files.
#include "mjcf/mujoco.h"

#include "lockstep/import.h"

namespace lockstep {
namespace {

struct File {
  const char* path;  // below tests/mjcf/models or LOCKSTEP_TEST_DATA
  const char* key = "";
  const char* mujoco_step = "1e-4";  // s; Runge-Kutta diverges with stiff servos on light links
  double step = 5e-5;                // s; Euler needs smaller ones
  const char* loops = "";            // s that they are held for, else they are left out for half a second
};

void PrintTo(const File& file, std::ostream* stream) { *stream << file.path; }

class MjcfMotion : public MujocoTest, public testing::WithParamInterface<File> {
 protected:
  void expect_motion(const std::filesystem::path& folder) {
    const File& given = GetParam();
    const std::filesystem::path file = folder / given.path;
    if (folder.empty() || !std::filesystem::exists(file)) GTEST_SKIP() << "no " << file;
    std::filesystem::copy(file.parent_path(), work, std::filesystem::copy_options::recursive);
    const bool held = *given.loops != '\0';
    const std::string motion = run(
        LOCKSTEP_MJCF "/motion.mjs",
        {work / file.filename(), held ? given.loops : "0.5", given.mujoco_step, held ? "held" : "left out", given.key});
    const Model model =
        import_mjcf_file(work / "motion.xml", {.keyframe = "motion", .loops = held ? Loops::keep : Loops::leave_out})
            .model;
    const Ignored ignore = {.position_limits = true, .velocity_limits = true, .friction = true};
    Batch<double> batch(compile(model, {.dt = given.step, .ignore = ignore, .guard = infinity}), 1);
    const Deviation result = follow(batch, motion);
    EXPECT_LT(result.difference, (held ? 1e-3 : 1e-4) * std::min(1.0, result.travel));
    EXPECT_GT(result.travel, 0.01);
    std::printf("%s: %.2g of %.2g\n", given.path, result.difference, result.travel);
  }
};

class MjcfModelMotion : public MjcfMotion {};
TEST_P(MjcfModelMotion, is_that_of_mujoco) { expect_motion(LOCKSTEP_MJCF "/models"); }

const auto name_of_file = [](const auto& file) { return std::filesystem::path(file.param.path).stem().string(); };

// Not tendons.xml: MuJoCo holds no equality of a tendon that names a joint twice.
INSTANTIATE_TEST_SUITE_P(models, MjcfModelMotion,
                         testing::Values(File{"hand.xml", "held", "1e-4", 1e-5}, File{"drives.xml", "0"},
                                         File{"several.xml", "moving"}, File{"frames.xml"}, File{"masses.xml", "0"},
                                         File{"pulled.xml", "0", "1e-4", 1e-5}, File{"balls.xml", "moving"},
                                         File{"spatial.xml", "moving", "1e-4", 1e-5}),
                         name_of_file);

class MjcfRobotMotion : public MjcfMotion {};
TEST_P(MjcfRobotMotion, is_that_of_mujoco) {
  const char* variable = std::getenv("LOCKSTEP_TEST_DATA");
  expect_motion(variable ? variable : LOCKSTEP_TEST_DATA);
}

INSTANTIATE_TEST_SUITE_P(
    data, MjcfRobotMotion,
    testing::Values(File{"mjcf/panda_hand/hand.xml"}, File{"mjcf/panda/panda.xml", "home"},
                    File{"mjcf/talos/talos_position.xml", "", "2e-5"}, File{"mjcf/wx250s/wx250s.xml", "home"},
                    File{"mjcf/lite6_gripper/lite6_gripper_narrow.xml", "home"}, File{"mjcf/robotiq_2f85_v4/2f85.xml"},
                    File{"mjcf/robotiq_140/robotiq_gripper_140.xml"},
                    File{"mjcf/jaco_gripper/jaco_three_finger_gripper.xml"},
                    File{"mjcf/manipulator/manipulator.xml", "", "2e-5"},
                    File{"mjcf/shadow_hand/right_hand.xml", "", "1e-4", 1e-5}, File{"mjcf/openarm/openarm.xml"},
                    File{"mjcf/toddlerbot/toddlerbot_2xc_mjx.xml", "home"},
                    File{"robots/mjcf_armature_equivalence.xml"}, File{"robots/mjcf_xarm_gripper.xml"}),
    name_of_file);
// The neck of the toddlerbot leaves its range after 0.2 s, and jams where MuJoCo's own results differ by radians.
INSTANTIATE_TEST_SUITE_P(loops, MjcfRobotMotion,
                         testing::Values(File{"mjcf/robotiq_2f85_v4/2f85.xml", "", "1e-4", 1e-4, "1"},
                                         File{"robots/mjcf_xarm_gripper.xml", "", "1e-4", 1e-4, "1"},
                                         File{"mjcf/toddlerbot/toddlerbot_2xc_mjx.xml", "home", "1e-4", 1e-4, "0.2"}),
                         name_of_file);

}  // namespace
}  // namespace lockstep
