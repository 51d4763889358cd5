// Slips of people's URDF files: read with a warning, or refused in words that fit; and all reasons at once.
// SPDX-License-Identifier: Apache-2.0
#include "import_helpers.h"
#include "lockstep/error.h"

namespace lockstep {
namespace {

using std::string;

const string ball = "<collision><geometry><sphere radius='0.1'/></geometry></collision>";

string link_text(const string& name, const string& inside) {
  return "<link name='" + name + "'>" + inside + "</link>\n";
}
string joint_text(const string& name, const string& child, const string& inside = "", const string& type = "continuous",
                  const string& parent = "base") {
  return "<joint name='" + name + "' type='" + type + "'><parent link='" + parent + "'/><child link='" + child + "'/>" +
         inside + "</joint>\n";
}
// From line 2 on.
string robot(const string& inside) { return "<robot name='r'>\n<link name='base'/>\n" + inside + "</robot>"; }
string arm(const string& in_joint = "", const string& in_link = "", const string& type = "continuous") {
  return robot(link_text("arm", unit_body + in_link) + joint_text("j", "arm", in_joint, type));
}

ImportError refusal_of(const string& text, const ImportOptions& options = {}) {
  try {
    import_urdf(text, "odd.urdf", options);
  } catch (const ImportError& error) {
    return error;
  }
  ADD_FAILURE() << "accepted: " << text;
  return {"", "", ""};
}

// --- read with a warning ---------------------------------------------------------------------------

TEST(Oddities, first_of_elements_that_are_there_twice_counts) {
  const string twice = "<axis xyz='0 0 1'/>\n<axis xyz='0 1 0'/>";
  const Import import = import_urdf(arm(twice), "odd.urdf");
  EXPECT_EQ(joint(import.model, "j").axis, Eigen::Vector3d::UnitZ());
  EXPECT_TRUE(warns(import, "already, not used: the first counts (1): odd.urdf:5: axis of joint 'j'"));

  const string heavier = "<inertial><mass value='2'/></inertial>";
  const Import heavy = import_urdf(arm("", heavier), "odd.urdf");
  EXPECT_EQ(link(heavy.model, "arm").inertia.mass, 1.0);
  EXPECT_TRUE(warns(heavy, "the first counts (1): odd.urdf:3: inertial of link 'arm'"));
}

TEST(Oddities, ends_and_mimics_that_are_there_twice_are_refused) {
  EXPECT_EQ(refusal_of(arm("<parent link='arm'/>")).element(), "odd.urdf:4: parent of joint 'j'");
  EXPECT_EQ(refusal_of(arm("<mimic joint='j'/><mimic joint='k'/>")).element(), "odd.urdf:4: mimic of joint 'j'");
}

TEST(Oddities, empty_names_of_robots_are_replaced) {
  for (const char* name : {"", " "}) {
    const Import import = import_urdf(string("<robot name='") + name + "'><link name='a'/></robot>");
    EXPECT_EQ(import.model.name, Model().name);
    EXPECT_TRUE(warns(import, "a robot with an empty name"));
  }
}

TEST(Oddities, bytes_behind_the_root_element_are_not_used) {
  const string zeros = arm() + string("\n\0 \0\n", 5);
  EXPECT_TRUE(
      warns(import_urdf(zeros, "odd.urdf"), "bytes behind the root element, not used (1): odd.urdf:6: '\\x00 \\x00'"));
  EXPECT_TRUE(
      warns(import_urdf(arm() + "\nend", "odd.urdf"), "behind the root element, not used (1): odd.urdf:6: 'end'"));
  EXPECT_NE(refusal_of("start" + arm()).rule(), "");
  EXPECT_NE(refusal_of(arm() + string("\0<!-- -->", 9)).rule().find("zero byte"), string::npos);
  EXPECT_NE(refusal_of(arm() + "<robot/>").rule().find("outside of the root"), string::npos);
  const string mjcf = "<mujoco><worldbody/></mujoco>" + string("\0", 1);
  EXPECT_TRUE(warns(import_mjcf(mjcf), "behind the root element"));
}

TEST(Oddities, joints_on_a_world_that_is_no_link_are_on_the_world) {
  const string text = "<robot name='r'>" + link_text("arm", unit_body) +
                      joint_text("j", "arm", "<origin xyz='0 0 1'/>", "continuous", "world") + "</robot>";
  const Import import = import_urdf(text);
  EXPECT_TRUE(warns(import, "taken for the world, as Drake does (1): world"));
  EXPECT_EQ(import.model.links.front().name, "world");
  EXPECT_EQ(joint(import.model, "j").parent, "world");
  const string floating = "<robot name='r'>" + link_text("arm", unit_body) +
                          joint_text("j", "arm", "<origin xyz='0 0 1'/>", "floating", "world") + "</robot>";
  const Model free = import_urdf(floating).model;
  ASSERT_EQ(free.roots.size(), 1u);
  EXPECT_TRUE(free.roots[0].floating);
  EXPECT_EQ(free.roots[0].pose.translation().z(), 1.0);
  // Any other name is a slip, and so is a world that something carries.
  for (const auto& [parent, child] : {std::pair("wolrd", "arm"), std::pair("arm", "world")})
    EXPECT_NE(refusal_of("<robot name='r'>" + link_text("arm", unit_body) +
                         joint_text("j", child, "", "fixed", parent) + "</robot>")
                  .rule()
                  .find("does not exist"),
              string::npos);
}

TEST(Oddities, shapes_of_size_0_are_left_out) {
  const string shapes[] = {"<sphere radius='0'/>", "<box size='1 0 1'/>", "<cylinder radius='1' length='0'/>",
                           "<capsule radius='0' length='1'/>"};
  for (const string& shape : shapes) {
    const Import import = import_urdf(arm("", "<collision><geometry>" + shape + "</geometry></collision>" + ball), "",
                                      {.colliders = true});
    ASSERT_EQ(import.model.colliders.size(), 1u) << shape;
    EXPECT_EQ(import.model.colliders[0].name, "arm");
    EXPECT_TRUE(warns(import, "collision shapes of size 0, left out (1)")) << shape;
  }
  EXPECT_NE(
      refusal_of(arm("", "<collision><geometry><sphere radius='-1'/></geometry></collision>"), {.colliders = true})
          .rule()
          .find("below 0"),
      string::npos);
}

TEST(Oddities, colliders_without_any_pair_are_warned_of) {
  const auto warned = [](const string& text, const std::vector<Contact>& contacts) {
    ImportOptions options{.colliders = true};
    options.change = [&](Model& model) { model.contacts = contacts; };
    return import_urdf(text, "", options).warnings;
  };
  EXPECT_EQ(warned(arm(), {}), std::vector<string>{"the file has no shape that could be a collider (1): r"});
  const std::vector<string> nothing{"colliders that touch nothing, as Model::contacts declares no pair (1): arm"};
  EXPECT_EQ(warned(arm("", ball), {}), nothing);
  EXPECT_EQ(warned(arm("", ball), {{"robot", "robot"}}), nothing);  // of one collider no pair can be made
  const string two = robot(link_text("a", unit_body + ball) + joint_text("j", "a") + link_text("b", unit_body + ball) +
                           joint_text("k", "b"));
  EXPECT_TRUE(warned(two, {{"a", "b"}}).empty());
}

TEST(Oddities, numbers_that_look_like_another_unit_are_warned_of) {
  const auto range = [](const string& lower, const string& upper) {
    return import_urdf(
        arm("<limit lower='" + lower + "' upper='" + upper + "' effort='1' velocity='1'/>", "", "revolute"));
  };
  EXPECT_TRUE(warns(range("-90", "90"), "ranges that look like degrees, taken in rad (1): j -90 to 90"));
  EXPECT_TRUE(warns(range("0", "10"), "look like degrees"));
  for (const auto& [lower, upper] :
       {std::pair("-9", "9"), {"-1.5708", "1.5708"}, {"-12.566", "12.566"}, {"-1000", "1000"}, {"-1e16", "1e16"}})
    EXPECT_FALSE(warns(range(lower, upper), "look like degrees")) << upper;
  const string in_mm =
      "<inertial><mass value='0.5'/><inertia ixx='300' ixy='0' ixz='0' iyy='300' iyz='0' izz='300'/>"
      "</inertial>";
  EXPECT_TRUE(warns(import_urdf(robot(link_text("arm", in_mm) + joint_text("j", "arm"))),
                    "inertias that look like kg mm^2, taken in kg m^2 (1): arm has a radius of gyration of 24.49 m"));
  EXPECT_FALSE(warns(import_urdf(arm()), "look like"));
}

// --- refused in words that fit -----------------------------------------------------------------------

TEST(Oddities, balls_follow_no_other_joint) {
  const ImportError error = refusal_of(arm("<mimic joint='k'/>", "", "spherical"));
  EXPECT_NE(error.rule().find("a ball joint that follows"), string::npos) << error.what();
}

TEST(Oddities, what_was_not_expanded_is_named) {
  const std::pair<string, const char*> cases[] = {
      {link_text("$(arg prefix)arm", unit_body), "$(arg prefix)"},
      {link_text("${prefix}arm", unit_body), "${prefix}"},
      {link_text("arm", "<inertial><mass value='$(optenv MASS 1)'/></inertial>"), "$(optenv MASS 1)"},
      {link_text("arm", unit_body + "<collision><geometry><mesh filename='file://$(find hand)/a.stl'/></geometry>"
                                    "</collision>"),
       "$(find hand)"}};
  for (const auto& [text, unexpanded] : cases) {
    const ImportError error = refusal_of(robot(text), {.colliders = true});
    EXPECT_NE(error.rule().find(string("holds ") + unexpanded + ", which nothing has expanded"), string::npos)
        << error.what();
    EXPECT_TRUE(error.remedy().starts_with("expand it first: xacro")) << error.what();
  }
}

TEST(Oddities, formats_that_are_not_read_are_named) {
  const auto expect = [](const string& text, const string& rule, const string& remedy) {
    for (const auto& read : {import_urdf, import_mjcf}) try {
        read(text, "file", {});
        ADD_FAILURE() << "accepted: " << text;
      } catch (const ImportError& error) {
        EXPECT_NE(error.rule().find(rule), string::npos) << error.what();
        EXPECT_NE(error.remedy().find(remedy), string::npos) << error.what();
      }
  };
  expect("<?xml version='1.0'?>\n<sdf version='1.7'><model name='m'/></sdf>", "is SDF", "sdf2mjcf");
  expect("#usda 1.0\n(\n)\ndef Xform \"robot\"\n{\n}\n", "is USD", "URDF or MJCF");
  expect(string("PXR-USDC\0\10\0\0", 12), "is USD", "URDF or MJCF");
}

// --- several reasons -------------------------------------------------------------------------------

std::vector<string> elements_of(const string& text, const ImportOptions& options = {}) {
  std::vector<string> elements;
  try {
    import_urdf(text, "odd.urdf", options);
  } catch (const Error& error) {
    string message;
    for (const Reason& reason : error.reasons()) {
      elements.push_back(reason.element);
      message += (message.empty() ? "" : "\n") + reason.element + ": " + reason.rule + "; " + reason.remedy;
    }
    EXPECT_EQ(error.what(), message);
    EXPECT_EQ(error.element(), elements.front());
  }
  return elements;
}

TEST(Reasons, of_all_elements_are_listed) {
  const string text = robot(link_text("a", "<inertial><mass value='x'/></inertial>") + joint_text("j", "a") +
                            link_text("b", "<inertial><mass value='y'/></inertial>") +
                            joint_text("k", "b", "", "planar") + "<drake:ball_constraint/>\n");
  EXPECT_EQ(elements_of(text),
            (std::vector<string>{"odd.urdf:3: mass of inertial of link 'a'", "odd.urdf:5: mass of inertial of link 'b'",
                                 "odd.urdf:6: joint 'k'", "odd.urdf:7: <drake:ball_constraint>"}));
}

// What an option would leave out does not hide what is wrong with the rest.
TEST(Reasons, of_the_mechanism_come_beside_those_of_elements) {
  const string range = "<limit lower='1' upper='-1' effort='1' velocity='1'/>";
  const string text = robot(link_text("a", "") + joint_text("j", "a", range, "revolute") + link_text("b", unit_body) +
                            joint_text("k", "b", range, "revolute") + joint_text("again", "b") +
                            "<loop_joint name='l' type='planar'/>\n");
  EXPECT_EQ(elements_of(text),
            (std::vector<string>{"odd.urdf:7: joint 'again'", "odd.urdf:8: loop_joint 'l'", "odd.urdf:4: joint 'j'",
                                 "odd.urdf:6: joint 'k'", "odd.urdf:3: link 'a'"}));
  ImportOptions options{.density = 1000.0, .ignore = {.position_limits = true}, .leave_out_foreign = true};
  EXPECT_EQ(elements_of(text, options), std::vector<string>{"odd.urdf:3: link 'a'"});  // it has no shape
  options.least_mass = options.least_inertia = 0.01;
  EXPECT_TRUE(elements_of(text, options).empty());
}

TEST(Reasons, of_missing_meshes_are_listed) {
  const auto mesh = [](const string& name) {
    return "<collision><geometry><mesh filename='" + name + "'/></geometry></collision>";
  };
  const string text = robot(link_text("a", mesh("a.stl") + "\n" + mesh("b.stl")) + joint_text("j", "a"));
  EXPECT_EQ(elements_of(text, {.colliders = true}).size(), 3u);  // link a has no inertia, too
  EXPECT_EQ(elements_of(text, {.density = 1000.0}).size(), 2u);  // that is why it has none
}

TEST(Reasons, are_at_most_twenty) {
  string text;
  for (int i = 0; i < 50; ++i) text += link_text("l" + std::to_string(i), "<inertial><mass/></inertial>");
  try {
    import_urdf(robot(text), "odd.urdf");
    FAIL();
  } catch (const Error& error) {
    ASSERT_EQ(error.reasons().size(), 21u);
    EXPECT_EQ(error.reasons().back().rule, "may be refused for more reasons");
  }
}

// A function that changes the model may count on what is left out of a refused file.
TEST(Reasons, come_before_errors_of_the_callers_own) {
  ImportOptions options;
  options.change = [](Model& model) { model.joints.at(model.joint_index("again")).damping = 1.0; };
  EXPECT_EQ(elements_of(robot(link_text("b", unit_body) + joint_text("k", "b") + joint_text("again", "b")), options),
            std::vector<string>{"odd.urdf:5: joint 'again'"});
}

TEST(Reasons, of_mjcf_are_listed) {
  const auto reasons = [](const string& text) {
    try {
      import_mjcf(text, "odd.xml");
    } catch (const Error& error) {
      return error.reasons();
    }
    return std::vector<Reason>();
  };
  const string broken = "<body><joint axis='0 0 0'/><geom type='torus'/></body>\n";
  EXPECT_EQ(reasons("<mujoco><worldbody>\n" + broken + "</worldbody></mujoco>").size(), 2u);
  const string whole = "<body><joint name='a'/><geom size='0.1'/></body>\n";
  const std::vector<Reason> later =
      reasons("<mujoco><worldbody>\n" + whole +
              "</worldbody>\n<equality>\n<joint joint1='b'/>\n<joint joint1='c'/>\n</equality></mujoco>");
  ASSERT_EQ(later.size(), 2u);
  EXPECT_TRUE(later[0].element.starts_with("odd.xml:5: ")) << later[0].element;
  EXPECT_TRUE(later[1].element.starts_with("odd.xml:6: ")) << later[1].element;
}

// --- remedies --------------------------------------------------------------------------------------

TEST(Remedies, are_those_of_the_format) {
  const string massless = "<mujoco><worldbody><body><joint/></body></worldbody></mujoco>";
  const auto remedy = [](const auto& read, const string& text) -> string {
    try {
      read(text, "odd", {});
    } catch (const ModelError& error) {
      return error.remedy();
    }
    return "";
  };
  const string of_mjcf = remedy(import_mjcf, massless),
               of_urdf = remedy(import_urdf, robot(link_text("a", "") + joint_text("j", "a")));
  EXPECT_NE(of_mjcf.find("ImportOptions::least_mass"), string::npos) << of_mjcf;
  EXPECT_EQ(of_mjcf.find("density"), string::npos) << of_mjcf;
  EXPECT_NE(of_urdf.find("ImportOptions::density"), string::npos) << of_urdf;
}

TEST(Remedies, of_a_mass_without_inertia_name_options) {
  const string point = robot(link_text("a", "<inertial><mass value='1'/></inertial>") + joint_text("j", "a"));
  try {
    import_urdf(point);
    FAIL();
  } catch (const ModelError& error) {
    for (const char* option : {"ImportOptions::least_inertia", "Joint::armature"})
      EXPECT_NE(error.remedy().find(option), string::npos) << error.what();
  }
  EXPECT_NO_THROW(import_urdf(point, "", {.least_inertia = 1e-5}));
}

// PyBullet frees such a joint; others mean what swapped numbers say.
TEST(Remedies, of_a_lower_limit_above_the_upper_fit_both_meanings) {
  try {
    import_urdf(arm("<limit lower='1' upper='-1' effort='1' velocity='1'/>", "", "revolute"));
    FAIL();
  } catch (const ModelError& error) {
    for (const char* part : {"swap the limits", "free", "ImportOptions::ignore"})
      EXPECT_NE(error.remedy().find(part), string::npos) << error.what();
  }
}

}  // namespace
}  // namespace lockstep
