// Invalid URDF files and impossible mechanisms are refused by name. SPDX-License-Identifier: Apache-2.0
#include "import_helpers.h"
#include "lockstep/error.h"

namespace lockstep {
namespace {

using std::string;

// --- numbers -----------------------------------------------------------------------------------

// A robot with one revolute joint with this damping. `more` stands inside of the joint, `around` beside it.
string one_joint(const string& damping, const string& more = "", const string& around = "") {
  return "<robot name='r'>\n<link name='a'/>\n<link name='b'>" + unit_body +
         "</link>\n"
         "<joint name='j' type='revolute'><parent link='a'/><child link='b'/>\n"
         "<dynamics damping='" +
         damping + "'/>" + more + "</joint>\n" + around + "</robot>";
}

TEST(Import, reads_numbers_in_every_plain_notation) {
  const std::pair<const char*, double> notations[] = {{"0.5", 0.5},   {".5", 0.5},     {"5.", 5.0}, {"+0.5", 0.5},
                                                      {"1e-3", 1e-3}, {"1.5E+2", 150}, {" 2\t", 2}, {"00.25", 0.25}};
  for (const auto& [text, value] : notations)
    EXPECT_EQ(import_urdf(one_joint(text)).model.joints[0].damping, value) << text;
}

TEST(Import, refuses_numbers_in_any_other_notation) {
  for (const char* text : {"",    " ",    "nan", "inf", "-inf",  "+",      "-",   "+-1",  "++1", "0x10",     "0x1p3",
                           "1,5", "1.5f", "1e",  "1 2", "1e999", "-1e999", "one", "${d}", "1;",  "\xc2\xb2", "1_000"}) {
    try {
      import_urdf(one_joint(text), "numbers.urdf");
      ADD_FAILURE() << "accepted '" << text << "'";
    } catch (const ImportError& error) {
      EXPECT_EQ(error.element(), "numbers.urdf:5: dynamics of joint 'j'") << text;
      EXPECT_NE(error.rule().find("damping="), string::npos) << error.what();
    }
  }
}

// --- invalid files -----------------------------------------------------------------------------

enum class Kind { text, model };  // ImportError, ModelError

struct Refusal {
  const char* name;
  Kind kind;
  string text;
  const char* element;  // its end
  const char* rule;     // a part of it
};

void PrintTo(const Refusal& refusal, std::ostream* stream) { *stream << refusal.name; }

class InvalidUrdf : public testing::TestWithParam<Refusal> {};

TEST_P(InvalidUrdf, is_refused_and_named) {
  const Refusal& refusal = GetParam();
  try {
    const Import import = import_urdf(refusal.text, "bad.urdf");
    FAIL() << "accepted\n" << report_of(import);
  } catch (const Error& error) {
    EXPECT_EQ(dynamic_cast<const ImportError*>(&error) ? Kind::text : Kind::model, refusal.kind) << error.what();
    EXPECT_TRUE(error.element().ends_with(refusal.element)) << error.what();
    EXPECT_NE(error.rule().find(refusal.rule), string::npos) << error.what();
    EXPECT_FALSE(error.remedy().empty());
    const bool has_no_line = error.rule().starts_with("is empty") || error.rule().starts_with("has no XML");
    EXPECT_EQ(error.element().starts_with("bad.urdf:"), !has_no_line) << error.what();
    EXPECT_TRUE(has_no_line || std::isdigit(static_cast<unsigned char>(error.element().at(9)))) << error.what();
  }
}

string joint_text(const string& name, const string& type, const string& parent, const string& child,
                  const string& inside = "") {
  return "<joint name='" + name + "' type='" + type + "'><parent link='" + parent + "'/><child link='" + child + "'/>" +
         inside + "</joint>";
}

string robot(const string& inside) { return "<robot name='r'>" + inside + "</robot>"; }

string mimic(const string& attributes) { return one_joint("0", "<mimic " + attributes + "/>"); }

// Three continuous joints j, k and l with this content, and a fixed joint f.
string three_joints(const string& j, const string& k, const string& l) {
  string text = "<robot name='r'><link name='a'/>";
  const std::pair<const char*, string> joints[] = {{"j", j}, {"k", k}, {"l", l}, {"f", ""}};
  for (const auto& [name, inside] : joints) {
    text += string("<link name='") + name + "'>" + unit_body + "</link>" +
            joint_text(name, name[0] == 'f' ? "fixed" : "continuous", "a", name, inside);
  }
  return text + "</robot>";
}

string inertial(const string& mass, const string& inertia) {
  return "<robot name='r'><link name='a'><inertial>" + mass + inertia + "</inertial></link></robot>";
}

string moments(const string& xx, const string& yy, const string& zz) {
  return "<inertia ixx='" + xx + "' ixy='0' ixz='0' iyy='" + yy + "' iyz='0' izz='" + zz + "'/>";
}

// Link b in line 2 and the joint that moves it in line 3.
string moving_body(const string& inertial, const string& type = "continuous") {
  return "<robot name='r'><link name='a'/>\n<link name='b'><inertial>" + inertial + "</inertial></link>\n" +
         joint_text("j", type, "a", "b") + "</robot>";
}

// Links a and b without bodies, and joint j.
string bare_joint(const string& type, const string& inside) {
  return robot("<link name='a'/><link name='b'/><joint name='j'" + type + ">" + inside + "</joint>");
}

string nested(int depth) {
  string text = "<robot name='r'><link name='a'>";
  for (int i = 0; i < depth; ++i) text += "<x>";
  for (int i = 0; i < depth; ++i) text += "</x>";
  return text + "</link></robot>";
}

const string ends = "<parent link='a'/><child link='b'/>";

INSTANTIATE_TEST_SUITE_P(
    text, InvalidUrdf,
    testing::Values(
        Refusal{"empty", Kind::text, "", "bad.urdf", "is empty"},
        Refusal{"blank", Kind::text, " \n\t", "bad.urdf", "is empty"},
        Refusal{"words", Kind::text, "no robot at all", "bad.urdf:1", "well-formed"},
        Refusal{"comment_alone", Kind::text, "<!-- robot -->", "bad.urdf", "no XML element"},
        Refusal{"zero_byte", Kind::text, string("<robot name='r'>\n\0<link name='a'/></robot>", 41), "bad.urdf:2",
                "zero byte"},
        Refusal{"unclosed", Kind::text, "<robot name='r'>\n<link name='a'>\n</robot>", "bad.urdf:2", "well-formed"},
        Refusal{"attribute_twice", Kind::text, "<robot name='r' name='s'/>", "bad.urdf:1", "well-formed"},
        Refusal{"deep", Kind::text, nested(100000), "bad.urdf:1", "deeper than 100"},
        Refusal{"two_robots", Kind::text, "<robot name='r'><link name='a'/></robot>\n<robot name='s'/>", "bad.urdf:2",
                "outside of the root"},
        Refusal{"entities", Kind::text, "<!DOCTYPE r [<!ENTITY a 'b'>]>\n<robot name='r'><link name='a'/></robot>",
                "bad.urdf:1", ""},
        Refusal{"entity", Kind::text, "<robot name='r'><link name='&lol;'/></robot>", "<link>", "entity"},
        Refusal{"sdf", Kind::text, "<sdf version='1.7'><model name='m'/></sdf>", "bad.urdf:1: <sdf>", "is SDF"},
        Refusal{"mjcf", Kind::text, "\n<mujoco/>", "bad.urdf:2: <mujoco>", "MJCF"},
        Refusal{"html", Kind::text, "<html/>", "bad.urdf:1: <html>", "not <robot>"},
        Refusal{"xacro", Kind::text, "<robot name='r'>\n<xacro:include filename='x'/><link name='a'/></robot>",
                "bad.urdf:2: <xacro:include>", "xacro"},
        Refusal{"xacro_in_link", Kind::text, "<robot name='r'><link name='a'><xacro:box/></link></robot>",
                "<xacro:box>", "xacro"},
        Refusal{"no_links", Kind::text, "<robot name='r'/>", "robot 'r'", "no links"},
        Refusal{"nameless_link", Kind::text, "<robot name='r'><link/></robot>", "<link>", "no attribute 'name'"},
        Refusal{"empty_name", Kind::text, "<robot name='r'><link name=' '/></robot>", "<link>", "empty"}),
    [](const auto& refusal) { return string(refusal.param.name); });

INSTANTIATE_TEST_SUITE_P(
    elements, InvalidUrdf,
    testing::Values(
        Refusal{"no_type", Kind::text, bare_joint("", ends), "joint 'j'", "no attribute 'type'"},
        Refusal{"odd_type", Kind::text, bare_joint(" type='screw'", ends), "joint 'j'", "'screw'"},
        Refusal{"planar", Kind::text, bare_joint(" type='planar'", ends), "joint 'j'", "type planar"},
        Refusal{"no_parent", Kind::text, bare_joint(" type='fixed'", "<child link='b'/>"), "joint 'j'", "no <parent>"},
        Refusal{"two_children", Kind::text, bare_joint(" type='fixed'", ends + "<child link='a'/>"),
                "child of joint 'j'", "already"},
        Refusal{"no_child_link", Kind::text, bare_joint(" type='fixed'", "<parent link='a'/><child name='b'/>"),
                "child of joint 'j'", "no attribute 'link'"},
        Refusal{"unknown_link", Kind::text, bare_joint(" type='fixed'", "<parent link='a'/><child link='bb'/>"),
                "joint 'j'", "'bb', which does not exist"},
        Refusal{"two_numbers", Kind::text, bare_joint(" type='fixed'", ends + "<origin xyz='1 2'/>"),
                "origin of joint 'j'", "2 numbers, not 3"},
        Refusal{"four_numbers", Kind::text, bare_joint(" type='fixed'", ends + "<origin rpy='1 2 3 4'/>"),
                "origin of joint 'j'", "4 numbers, not 3"},
        Refusal{"axis_without_xyz", Kind::text, one_joint("0", "<axis/>"), "axis of joint 'j'", "no attribute 'xyz'"},
        Refusal{"long_number", Kind::text, one_joint(string(1 << 20, '1')), "dynamics of joint 'j'", "1111..."},
        Refusal{"long_word", Kind::text, one_joint(string(1 << 20, 'x')), "dynamics of joint 'j'", "xxxx..."},
        Refusal{"no_ixy", Kind::text, inertial("<mass value='1'/>", "<inertia ixx='1'/>"),
                "inertia of inertial of link 'a'", "no attribute 'ixy'"}),
    [](const auto& refusal) { return string(refusal.param.name); });

INSTANTIATE_TEST_SUITE_P(
    mechanism, InvalidUrdf,
    testing::Values(
        Refusal{"link_twice", Kind::model, "<robot name='r'><link name='a'/><link name='a'/></robot>", "link 'a'",
                "twice"},
        Refusal{"joint_twice", Kind::model, one_joint("0", "", "<link name='c'/>" + joint_text("j", "fixed", "a", "c")),
                "joint 'j'", "twice"},
        Refusal{"two_roots", Kind::model, "<robot name='r'><link name='a'/><link name='b'/></robot>", "robot 'r'",
                "a, b"},
        Refusal{"no_root", Kind::model,
                robot("<link name='a'/><link name='b'/>" + joint_text("j", "fixed", "a", "b") +
                      joint_text("k", "fixed", "b", "a")),
                "robot 'r'", "no root"},
        Refusal{"cycle_apart", Kind::model,
                robot("<link name='o'/><link name='a'/><link name='b'/>" + joint_text("j", "fixed", "a", "b") +
                      joint_text("k", "fixed", "b", "a")),
                "link 'a'", "carried by a circle of joints"},
        Refusal{"two_parents", Kind::text, one_joint("0", "", joint_text("k", "fixed", "a", "b")),
                "bad.urdf:6: joint 'k'", "carries link 'b', as joint 'j' does already"},
        Refusal{"joint_to_itself", Kind::model,
                one_joint("0", "", "<link name='c'/>" + joint_text("k", "fixed", "c", "c")), "joint 'k'", "to itself"},
        Refusal{"zero_axis", Kind::model, one_joint("0", "<axis xyz='0 0 0'/>"), "joint 'j'", "no length"},
        Refusal{"negative_damping", Kind::model, one_joint("-1"), "joint 'j'", "negative"},
        Refusal{"swapped_limits", Kind::model, one_joint("0", "<limit lower='1' upper='0' effort='1' velocity='1'/>"),
                "joint 'j'", "range is empty"},
        Refusal{"moving_without_inertial", Kind::model, bare_joint(" type='revolute'", ends), "link 'b'",
                "inertia is missing or 0"},
        Refusal{"negative_mass", Kind::model, inertial("<mass value='-1'/>", moments("1", "1", "1")), "link 'a'",
                "negative"},
        Refusal{"triangle", Kind::model, moving_body("<mass value='1'/>" + moments("1", "1", "3")),
                "bad.urdf:2: link 'b'", "impossible: one principal moment exceeds"},
        Refusal{"negative_moment", Kind::model, moving_body("<mass value='1'/>" + moments("1", "1", "-1")),
                "bad.urdf:2: link 'b'", "impossible: a principal moment is negative"},
        Refusal{"inertia_without_mass_slides", Kind::model, moving_body(moments("1", "1", "1"), "prismatic"),
                "bad.urdf:2: link 'b'", "has no mass"},
        Refusal{"point_on_its_axis", Kind::model, moving_body("<mass value='1'/>"), "bad.urdf:2: link 'b'",
                "no inertia about the axis"},
        Refusal{"overflow", Kind::model,
                robot("<link name='a'/><link name='b'><inertial><origin xyz='0 1e200 0'/><mass value='1e90'/>" +
                      moments("1", "1", "1") + "</inertial></link>" + joint_text("j", "continuous", "a", "b")),
                "link 'b'", "not a finite number"},
        Refusal{"mimic_of_nothing", Kind::model, mimic("joint='ghost'"), "joint 'j'", "'ghost', which does not exist"},
        Refusal{"mimic_of_itself", Kind::model, mimic("joint='j'"), "joint 'j'", "itself"},
        Refusal{"mimic_of_fixed", Kind::model, three_joints("<mimic joint='f'/>", "", ""), "joint 'j'",
                "'f', which is fixed"},
        Refusal{"mimic_of_floating", Kind::model,
                "<robot name='r'><link name='a'/><link name='b'>" + unit_body + "</link><link name='c'>" + unit_body +
                    "</link>" + joint_text("f", "floating", "a", "b") +
                    joint_text("j", "continuous", "b", "c", "<mimic joint='f'/>") + "</robot>",
                "joint 'j'", "which is floating"},
        Refusal{"mimic_of_ball", Kind::model,
                "<robot name='r'><link name='a'/><link name='b'>" + unit_body + "</link><link name='c'>" + unit_body +
                    "</link>" + joint_text("f", "ball", "a", "b") +
                    joint_text("j", "continuous", "b", "c", "<mimic joint='f'/>") + "</robot>",
                "joint 'j'", "which is a ball joint"},
        Refusal{"mimic_by_zero", Kind::model, three_joints("<mimic joint='k' multiplier='0'/>", "", ""), "joint 'j'",
                "multiplier 0"},
        Refusal{"mimic_by_nearly_zero", Kind::model, three_joints("<mimic joint='k' multiplier='1e-12'/>", "", ""),
                "coupling 'j'", "beyond"},
        Refusal{"mimic_circle", Kind::model,
                three_joints("<mimic joint='k'/>", "<mimic joint='l'/>", "<mimic joint='j'/>"), "joint 'j'",
                "circle: j <- k <- l <- j"},
        Refusal{"mimic_into_circle", Kind::model,
                three_joints("<mimic joint='k'/>", "<mimic joint='l'/>", "<mimic joint='k'/>"), "joint 'k'",
                "circle: k <- l <- k"},
        Refusal{"mimic_chain_vanishes", Kind::model,
                three_joints("<mimic joint='k' multiplier='1e-200'/>", "<mimic joint='l' multiplier='1e-200'/>", ""),
                "coupling 'j'", "is 0"}),
    [](const auto& refusal) { return string(refusal.param.name); });

TEST(Import, names_xacro_in_the_remedy_for_a_number_that_contains_it) {
  try {
    import_urdf(one_joint("${width}"));
    FAIL();
  } catch (const ImportError& error) {
    EXPECT_NE(error.remedy().find("xacro"), string::npos) << error.what();
  }
}

TEST(Import, refuses_paths_that_are_no_files_by_name) {
  for (const string path : {"/", "/no/such/robot.urdf", "", "/dev/null"}) {
    try {
      import_urdf_file(path);
      ADD_FAILURE() << path;
    } catch (const ImportError& error) {
      EXPECT_EQ(error.element(), path) << error.what();
    }
  }
}

TEST(Import, names_what_a_misspelt_name_may_mean) {
  const auto remedy_of = [](const string& text) -> string {
    try {
      import_urdf(text);
    } catch (const Error& error) {
      return error.remedy();
    }
    return "accepted";
  };
  EXPECT_NE(
      remedy_of(robot("<link name='forearm'/><link name='hand'/>" + joint_text("j", "continuous", "foream", "hand")))
          .find("'forearm' exists"),
      string::npos);
  EXPECT_NE(remedy_of(three_joints("<mimic joint='kk'/>", "", "")), "accepted");
  EXPECT_NE(remedy_of(robot(moving_body("<mass value='1'/>" + moments("1", "1", "1")) + "<link name='c'/>" +
                            joint_text("j", "floating", "b", "c"))),
            "accepted");
}

// URDF's readers disagree about them, so they are warnings.
TEST(Import, warns_of_names_that_nothing_has_in_elements_that_are_not_used) {
  const string good =
      "<transmission name='t'><joint name='elbow'/></transmission><gazebo reference='hand'/>"
      "<gazebo reference='elbow'/><sensor name='s'><parent link='hand'/></sensor>"
      "<ros2_control name='r'><joint name='elbow'/></ros2_control><gazebo/>";
  string bad = good;
  for (const string name : {"elbow", "hand"})
    for (std::size_t at = 0; (at = bad.find("'" + name + "'", at)) != string::npos; at += name.size())
      bad.replace(at + 1, name.size(), name + "s");
  const auto warnings_of = [](const string& elements) {
    string all;
    for (const string& line :
         import_urdf(robot("<link name='arm'/><link name='hand'><inertial><mass value='1'/>" + moments("1", "1", "1") +
                           "</inertial></link>" + joint_text("elbow", "continuous", "arm", "hand") + elements))
             .warnings)
      all += line + "\n";
    return all;
  };
  EXPECT_EQ(warnings_of(good).find("names that nothing has"), string::npos) << warnings_of(good);
  const string warnings = warnings_of(bad);
  EXPECT_NE(warnings.find("names that nothing has"), string::npos) << warnings;
  EXPECT_NE(warnings.find("'elbows' in line 1: 'elbow' exists"), string::npos) << warnings;
  EXPECT_NE(warnings.find("'hands' in line 1: 'hand' exists"), string::npos) << warnings;
}

}  // namespace
}  // namespace lockstep
