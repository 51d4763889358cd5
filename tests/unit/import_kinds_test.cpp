// What people's files do beside the standard: read with the right couplings, or refused with a remedy.
// SPDX-License-Identifier: Apache-2.0
#include <cstdlib>

#include "import_helpers.h"
#include "lockstep/error.h"

namespace lockstep {
namespace {

using std::string;

// Joint `lead` in line 4 and joint `follow` in line 5, with this inside; `around` follows in line 6.
string pair(const string& lead, const string& follow, const string& around = "", const string& attributes = "") {
  const string turns = "type='revolute'><parent link='base'/><child link='";
  return "<robot name='r'><link name='base'/>\n<link name='a'>" + unit_body + "</link>\n<link name='b'>" + unit_body +
         "</link>\n<joint name='lead' " + turns + "a'/>" + lead + "</joint>\n<joint name='follow' " + attributes + " " +
         turns + "b'/>" + follow + "</joint>\n" + around + "</robot>";
}

const string doubles = "<mimic joint='lead' multiplier='2' offset='0.1'/>";
const string range = "<limit lower='-1' upper='1' effort='5' velocity='5'/>";
const string swapped = "<limit lower='1' upper='-1' effort='5' velocity='5'/>";

struct Case {
  const char* name;
  string text;
  string couplings;  // "follow = 2 lead + 0.1", separated by "; "
  const char* says;  // part of the report; of the warnings if it begins with "!"
  ImportOptions options = {};
};

void PrintTo(const Case& kind, std::ostream* stream) { *stream << kind.name; }

string couplings_of(const Model& model) {
  string text;
  for (const Coupling& coupling : model.couplings) {
    char line[200];
    std::snprintf(line, sizeof line, "%s%s = %g %s + %g", text.empty() ? "" : "; ", coupling.joint.c_str(),
                  -coupling.terms.at(0).ratio, coupling.terms.at(0).joint.c_str(), 0.0 - coupling.offset);
    text += line;
  }
  return text;
}

class ReadFiles : public testing::TestWithParam<Case> {};

TEST_P(ReadFiles, have_their_couplings_and_say_what_was_left_out) {
  const Case& kind = GetParam();
  const Import import = import_urdf(kind.text, "kind.urdf", kind.options);
  EXPECT_EQ(couplings_of(import.model), kind.couplings);
  const bool is_warning = kind.says[0] == '!';
  const string part = kind.says + is_warning;
  EXPECT_NE(report_of(import).find(part), string::npos) << report_of(import);
  if (is_warning) {
    EXPECT_TRUE(warns(import, part)) << report_of(import);
  } else {
    EXPECT_TRUE(import.warnings.empty()) << import.warnings.front();
  }
}

const string follows = "follow = 2 lead + 0.1";
const string gazebo_loop = "<gazebo>\n<joint name='close' type='revolute'/></gazebo>";
const string gazebo_mimic =
    "<gazebo><plugin name='p' filename='libmimic.so'><joint>lead</joint><mimicJoint>follow</mimicJoint>"
    "<multiplier>2</multiplier></plugin></gazebo>";
const string control_mimic =
    "<ros2_control name='c' type='system'><joint name='follow'><param name='mimic'>lead</param>"
    "<param name='multiplier'>2</param></joint></ros2_control>";
const string loop_joint = "<loop_joint name='close' type='spherical'><link1 link='a'/><link2 link='b'/></loop_joint>";
const string second_parent = "<joint name='close' type='revolute'><parent link='a'/><child link='b'/></joint>";
const JointSet followers = JointSet::of_followers();

INSTANTIATE_TEST_SUITE_P(
    kinds, ReadFiles,
    testing::Values(
        Case{"mimic", pair(range, doubles), follows, "1 coupling"},
        Case{"mimic_one_to_one", pair("", "<mimic joint='lead'/>"), "follow = 1 lead + 0", "1 coupling"},
        Case{"leader_follows_nobody", pair("<mimic joint='follow' multiplier='-0.5'/>", ""), "lead = -0.5 follow + 0",
             "1 coupling"},
        Case{"dynamics_as_elements", pair("<dynamics><damping>0.5</damping><friction>1</friction></dynamics>", doubles),
             follows,
             "!elements where URDF has attributes, not used (2): damping of dynamics of joint 'lead', friction of "},
        Case{"axis_as_attribute", pair("", doubles, "", "axis='0 0 1'"), follows,
             "!attributes where URDF has elements, not used (1): axis of joint 'follow'"},
        Case{"limit_as_elements", pair("<limit><effort>3</effort></limit>", doubles), follows,
             "!elements where URDF has attributes, not used (1): effort of limit of joint 'lead'"},
        Case{"misspelt", pair("<dynamic damping='1'/>", doubles), follows, "!unknown, not used"},
        Case{"unlimited_by_minus_one", pair("<limit lower='-1' upper='1' effort='-1' velocity='-1'/>", doubles),
             follows, "effort or velocity below 0, taken as unlimited (2): lead (effort), lead (velocity)"},
        Case{"swapped_but_ignored",
             pair(swapped, doubles),
             follows,
             "impossible bounds, left out because they are ignored (1): lead (position)",
             {.ignore = {.position_limits = true}}},
        Case{"swapped_but_ignored_by_name",
             pair(swapped, doubles),
             follows,
             "left out because they are ignored (1): lead (position)",
             {.ignore = {.position_limits = {"lead"}}}},
        Case{"swapped_follower_ignored",
             pair(range, doubles + swapped),
             follows,
             "left out because they are ignored (1): follow (position)",
             {.ignore = {.position_limits = followers}}},
        Case{"nan_but_ignored",
             pair("<limit lower='-inf' upper='inf' effort='nan' velocity='1'/>", doubles),
             follows,
             "ignored (2): lead (position), lead (effort)",
             {.ignore = {.position_limits = true, .effort_limits = true}}},
        Case{"negative_friction_ignored",
             pair("<dynamics friction='-1'/>", doubles),
             follows,
             "ignored (1): lead (friction)",
             {.ignore = {.friction = true}}},
        Case{"wrong_sign_of_a_range",
             pair("<limit lower='0' upper='1' effort='5' velocity='5'/>",
                  "<mimic joint='lead' multiplier='-1'/><limit lower='0' upper='1' effort='5' velocity='5'/>"),
             "follow = -1 lead + 0", "!followers whose limits leave their leader no room to move (1): follow"},
        Case{"wrong_sign_but_ignored",
             pair("<limit lower='0' upper='1' effort='5' velocity='5'/>",
                  "<mimic joint='lead' multiplier='-1'/><limit lower='0' upper='1' effort='5' velocity='5'/>"),
             "follow = -1 lead + 0",
             "position limits of 1 joint",
             {.ignore = {.position_limits = followers}}},
        Case{"starts_outside", pair("<limit lower='0.5' upper='1' effort='5' velocity='5'/>", doubles), follows,
             "!joints that start outside of their limits (1): lead at 0, not 0.5 to 1"},
        Case{"locked_by_default_limits", pair("<limit effort='5' velocity='5'/>", doubles), follows,
             "!joints that cannot move, lower = upper (1): lead"},
        Case{"loop_left_out",
             pair("", doubles, loop_joint),
             follows,
             "!left out on request (1): <loop_joint> 'close' closes a loop",
             {.leave_out_foreign = true}},
        Case{"gazebo_loop_left_out",
             pair("", doubles, gazebo_loop),
             follows,
             "!left out on request (1): <joint> 'close' is a joint for Gazebo alone",
             {.leave_out_foreign = true}},
        Case{"second_parent_left_out",
             pair("", doubles, second_parent),
             follows,
             "!left out on request (1): joint 'close', closes a loop at link 'b'",
             {.leave_out_foreign = true}},
        Case{"gazebo_mimic_twice", pair("", doubles, gazebo_mimic), follows, "not used: 1 gazebo"},
        Case{"control_mimic_twice", pair("", doubles, control_mimic), follows, "not used: 1 ros2_control"},
        Case{"gazebo_mimic_left_out",
             pair("", "", gazebo_mimic),
             "",
             "!left out on request (1): <plugin> couples joint 'follow' for Gazebo alone",
             {.leave_out_foreign = true}},
        Case{"umlauts",
             "<robot name='Gr\xc3\xbc\xc3\x9f"
             "e'><link name='\xe6\x89\x8b'/></robot>",
             "", "1 link"}),
    [](const auto& kind) { return string(kind.param.name); });

TEST(LoopJoints, have_frames_in_both_links) {
  const auto loop = [](const string& type, const string& inside = "") {
    return import_urdf(pair("", doubles,
                            "<loop_joint name='close' type='" + type +
                                "'><link1 link='a' xyz='1 2 3' rpy='0 0 0.5'/><link2 link='b' xyz='4 5 6'/>" + inside +
                                "</loop_joint>"))
        .model.loops.at(0);
  };
  for (const auto& [type, kind] : {std::pair<string, LoopKind>{"spherical", LoopKind::point},
                                   {"ball", LoopKind::point},
                                   {"revolute", LoopKind::hinge},
                                   {"continuous", LoopKind::hinge},
                                   {"prismatic", LoopKind::slider},
                                   {"fixed", LoopKind::weld}})
    EXPECT_EQ(loop(type).kind, kind) << type;
  const Loop own = loop("revolute", "<axis xyz='0 2 0'/>");
  EXPECT_EQ(own.name, "close");
  EXPECT_EQ(own.first, "a");
  EXPECT_EQ(own.second, "b");
  EXPECT_EQ(own.axis, Eigen::Vector3d(0.0, 2.0, 0.0));
  EXPECT_EQ(loop("revolute").axis, Eigen::Vector3d::UnitX());
  EXPECT_EQ(Eigen::Vector3d(own.first_pose.translation()), Eigen::Vector3d(1.0, 2.0, 3.0));
  EXPECT_EQ(Eigen::Vector3d(own.second_pose.translation()), Eigen::Vector3d(4.0, 5.0, 6.0));
  EXPECT_EQ(loop("fixed", "<axis xyz='0 0 0'/>").kind, LoopKind::weld);  // which has no axis
  EXPECT_NEAR(own.first_pose.linear()(1, 0), std::sin(0.5), 1e-15);      // rpy 0 0 0.5 turns x towards y
  EXPECT_TRUE(own.second_pose.linear().isIdentity(0.0));
}

struct Refused {
  const char* name;
  string text;
  const char* element;  // a part of it
  const char* rule;     // a part of it
  const char* remedy;   // a part of it
  ImportOptions options = {};
};

void PrintTo(const Refused& kind, std::ostream* stream) { *stream << kind.name; }

class RefusedFiles : public testing::TestWithParam<Refused> {};

TEST_P(RefusedFiles, name_place_rule_and_remedy) {
  const Refused& kind = GetParam();
  try {
    const Import import = import_urdf(kind.text, "kind.urdf", kind.options);
    FAIL() << "accepted\n" << report_of(import);
  } catch (const Error& error) {
    EXPECT_NE(error.element().find(kind.element), string::npos) << error.what();
    EXPECT_NE(error.rule().find(kind.rule), string::npos) << error.what();
    EXPECT_NE(error.remedy().find(kind.remedy), string::npos) << error.what();
  }
}

const char* const as_attributes = "write joint, multiplier and offset as attributes";
const char* const write_mimic = "write <mimic joint=";
const char* const leave_out = "ImportOptions::leave_out_foreign";

string foreign(const string& element) { return pair("", doubles, element); }

INSTANTIATE_TEST_SUITE_P(
    mimics, RefusedFiles,
    testing::Values(Refused{"multiplier_as_element", pair("", "<mimic joint='lead'><multiplier>2</multiplier></mimic>"),
                            "kind.urdf:5: mimic of joint 'follow'", "holds <multiplier>", as_attributes},
                    Refused{"offset_as_element", pair("", "<mimic joint='lead'><offset>2</offset></mimic>"),
                            "kind.urdf:5: mimic", "holds <offset>", as_attributes},
                    Refused{"joint_as_element", pair("", "<mimic><joint>lead</joint></mimic>"), "kind.urdf:5: mimic",
                            "has no attribute 'joint'", "write joint="},
                    Refused{"joint_as_text", pair("", "<mimic>lead</mimic>"), "kind.urdf:5: mimic",
                            "has no attribute 'joint'", "write joint="},
                    Refused{"text_beside", pair("", "<mimic joint='lead'>2</mimic>"), "kind.urdf:5: mimic",
                            "the text '2'", as_attributes},
                    Refused{"another_factor", pair("", "<mimic joint='lead' ratio='2'/>"), "kind.urdf:5: mimic",
                            "an attribute 'ratio'", as_attributes},
                    Refused{"mimic_as_attribute", pair("", "", "", "mimic='lead'"), "kind.urdf:5: joint 'follow'",
                            "holds 'mimic'", write_mimic},
                    Refused{"mimic_joint_as_attribute", pair("", "", "", "mimic_joint='lead'"),
                            "kind.urdf:5: joint 'follow'", "holds 'mimic_joint'", write_mimic},
                    Refused{"capital_mimic", pair("", "<Mimic joint='lead'/>"), "kind.urdf:5: joint 'follow'",
                            "holds 'Mimic'", write_mimic},
                    Refused{"mimic_beside_joints", foreign("<mimic joint='lead'/>"), "kind.urdf:1: robot 'r'",
                            "holds 'mimic'", write_mimic},
                    Refused{"two_mimics", pair("", doubles + doubles), "kind.urdf:5: mimic of joint 'follow'",
                            "already", "keep one"}),
    [](const auto& kind) { return string(kind.param.name); });

INSTANTIATE_TEST_SUITE_P(
    foreign, RefusedFiles,
    testing::Values(
        Refused{"loop_of_a_planar_joint",
                foreign("<loop_joint name='close' type='planar'><link1 link='a'/><link2 link='b'/></loop_joint>"),
                "kind.urdf:6: loop_joint 'close'", "is of type 'planar'", leave_out},
        Refused{"loop_with_one_end", foreign("<loop_joint name='close' type='fixed'><link1 link='a'/></loop_joint>"),
                "kind.urdf:6: loop_joint 'close'", "has no <link2>", "add <link2"},
        Refused{"loop_with_an_end_twice",
                foreign("<loop_joint name='close' type='fixed'><link1 link='a'/><link1 link='b'/></loop_joint>"),
                "kind.urdf:6: link1 of loop_joint 'close'", "is there already", "keep one"},
        Refused{"loop_of_no_link",
                foreign("<loop_joint name='close' type='fixed'><link1 link='a'/><link2 link='z'/></loop_joint>"),
                "kind.urdf:6: loop_joint 'close'", "holds link 'z', which does not exist", "correct"},
        Refused{"gazebo_loop", foreign(gazebo_loop), "kind.urdf:7: <joint>", "for Gazebo alone", leave_out},
        Refused{"gazebo_mimic", pair("", "", gazebo_mimic), "kind.urdf:6: <plugin>", "couples joint 'follow'",
                leave_out},
        Refused{"control_mimic", pair("", "", control_mimic), "kind.urdf:6: <joint>", "couples joint 'follow'",
                leave_out},
        Refused{"drake_ball", foreign("<drake:ball_constraint/>"), "kind.urdf:6: <drake:ball_constraint>",
                "closes a loop", leave_out},
        Refused{"drake_bushing", foreign("<drake:linear_bushing_rpy/>"), "kind.urdf:6: <drake:linear_bushing_rpy>",
                "closes a loop by springs", leave_out},
        Refused{"drake_joint", foreign("<drake:joint name='j' type='ball'/>"), "kind.urdf:6: <drake:joint>",
                "is a joint of Drake's", leave_out},
        Refused{"mujoco_equality", foreign("<mujoco><equality/></mujoco>"), "kind.urdf:6: <equality>",
                "for MuJoCo alone", leave_out},
        Refused{"second_parent", foreign(second_parent), "kind.urdf:6: joint 'close'",
                "carries link 'b', as joint 'follow' does already: that closes a loop", leave_out},
        Refused{"quaternion",
                foreign("<joint name='f' type='fixed'><parent link='a'/><child link='c'/>"
                        "<origin quat_xyzw='0 0 0 1'/></joint><link name='c'/>"),
                "kind.urdf:6: origin of joint 'f'", "quat_xyzw", "rpy"}),
    [](const auto& kind) { return string(kind.param.name); });

string named(const string& name) { return "<robot name='r'>\n<link name='" + name + "'/></robot>"; }

INSTANTIATE_TEST_SUITE_P(
    bounds_and_names, RefusedFiles,
    testing::Values(
        Refused{"swapped", pair(swapped, doubles), "kind.urdf:4: joint 'lead'", "lower > upper", "swap"},
        Refused{"swapped_leader",
                pair(swapped, doubles),
                "kind.urdf:4: joint 'lead'",
                "lower > upper",
                "swap",
                {.ignore = {.position_limits = followers}}},
        Refused{"ignored_joint_unknown",
                pair(range, doubles),
                "ImportOptions::ignore",
                "names 'laed'",
                "'lead' exists",
                {.ignore = {.friction = {"laed"}}}},
        Refused{"negative_density",
                pair(range, doubles),
                "ImportOptions::density",
                "negative",
                "above 0",
                {.density = -1.0}},
        Refused{"invalid_utf8", named("a\xff"), "kind.urdf:2: <link>", "name=\"a\\xff\"", "plain characters"},
        Refused{"overlong_utf8", named("\xc0\xaf"), "kind.urdf:2: <link>", "\\xc0\\xaf", "plain characters"},
        Refused{"overlong_of_three", named("\xe0\x80\xaf"), "kind.urdf:2: <link>", "\\xe0\\x80\\xaf",
                "plain characters"},
        Refused{"surrogate", named("\xed\xa0\x80"), "kind.urdf:2: <link>", "invalid UTF-8", "plain characters"},
        Refused{"escape", named("\x1b[31m"), "kind.urdf:2: <link>", "\\x1b[31m", "plain characters"},
        Refused{"turned_around",
                named("a\xe2\x80\xae"
                      "b"),
                "kind.urdf:2: <link>", "a\\u202eb", "plain characters"},
        Refused{"invisible",
                named("a\xe2\x80\x8b"
                      "b"),
                "kind.urdf:2: <link>", "a\\u200bb", "plain characters"},
        Refused{"control_in_a_type",
                "<robot name='r'><link name='a'/><link name='b'/>\n<joint name='j' type='\x1b[2J'>"
                "<parent link='a'/><child link='b'/></joint></robot>",
                "kind.urdf:2: joint 'j'", "\\x1b[2J", "plain characters"}),
    [](const auto& kind) { return string(kind.param.name); });

// The inputs of the folder `field` beside the data of the tests.
TEST(FieldFiles, are_read_or_refused_as_their_kinds_are) {
  const char* variable = std::getenv("LOCKSTEP_TEST_DATA");
  const string folder = variable ? variable : LOCKSTEP_TEST_DATA;
  if (folder.empty()) GTEST_SKIP() << "LOCKSTEP_TEST_DATA names no folder";
  const auto read = [&](const string& name, const ImportOptions& options = {}) {
    return import_urdf_file(folder + "/field/" + name + ".urdf", options);
  };
  for (const char* name : {"welded_sensor", "bolted_root", "massless_foot", "thin_plate_rounded", "point_mass",
                           "mass_only", "effort_minus_one", "sdf_style_dynamics"})
    EXPECT_NO_THROW(read(name)) << name;
  for (const char* name : {"sdf_style_mimic", "attribute_for_element"}) EXPECT_THROW(read(name), ImportError) << name;
  EXPECT_THROW(read("limits_swapped"), ModelError);
  EXPECT_NO_THROW(read("limits_swapped", {.ignore = {.position_limits = true}}));
  EXPECT_TRUE(warns(read("follower_sign"), "no room to move (1): fb"));
}

bool warns_that_nothing_touches(const Import& import) {
  for (const std::string& warning : import.warnings)
    if (warning.find("colliders that touch nothing") != std::string::npos) return true;
  return false;
}

TEST(Import, warns_of_colliders_that_touch_nothing) {
  ImportOptions options{.colliders = true};
  EXPECT_TRUE(warns_that_nothing_touches(import_urdf_file(LOCKSTEP_MODELS "/arm_gripper.urdf", options)));
  options.change = [](Model& model) { model.contacts = {{"left_tip", "box"}}; };
  EXPECT_FALSE(warns_that_nothing_touches(import_urdf_file(LOCKSTEP_MODELS "/arm_gripper.urdf", options)));
  EXPECT_FALSE(warns_that_nothing_touches(import_urdf_file(LOCKSTEP_MODELS "/arm_gripper.urdf", {})));
}

TEST(Import, names_colliders_at_the_ends_of_chains_where_others_are_amid_them) {
  const Import gripper = import_urdf_file(LOCKSTEP_MODELS "/arm_gripper.urdf", {.colliders = true});
  const string line = "colliders at the ends of chains, which Model::end_colliders() lists";
  expect_reports(gripper, line + " (3): left_tip, right_tip, box");
  EXPECT_FALSE(warns(gripper, line));
  const string ball = "<mujoco><worldbody><body><freejoint/><geom size='0.1'/></body></worldbody></mujoco>";
  EXPECT_EQ(report_of(import_mjcf(ball, "ball", {.colliders = true})).find(line), string::npos);
}

// Arms of `links` links with a ball each, all of which touch all.
Import arms(int count, int links, bool self_collisions = true) {
  string bodies;
  for (int arm = 0; arm < count; ++arm) {
    for (int link = 0; link < links; ++link) bodies += "<body pos='1 0 0'><joint/><geom size='0.1'/>";
    for (int link = 0; link < links; ++link) bodies += "</body>";
  }
  return import_mjcf("<mujoco><worldbody>" + bodies + "</worldbody></mujoco>", "arms",
                     {.colliders = true, .self_collisions = self_collisions});
}

TEST(Import, leaves_out_pairs_of_a_robot_with_itself_on_request) {
  EXPECT_EQ(arms(2, 4).model.contacts.size(), 22u);  // of 28, 6 are joined
  const Import apart = arms(2, 4, false);
  EXPECT_EQ(apart.model.contacts.size(), 16u);
  expect_reports(apart, "pairs of a robot with itself, left out on request (1): 6");
}

TEST(Import, warns_of_many_pairs_where_those_of_ends_are_fewer) {
  const string line =
      "pairs of colliders that may touch; those of feet, fingertips and objects alone are cheaper, see "
      "Model::end_colliders()";
  EXPECT_TRUE(warns(arms(6, 2), line + " (60): "));  // of 66, 6 are joined
  EXPECT_FALSE(warns(arms(5, 2), line));             // 40
  EXPECT_FALSE(warns(arms(12, 1), line));            // 66, all of ends
}

}  // namespace
}  // namespace lockstep
