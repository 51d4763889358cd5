// All reasons for which a file is refused, and the options that read it. SPDX-License-Identifier: Apache-2.0
#include "tool/fix.h"

#include <cstdlib>

#include "command.h"

namespace lockstep::tool {
namespace {

using std::string;

const string inertial =
    "<inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial>";
const string impossible =
    "<inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='3'/></inertial>";
const string ball = "<collision><geometry><sphere radius='0.1'/></geometry></collision>";
const string no_mesh = "<collision><geometry><mesh filename='none.stl'/></geometry></collision>";
const string swapped = "<limit lower='1' upper='-1' effort='1' velocity='1'/>";

string link(const string& name, const string& inside) { return "<link name='" + name + "'>" + inside + "</link>"; }
string joint(const string& name, const string& child, const string& inside = "") {
  return "<joint name='" + name + "' type='revolute'><parent link='base'/><child link='" + child + "'/>" + inside +
         "</joint>\n";
}
string robot(const string& inside) { return "<robot name='r'><link name='base'/>\n" + inside + "</robot>"; }
string moved(const string& body, const string& in_joint = "") {
  return robot(link("a", body) + joint("j", "a", in_joint));
}

class Fixes : public Command {
 protected:
  // The options that the last line proposes; empty if it proposes none.
  string proposed(const string& text, const Arguments& given = {}) {
    Arguments arguments{"info", write("robot.urdf", text)};
    arguments.insert(arguments.end(), given.begin(), given.end());
    const Ran ran = run(arguments);
    EXPECT_EQ(ran.status, 2) << ran.err;
    const string last = lines(ran.err).back(), file = "robot.urdf'";
    if (!last.starts_with("lockstep: it is read by: ")) return "";
    string options = last.substr(last.find(file) + file.size() + 1);
    for (const string& argument : given) {
      EXPECT_TRUE(options.starts_with(argument)) << last;
      options.erase(0, argument.size() + 1);
    }
    // What is proposed is read, in the words of a shell.
    EXPECT_EQ(std::system((last.substr(last.find("by: ") + 4) + " >/dev/null 2>&1").c_str()), 0) << last;
    return options;
  }
};

TEST_F(Fixes, name_the_options_that_are_needed_and_no_more) {
  EXPECT_EQ(proposed(moved(ball)), "--density 1000");
  EXPECT_EQ(proposed(moved("")), "--least-mass 0.01 --least-inertia 1e-5");
  EXPECT_EQ(proposed(moved("<inertial><mass value='1'/></inertial>")), "--least-inertia 1e-5");
  EXPECT_EQ(proposed(moved(impossible)), "--repair-inertias");
  EXPECT_EQ(proposed(moved(inertial, swapped)), "--ignore position_limits:j");
  EXPECT_EQ(proposed(robot(link("a", inertial) + joint("j", "a") + joint("k", "a"))), "--leave-out-foreign");
  EXPECT_EQ(proposed(moved(inertial + no_mesh), {"--colliders"}), "--leave-out-meshes");
  // Density alone would want the mesh; bounds do without it and without --leave-out-meshes.
  EXPECT_EQ(proposed(moved(no_mesh)), "--least-mass 0.01 --least-inertia 1e-5");
  EXPECT_EQ(proposed(robot(link("a", ball) + joint("j", "a", swapped) + link("b", inertial) +
                           joint("k b", "b", swapped) + joint("again", "b"))),
            "--leave-out-foreign --ignore position_limits:j --ignore 'position_limits:k b' --density 1000");
}

TEST_F(Fixes, go_with_the_options_that_are_given) {
  EXPECT_EQ(proposed(moved("", swapped), {"--ignore", "friction", "--least-mass", "1", "--armature", "0.1"}),
            "--ignore position_limits:j");
}

TEST_F(Fixes, are_not_proposed_where_none_helps) {
  EXPECT_EQ(proposed(moved(inertial, "<axis xyz='0 0 0'/>")), "");
  EXPECT_EQ(proposed(moved("", "<axis xyz='0 0 0'/>")), "");
  EXPECT_EQ(proposed("<robot name='r'/>"), "");
}

TEST_F(Fixes, of_mjcf_are_of_mjcf) {
  const string text =
      "<mujoco><worldbody><body><joint/><geom type='sphere' size='0.1' mass='0'/></body></worldbody></mujoco>";
  EXPECT_EQ(proposed(text), "--least-mass 0.01 --least-inertia 1e-5");
}

TEST_F(Fixes, have_a_line_for_each_reason) {
  const Ran ran = run({"simulate", write("robot.urdf", robot(link("a", ball) + joint("j", "a", swapped)))});
  const std::vector<string> said = lines(ran.err);
  ASSERT_EQ(said.size(), 3u) << ran.err;
  EXPECT_NE(said[0].find("robot.urdf:2: joint 'j': position range is empty"), string::npos) << said[0];
  EXPECT_NE(said[0].find("--ignore"), string::npos) << said[0];
  EXPECT_NE(said[1].find("robot.urdf:2: link 'a': moves, but"), string::npos) << said[1];
  EXPECT_TRUE(said[2].ends_with("--ignore position_limits:j --density 1000")) << said[2];
}

TEST_F(Fixes, are_taken_on_request_and_shown) {
  const string file = write("robot.urdf", robot(link("a", ball) + joint("j", "a", swapped)));
  const Ran ran = run({"info", file, "--fix"});
  EXPECT_EQ(ran.status, 0) << ran.err;
  for (const char* said : {"Refused as it is:\n", "joint 'j': position range is empty (lower > upper)\n",
                           "Assumed by --fix: --ignore position_limits:j --density 1000\n",
                           "  inertia from collision shapes of 1000 kg/m^3 (1): a\n",
                           "left out because they are ignored (1): j (position)"})
    EXPECT_NE(ran.out.find(said), string::npos) << ran.out << " does not say: " << said;
  const Ran fine = run({"info", model, "--fix"});
  EXPECT_EQ(fine.status, 0);
  EXPECT_TRUE(fine.out.starts_with("Nothing to fix\n")) << fine.out;
  EXPECT_EQ(run({"info", write("worse.urdf", moved("", "<axis xyz='0 0 0'/>")), "--fix"}).status, 2);
}

TEST(Words, are_quoted_for_a_shell) {
  EXPECT_EQ(shell_words({"info", "a b", "it's", "", "$HOME", "x=1,2"}), "info 'a b' 'it'\\''s' '' '$HOME' x=1,2");
}

}  // namespace
}  // namespace lockstep::tool
