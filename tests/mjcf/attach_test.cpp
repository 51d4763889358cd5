// Models within models, and files of other folders. SPDX-License-Identifier: Apache-2.0
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "lockstep/error.h"
#include "unit/import_helpers.h"

namespace lockstep {
namespace {

namespace fs = std::filesystem;
using std::string;

// A hinge that carries another, and a body beside them.
const string kid = R"(<mujoco model="kid"><compiler angle="radian"/>
<option timestep="0.25"/>
<default><joint damping="0.7"/><geom density="500"/><default class="slow"><joint damping="2"/></default></default>
<worldbody>
<body name="a" pos="0 0 0.5"><joint name="j" axis="0 1 0" range="-1 1"/><geom name="g" size="0.1"/>
<body name="b" pos="0.5 0 0"><joint name="k" class="slow"/><geom name="h" size="0.1"/><site name="tip"/></body></body>
<body name="other"><joint name="o"/><geom size="0.1"/></body></worldbody>
<tendon><fixed name="t"><joint joint="j" coef="1"/><joint joint="o" coef="1"/></fixed></tendon>
<equality><joint joint1="k" joint2="j"/></equality>
<actuator><motor name="j" joint="j"/><motor name="o" joint="o"/><position name="t" tendon="t"/></actuator>
<keyframe><key name="home" qpos="1 2 3"/></keyframe></mujoco>)";

string attaching(const string& attach, const string& beside = "", const string& files = "<model file='kid.xml'/>") {
  return "<mujoco><default><joint damping='0.1'/></default>\n<asset>" + files + "</asset>\n<worldbody>" + attach +
         "</worldbody>" + beside + "</mujoco>";
}

class MjcfAttach : public testing::Test {
 protected:
  void SetUp() override {
    folder = fs::temp_directory_path() / ("lockstep_attach_" + std::to_string(getpid()));
    fs::create_directories(folder / "robot/parts");
    fs::create_directories(folder / "common");
    write("robot/kid.xml", kid);
  }
  void TearDown() override { fs::remove_all(folder); }
  void write(const string& name, const string& text) const { std::ofstream(folder / name) << text; }
  Import read(const string& text, const ImportOptions& options = {}) const {
    write("robot/main.xml", text);
    return import_mjcf_file(folder / "robot/main.xml", options);
  }
  void expect_refused(const string& text, const string& place, const string& rule, const string& remedy = "",
                      const ImportOptions& options = {}) const {
    try {
      read(text, options);
      ADD_FAILURE() << "accepted: " << text;
    } catch (const ImportError& error) {
      EXPECT_NE(error.element().find(place), string::npos) << error.what();
      EXPECT_NE(error.rule().find(rule), string::npos) << error.what();
      EXPECT_NE(error.remedy().find(remedy), string::npos) << error.what();
    }
  }
  fs::path folder;
};

bool reports(const Import& import, const string& part) { return report_of(import).find(part) != string::npos; }

std::vector<string> joints_of(const Model& model) {
  std::vector<string> names;
  for (const Joint& own : model.joints) names.push_back(own.name);
  return names;
}

TEST_F(MjcfAttach, brings_a_body_with_its_own_classes_and_angles) {
  const Import import =
      read(attaching("<body name='x'><joint name='x' range='-90 90'/><geom size='0.1'/>"
                     "<frame pos='0 0 1'><attach model='kid' body='a' prefix='l_'/></frame></body>"));
  const Model& model = import.model;
  EXPECT_EQ(joints_of(model), (std::vector<string>{"x", "l_j", "l_k"}));
  EXPECT_NEAR(joint(model, "x").upper, 0.5 * EIGEN_PI, 1e-12);
  EXPECT_EQ(joint(model, "l_j").upper, 1.0);
  EXPECT_EQ(joint(model, "x").damping, 0.1);
  EXPECT_EQ(joint(model, "l_j").damping, 0.7);
  EXPECT_EQ(joint(model, "l_k").damping, 2.0);
  EXPECT_EQ(joint(model, "l_j").origin.translation(), Eigen::Vector3d(0, 0, 1.5));
  const double ball = 4.0 / 3.0 * EIGEN_PI * 1e-3;
  EXPECT_NEAR(model.links.back().inertia.mass, 500 * ball, 1e-12);
  EXPECT_EQ(model.sites.at(0).name, "l_tip");
  EXPECT_EQ(model.time_step, 0.0);
  ASSERT_EQ(model.couplings.size(), 1u);
  EXPECT_EQ(model.couplings[0].joint, "l_k");
  EXPECT_TRUE(reports(import, "elements of attached models that name what is not attached, left out (3)"))
      << report_of(import);
  EXPECT_TRUE(reports(import, "efforts by the file's controls u (1): l_j of l_j")) << report_of(import);
  EXPECT_TRUE(warns(import, "keyframes of attached models, left out (1)")) << report_of(import);
}

TEST_F(MjcfAttach, brings_a_whole_world_and_the_same_model_again) {
  const Import import =
      read(attaching("<attach model='kid' prefix='l_'/><frame pos='0 2 0'>"
                     "<attach model='kid' body='b' prefix='r_'/></frame>"));
  EXPECT_EQ(joints_of(import.model), (std::vector<string>{"l_j", "l_k", "l_o", "r_k", "l_t"}));
  EXPECT_EQ(joint(import.model, "r_k").origin.translation(), Eigen::Vector3d(0.5, 2, 0));
  expect_refused(attaching("<attach model='kid' body='a' prefix='p'/><attach model='kid' body='b' prefix='p'/>"),
                 "kid.xml", "taken");
}

TEST_F(MjcfAttach, nests) {
  write("robot/parts/two.xml",
        "<mujoco model='two'><asset><model name='k' file='../kid.xml'/></asset><worldbody>"
        "<attach model='k' body='a' prefix='in_'/></worldbody>"
        "<actuator><motor joint='in_j'/></actuator></mujoco>");
  const Import import =
      read(attaching("<attach model='two' prefix='out_'/>", "<actuator><motor name='m' joint='out_in_k'/></actuator>",
                     "<model file='parts/two.xml'/>"));
  EXPECT_EQ(joints_of(import.model), (std::vector<string>{"out_in_j", "out_in_k"}));
  write("robot/kid.xml", attaching("<attach model='kid' prefix='k'/>", "", "<model name='kid' file='kid.xml'/>"));
  expect_refused(attaching("<attach model='k' prefix=''/>", "", "<model name='k' file='kid.xml'/>"), "kid.xml:3",
                 "deeper than 20");
  write("robot/kid.xml", attaching("<attach model='kid' prefix='k'/><attach model='kid' prefix='l'/>", "",
                                   "<model name='kid' file='kid.xml'/>"));
  expect_refused(attaching("<attach model='k' prefix=''/>", "", "<model name='k' file='kid.xml'/>"), "kid.xml:3",
                 "deeper than 20");
}

TEST_F(MjcfAttach, names_what_it_cannot_find) {
  expect_refused(attaching("<attach model='kid' body='c' prefix=''/>"), "main.xml:3: <attach>", "names body 'c'");
  expect_refused(attaching("<attach model='kit' body='a' prefix=''/>"), "main.xml:3: <attach>", "names model 'kit'",
                 "'kid' exists");
  expect_refused(attaching("<attach model='kid'/>"), "main.xml:3: <attach>", "no attribute 'prefix'");
  expect_refused(attaching("<attach model='kid' prefix=''/>", "", "<model file='none.xml'/>"), "main.xml:2: <model>",
                 "does not exist");
  expect_refused(attaching("<attach model='u' prefix=''/>", "", "<model name='u' file='u.xml'/>"), "main.xml:2",
                 "does not exist");
  write("robot/u.xml", "<robot name='u'/>");
  expect_refused(attaching("<attach model='u' prefix=''/>", "", "<model name='u' file='u.xml'/>"), "main.xml:3",
                 "no MJCF");
  EXPECT_THROW(import_mjcf(attaching("<attach model='kid' prefix=''/>")), ImportError);
}

TEST_F(MjcfAttach, reads_further_folders_where_an_option_says_so) {
  write("common/arm.xml", "<mujocoinclude><body><joint name='arm'/><geom size='0.1'/></body></mujocoinclude>");
  write("common/kid.xml", kid);
  const string including = "<mujoco><worldbody><include file='../common/arm.xml'/></worldbody></mujoco>";
  const string model = attaching("<attach model='kid' body='a' prefix=''/>", "", "<model file='../common/kid.xml'/>");
  expect_refused(including, "main.xml:1: <include>", "outside of the folders that may be read", "file_roots");
  expect_refused(model, "main.xml:2: <model>", "outside of the folders that may be read", "file_roots");
  EXPECT_EQ(joints_of(read(including, {.file_roots = {folder / "common"}}).model), std::vector<string>{"arm"});
  EXPECT_EQ(read(model, {.file_roots = {folder / "common"}}).model.joints.size(), 2u);
  fs::create_symlink("/etc", folder / "common/link");
  expect_refused("<mujoco><include file='../common/link/passwd'/></mujoco>", "main.xml:1", "outside of the folders",
                 "file_roots", {.file_roots = {folder / "common"}});
}

TEST_F(MjcfAttach, takes_no_file_that_is_not_regular) {
  ASSERT_EQ(mkfifo((folder / "robot/pipe.xml").c_str(), 0600), 0);
  for (const string text : {"<mujoco><include file='pipe.xml'/></mujoco>", "<mujoco/>"}) try {
      text == "<mujoco/>" ? import_file(folder / "robot/pipe.xml") : read(text);
      ADD_FAILURE() << "accepted";
    } catch (const ImportError& error) {
      EXPECT_NE(error.rule().find("no regular file"), string::npos) << error.what();
    }
}

}  // namespace
}  // namespace lockstep
