// What MJCF cannot become a Model of, and hostile files. SPDX-License-Identifier: Apache-2.0
//
// One file: all refusals are of the same short texts, by the same few helpers.
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "lockstep/error.h"
#include "unit/import_helpers.h"

namespace lockstep {
namespace {

using std::string;

const string ball = "<geom size='0.1'/>";
string body(const string& inside, const string& name = "b") {
  return "<body name='" + name + "'>" + inside + ball + "</body>";
}
string world(const string& bodies, const string& beside = "") {
  return "<mujoco>" + beside + "\n<worldbody>" + bodies + "</worldbody></mujoco>";
}
const string pair = body("<joint name='x'/>", "one") + body("<joint name='y'/>", "two");

// The error names line, rule and remedy.
void expect_refused(const string& text, const string& line, const string& rule, const ImportOptions& options = {}) {
  try {
    import_mjcf(text, "file", options);
    ADD_FAILURE() << "accepted: " << text;
  } catch (const Error& error) {
    EXPECT_TRUE(string(error.what()).starts_with("file:" + line)) << error.what();
    EXPECT_NE(error.rule().find(rule), string::npos) << error.what();
    EXPECT_FALSE(error.remedy().empty());
  }
}

TEST(MjcfRefusal, is_of_what_would_be_another_mechanism) {
  expect_refused(world(body("<joint type='ball' range='10 20'/>")), "2: <joint>", "does not begin at 0");
  expect_refused(world(body("<joint/>" + body("<freejoint/>", "c"))), "2: <freejoint>", "frees a body");
  expect_refused(world(body("<freejoint/><joint/>")), "2: <joint>", "beside a free joint");
  expect_refused(world("<joint/>"), "2: <joint>", "world");
  expect_refused(world(pair, "<equality><connect body1='one' body2='three' anchor='0 0 0'/></equality>"),
                 "1: equality <connect>", "names body 'three', which does not exist");
  expect_refused(world(pair, "<equality><connect body1='one' body2='two'/></equality>"), "1: equality <connect>",
                 "neither an anchor nor sites");
  expect_refused(world(pair, "<equality><weld name='w' site1='s' site2='t'/></equality>"), "1: weld 'w'",
                 "names site 's', which does not exist");
  const string lengths = "<tendon><fixed name='s'><joint joint='x' coef='1'/></fixed></tendon>";
  expect_refused(world(pair, lengths + "<equality><tendon tendon1='s' tendon2='s' polycoef='0 1 0.1'/></equality>"),
                 "1:", "not linear");
  expect_refused(world(pair, "<equality><joint joint1='x'/><joint joint1='x' joint2='y' polycoef='0 1 1'/></equality>"),
                 "1:", "makes joint 'x', which stands still, a function of joint 'y'");
  expect_refused(world(pair, "<equality><joint joint1='x' joint2='z'/></equality>"), "1:", "does not exist");
  expect_refused(world(pair, "<equality><joint joint1='x' joint2='x'/></equality>"), "1:", "itself");
  expect_refused(world(pair, "<equality><flex flex='f'/></equality>"), "1:", "lacks");
  expect_refused(world(pair,
                       "<equality><joint joint1='x' joint2='y'/><joint joint1='x' joint2='y' "
                       "polycoef='0.1 1'/></equality>"),
                 "1:", "contradicts");
  expect_refused(world("<site name='p'/><site name='q'/>" + pair,
                       "<tendon><spatial name='s'><site site='p'/><site site='q'/></spatial></tendon>"
                       "<equality><tendon tendon1='s'/></equality>"),
                 "1:", "spatial");
  const string inertial = "<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>";
  expect_refused(world(body("<joint/>" + inertial + inertial)), "2: <inertial>", "beside another");
  expect_refused(world(body("<joint/><inertial mass='1' diaginertia='1 1 1'/>")), "2: <inertial>", "lacks pos");
  for (const string attribute : {"stiffness", "damping"})
    for (const string& tendon : {"<fixed name='t' " + attribute + "='-5'><joint joint='x' coef='1'/></fixed>",
                                 "<spatial name='t' " + attribute + "='-5'><site site='s'/><site site='u'/></spatial>"})
      expect_refused(world("<site name='s' pos='0 0 1'/>" + body("<joint name='x'/><site name='u'/>"),
                           "<tendon>" + tendon + "</tendon>"),
                     "1: ", "negative " + attribute);
  for (const string condim : {"2", "5", "0", "-3"})
    expect_refused(world("<geom name='f' type='plane' size='1 1 1'/>" +
                         body("<freejoint/><geom size='0.1' condim='" + condim + "'/>")),
                   "2: <geom>", "condim of " + condim, {.colliders = true});
  expect_refused(world(body("<joint name='x'/>"), "<actuator><position joint='x' kp='5' timeconst='-1'/></actuator>"),
                 "1: <position>", "negative timeconst");
  expect_refused(world(body("<joint name='x'/>"), "<actuator><motor joint='x' delay='-0.1'/></actuator>"),
                 "1: actuator", "negative delay");
  expect_refused(world(body("<joint/><geom type='mesh' mesh='m'/>")), "2: <geom>",
                 "names mesh 'm', which does not exist");
  expect_refused(world(body("<joint/><geom size='0.1' shellinertia='true'/>")), "2: <geom>", "shell");
  expect_refused(world(body("<joint damping='1 2 0'/>")), "2: <joint>", "higher order");
  expect_refused(world("<composite type='cable'/>"), "2: <composite>", "only MuJoCo");
}

TEST(MjcfRefusal, is_of_what_mujoco_refuses) {
  expect_refused(world(body("<joint class='none'/>")), "2: <joint>", "class 'none'");
  expect_refused(world("<body childclass='none'/>"), "2: <body>", "childclass 'none'");
  expect_refused(world(body("<joint/>"), "<default><default><joint/></default></default>"), "1: <default>", "'class'");
  expect_refused(world(body("<joint/>"), "<default class='other'/>"), "1: <default>", "at the top");
  expect_refused(world(body("<joint/>"), "<default><joint name='x'/></default>"), "1: <joint>", "has a name, which");
  expect_refused(world(body("<joint name='x'/>"), "<default><motor joint='x'/></default><actuator><motor/></actuator>"),
                 "1: <motor>", "has a joint, which");
  expect_refused(world(body("<joint/>"), "<default><default class='a'/><default class='a'/></default>"), "1: <default>",
                 "once more");
  expect_refused(world(body("<joint range='0 1'/>"), "<compiler autolimits='false'/>"), "2: <joint>", "autolimits");
  expect_refused(world(body("<joint limited='true' range='1 0'/>")), "2: <joint>", "range is empty");
  expect_refused(
      world(body("<joint name='j'/>"),
            "<tendon><fixed stiffness='1' springlength='0.5 0.1'><joint joint='j' coef='1'/></fixed></tendon>"),
      "1: <fixed>", "ends before it begins");
  expect_refused(world(body("<joint axis='0 0 0'/>")), "2: <joint>", "axis has no length");
  expect_refused(world(body("<joint type='screw'/>")), "2: <joint>", "not known");
  expect_refused(world(body("<joint/>") + body("<joint/>")), "2: body 'b'", "taken");
  expect_refused(world(body("<joint name='j'/>", "c") + body("<joint name='j'/>")), "2: joint 'j'", "taken");
  expect_refused(world(body("<joint/><geom/>")), "2: <geom>", "not above 0");
  expect_refused(world(body("<joint/><geom size='0.1' mass='-1'/>")), "2: <geom>", "negative mass");
  expect_refused(world(body("<joint/><geom type='capsule' size='0.1' fromto='1 1 1 1 1 1'/>")), "2: <geom>",
                 "both ends");
  expect_refused(world("<body quat='1 0 0 0' euler='0 0 0'/>"), "2: <body>", "two orientations");
  expect_refused(world("<body quat='0 0 0 0'/>"), "2: <body>", "no length");
  expect_refused(world("<body xyaxes='1 0 0 2 0 0'/>"), "2: <body>", "no length");
  const string inertial = "<joint/><inertial pos='0 0 0' mass='1' ";
  expect_refused(world(body(inertial + "diaginertia='1 1 1' fullinertia='1 1 1 0 0 0'/>")), "2: <inertial>",
                 "has diaginertia and fullinertia");
  expect_refused(world(body(inertial + "euler='1 2 3' fullinertia='1 1 1 0 0 0'/>")), "2: <inertial>", "euler");
  expect_refused(world(body("<joint/>"), "<compiler inertiafromgeom='false'/>"), "2: body 'b'", "no <inertial>");
  expect_refused(world("", "<compiler eulerseq='xyw'/>"), "1: <compiler>", "eulerseq");
  expect_refused(world("", "<compiler coordinate='global'/>"), "1: <compiler>", "global");
  expect_refused("<mujoco/>", "1: <mujoco>", "no <worldbody>");
  expect_refused(world(pair, "<actuator><motor joint='z'/></actuator>"), "1:", "does not exist");
  expect_refused(world(pair, "<actuator><motor/></actuator>"), "1:", "acts on nothing");
  expect_refused(world(pair, "<actuator><position joint='x' kv='1' dampratio='1'/></actuator>"),
                 "1:", "kv and dampratio");
  expect_refused(world(pair, "<tendon><fixed/></tendon>"), "1: <fixed>", "no joints");
  const string slide = "<joint type='slide' springdamper='0.1 1'/>";
  expect_refused(world(body(slide + slide)), "2: <joint>", "has a springdamper, but moves no inertia");
  expect_refused(world("<replicate count='2.5'/>"), "2: <replicate>", "whole");
  expect_refused(world(body("<joint/>"), "<keyframe><key name='k' qpos='1 2'/></keyframe>"), "1: key 'k'",
                 "2 numbers, not 1", {.keyframe = "k"});
  const string key = "<keyframe><key name='k' qpos='0 0 0 1 0 0 0'/></keyframe>";
  expect_refused(world(body("<freejoint align='true'/>"), key), "1: key 'k'", "principal axes", {.keyframe = "k"});
  expect_refused(world(body("<joint type='free'/>"), "<compiler alignfree='true'/>" + key), "1: key 'k'",
                 "principal axes", {.keyframe = "k"});
  const string carrying = body("<freejoint align='true'/>" + body("", "c"));
  for (const string& alike : {body("<freejoint/>"), body("<freejoint align='auto'/>"), carrying})
    EXPECT_NO_THROW(import_mjcf(world(alike, key), "file", {.keyframe = "k"}));
}

// As MuJoCo 3.14 does.
TEST(MjcfRefusal, is_of_names_that_two_have) {
  const string twice = "has a name that is taken";
  expect_refused(world(body("<joint/><geom name='g' size='1'/><geom name='g' size='1'/>")), "2: geom 'g'", twice);
  expect_refused(world(body("<joint/><site name='s'/><site name='s'/>")), "2: <site>", "is taken");
  const string motor = "<motor name='m' joint='x'/>", length = "<fixed name='t'><joint joint='x' coef='1'/></fixed>";
  expect_refused(world(pair, "<actuator>" + motor + "</actuator><actuator>" + motor + "</actuator>"), "1: actuator 'm'",
                 twice);
  expect_refused(world(pair, "<tendon>" + length + length + "</tendon>"), "1: tendon 't'", twice);
  expect_refused(
      world(pair, "<equality><joint name='e' joint1='x'/><connect name='e' body1='one' anchor='0 0 0'/></equality>"),
      "1: connect 'e'", twice);
  expect_refused(world(pair, "<keyframe><key name='k'/><key name='k'/></keyframe>"), "1: key 'k'", twice);
  const string sensor = "<jointpos name='s' joint='x'/>";
  expect_refused(world(pair, "<sensor>" + sensor + sensor + "</sensor>"), "1: jointpos 's'", twice);
  const string exclude = "<exclude name='e' body1='one' body2='two'/>";
  expect_refused(world(pair, "<contact>" + exclude + exclude + "</contact>"), "1: exclude 'e'", twice,
                 {.colliders = true});
  const string nameless = "<exclude body1='one' body2='two'/>";
  EXPECT_NO_THROW(import_mjcf(world(pair, "<contact>" + nameless + nameless + "</contact>"), "", {.colliders = true}));
}

TEST(MjcfRefusal, is_of_names_that_nothing_has) {
  const auto expect = [](const string& text, const string& place, const string& rule, const string& meant) {
    expect_refused(text, place, rule + ", which does not exist", {.colliders = true});
    try {
      import_mjcf(text, "file", {.colliders = true});
    } catch (const ImportError& error) {
      EXPECT_NE(error.remedy().find(meant), string::npos) << error.what();
    }
  };
  const string arm = body("<joint name='elbow'/><geom name='forearm' size='1'/><site name='wrist'/>", "hand") + pair;
  expect(world(arm, "<contact><exclude body1='one' body2='hnad'/></contact>"), "1: <exclude>", "names body 'hnad'",
         "'hand' exists");
  expect(world(arm, "<contact><pair name='p' geom1='forarm' geom2='forearm'/></contact>"), "1: pair 'p'",
         "names geom 'forarm'", "'forearm' exists");
  expect(world(arm, "<actuator><motor name='m' joint='elbwo'/></actuator>"), "1: actuator 'm'", "names joint 'elbwo'",
         "'elbow' exists");
  expect(world(arm, "<actuator><motor site='wrists'/></actuator>"), "1: <motor>", "names site 'wrists'",
         "'wrist' exists");
  expect(world(arm, "<tendon><spatial name='t'><site site='wirst'/></spatial></tendon>"), "1: <site>",
         "names site 'wirst'", "'wrist' exists");
  expect(world(arm, "<equality><joint joint1='completely'/></equality>"), "1: equality <joint>",
         "names joint 'completely'", "read the file that includes this one");
}

// MuJoCo refuses them, too: whoever misspells a name has another model in mind.
TEST(MjcfRefusal, is_of_misspelt_names_in_what_a_model_has_no_use_for) {
  const auto expect = [](const string& text, const string& place, const string& rule, const string& meant) {
    for (const bool colliders : {false, true}) {
      expect_refused(text, place, rule + ", which does not exist", {.colliders = colliders});
      try {
        import_mjcf(text, "file", {.colliders = colliders});
      } catch (const ImportError& error) {
        EXPECT_NE(error.remedy().find("'" + meant + "' exists"), string::npos) << error.what();
      }
    }
  };
  const string arm = body(
                         "<joint name='elbow'/><geom name='forearm' size='1'/><site name='wrist'/>"
                         "<camera name='palm'/>",
                         "hand") +
                     pair;
  const string motor = "<actuator><motor name='servo' joint='elbow'/></actuator>";
  const auto sensor = [&](const string& element) { return world(arm, motor + "<sensor>" + element + "</sensor>"); };
  expect(world(arm, "<contact><exclude body1='one' body2='hnad'/></contact>"), "1:", "names body 'hnad'", "hand");
  expect(world(arm, "<contact><pair geom1='forarm' geom2='forearm'/></contact>"), "1:", "names geom 'forarm'",
         "forearm");
  expect(sensor("<jointpos name='s' joint='elbwo'/>"), "1: jointpos 's'", "names joint 'elbwo'", "elbow");
  expect(sensor("<actuatorfrc actuator='sevro'/>"), "1:", "names actuator 'sevro'", "servo");
  expect(sensor("<framepos objtype='site' objname='wirst'/>"), "1:", "names site 'wirst'", "wrist");
  expect(sensor("<framepos objtype='xbody' objname='hand' reftype='camera' refname='plam'/>"),
         "1:", "names camera 'plam'", "palm");
  expect(sensor("<camprojection site='wrist' camera='plam'/>"), "1:", "names camera 'plam'", "palm");
  expect(world(arm, "<custom><tuple name='t'><element objtype='geom' objname='foream'/></tuple></custom>"),
         "1:", "names geom 'foream'", "forearm");
  const string assets =
      "<asset><texture name='wood' type='2d' builtin='flat' width='1' height='1'/>"
      "<material name='steel' texture='wood'/></asset>";
  expect(world(body("<joint/><geom size='1' material='stele'/>"), assets), "2:", "names material 'stele'", "steel");
  expect(world(arm, "<asset><texture name='wood'/><material name='m' texture='wodo'/></asset>"), "1: material 'm'",
         "names texture 'wodo'", "wood");
  expect(world(arm + body("<camera mode='targetbody' target='hnad'/>")), "2:", "names body 'hnad'", "hand");
  expect(world(arm + body("<light mode='targetbody' target='hnad'/>")), "2:", "names body 'hnad'", "hand");
  const string right =
      "<framepos objtype='site' objname='wrist' reftype='camera' refname='palm'/><jointpos "
      "joint='elbow'/><actuatorfrc actuator='servo'/>";
  EXPECT_NO_THROW(import_mjcf(sensor(right)));
  EXPECT_NO_THROW(import_mjcf(world(body("<joint/><geom size='1' material='steel'/>"), assets)));
}

TEST(MjcfRefusal, is_of_names_that_two_have_in_what_a_model_has_no_use_for) {
  const string twice = "has a name that is taken";
  const string material = "<material name='m'/>", number = "<numeric name='n' data='1'/>";
  expect_refused(world(pair, "<asset>" + material + material + "</asset>"), "1: material 'm'", twice);
  expect_refused(world(pair, "<asset><mesh file='a.stl'/><mesh name='a' file='b.stl'/></asset>"), "1: mesh 'a'", twice);
  expect_refused(world(pair, "<custom>" + number + number + "</custom>"), "1: numeric 'n'", twice);
  expect_refused(world(pair + body("<camera name='c'/>", "b") + body("<camera name='c'/>", "d")), "2: camera 'c'",
                 twice);
  EXPECT_NO_THROW(import_mjcf(world(pair, "<asset>" + material + "<texture name='m'/></asset>")));
}

// Parts of a ball have names here, and none in a file.
TEST(MjcfRefusal, is_of_parts_of_balls_and_of_names_that_balls_have) {
  const string hip = body("<joint name='hip' type='ball'/>", "one");
  expect_refused(world(hip, "<actuator><motor joint='hip.z' gear='0 0 1'/></actuator>"), "1:", "hip.z");
  expect_refused(world(hip + body("<joint name='hip'/>", "two")), "2:", "has a name that is taken");
  const Import import = import_mjcf(
      world(body("<joint/>", "hip") + hip, "<actuator><motor joint='hip' gear='0 1 0'/></actuator>"), "test");
  EXPECT_EQ(joint(import.model, "hip.y").kind, JointKind::ball);
  EXPECT_NE(report_of(import).find("of hip.y: 1 u"), string::npos) << report_of(import);
}

// Only where a step would need its length.
TEST(MjcfRefusal, is_of_tendons_that_wrap_around_geoms) {
  const auto file = [](const string& attributes) {
    return world("<site name='a'/>" + body("<joint name='j'/><geom name='drum' size='0.1'/><site name='b'/>", "one"),
                 "<tendon><spatial name='t' " + attributes +
                     "><site site='a'/><geom geom='drum'/><site site='b'/></spatial></tendon>");
  };
  expect_refused(file("stiffness='3'"), "1: tendon 't'", "wraps around geom 'drum'");
  expect_refused(file("range='0 1' limited='true'"), "1: tendon 't'", "wraps around geom");
  EXPECT_TRUE(import_mjcf(file(""), "test").model.couplings.empty());
  expect_refused(world("<site name='a'/>" + pair, "<tendon><spatial name='t'><site site='a'/></spatial></tendon>"),
                 "1: tendon 't'", "joins no two sites");
  expect_refused(world("<site name='a'/>" + pair,
                       "<tendon><spatial name='t'><site site='a'/><pulley divisor='0'/></spatial></tendon>"),
                 "1: <pulley>", "divisor is not above 0");
}

TEST(MjcfRefusal, is_of_elements_in_others_that_have_no_use_for_them) {
  const string rule = "stands where MJCF has none";
  expect_refused(world(pair, "<flag gravity='disable'/>"), "1: <flag>", rule);
  expect_refused(world(pair, "<actuator><fixed name='t'/></actuator>"), "1: <fixed>", rule);
  expect_refused(world(pair, "<tendon><motor joint='x'/></tendon>"), "1: <motor>", rule);
  expect_refused(world(pair + "<light><geom size='1'/></light>"), "2: <geom>", rule);
  expect_refused(world(body("<joint/><camera><body/></camera>")), "2: <body>", rule);
}

// MuJoCo 3.3.8 has each of these.
TEST(MjcfRefusal, is_of_branches_of_tendons_that_join_no_two_sites) {
  const auto path = [](const string& inside) {
    return world("<site name='a'/>" + body("<joint/><geom size='0.1'/><site name='b'/><site name='c'/>", "one"),
                 "<tendon><spatial name='t'>" + inside + "</spatial></tendon>");
  };
  const string a = "<site site='a'/>", b = "<site site='b'/>", c = "<site site='c'/>", pulley = "<pulley divisor='2'/>";
  for (const string& inside : {a + b + pulley, a + b + pulley + pulley + a + c, a + b + pulley + c, a + pulley + b + c})
    expect_refused(path(inside), "1: tendon 't'", "a branch beside a pulley that joins none");
  EXPECT_NO_THROW(import_mjcf(path(pulley + a + b)));
  EXPECT_NO_THROW(import_mjcf(path(a + b + pulley + a + c)));
}

TEST(MjcfRefusal, is_of_parts_in_two_places) {
  const auto capsule = [](const string& place) {
    return world(body("<joint/><geom type='capsule' size='0.1' fromto='0 0 0 1 0 0' " + place + "/>"));
  };
  expect_refused(capsule("pos='1 2 3'"), "2: <geom>", "has a fromto and a pos");
  EXPECT_NO_THROW(import_mjcf(capsule("quat='0 1 0 0'")));  // MuJoCo takes that
  expect_refused(world("<site name='s' pos='1 0 0' fromto='0 0 0 1 0 0'/>" + pair), "2:", "has a fromto and a pos");
}

TEST(MjcfRefusal, is_of_actuators_that_could_mean_two_things) {
  const string length = "<tendon><fixed name='t'><joint joint='x' coef='1'/></fixed></tendon>";
  const auto actuator = [&](const string& attributes, const string& joint = "<joint name='x' range='-90 90'/>") {
    return world(body(joint, "one"), length + "<actuator><position " + attributes + "/></actuator>");
  };
  expect_refused(actuator("joint='x' tendon='t'"), "1: actuator '#0'", "acts on a joint and on a tendon");
  expect_refused(actuator("joint='x' ctrllimited='true'"), "1: actuator '#0'",
                 "has ctrllimited=\"true\", but no ctrlrange");
  expect_refused(actuator("joint='x' inheritrange='1' ctrlrange='-1 1'"), "1:", "has ctrlrange and inheritrange");
  expect_refused(actuator("joint='x' inheritrange='1'", "<joint name='x'/>"), "1:", "inherits a range");
  for (const string group : {"31", "-1", "0.5"})
    expect_refused("<mujoco><option actuatorgroupdisable='" + group + "'/><worldbody/></mujoco>", "1: <option>",
                   "which is no group");
}

TEST(MjcfRefusal, names_remedies_of_mjcf_alone) {
  const string mesh = "<asset><mesh name='m' file='part.stl'/></asset>";
  try {
    import_mjcf("<mujoco>" + mesh + "<worldbody><body><joint/><geom type='mesh' mesh='m'/></body></worldbody></mujoco>",
                "file", {.leave_out_meshes = true});
    FAIL() << "accepted";
  } catch (const ModelError& error) {
    EXPECT_EQ(error.remedy().find("density"), string::npos) << error.what();
    EXPECT_NE(error.remedy().find("ImportOptions::least_mass"), string::npos) << error.what();
  }
  expect_refused(world(body("<joint/><geom size='0.1' pos='1 0 0' mass='1e300'/>")), "2: body 'b'", "1e100 kg");
}

TEST(MjcfRefusal, names_options_that_do_not_fit) {
  const auto expect = [](const ImportOptions& options, const string& name, const string& remedy = "") {
    try {
      import_mjcf(world(pair), "file", options);
      ADD_FAILURE() << name;
    } catch (const SettingsError& error) {
      EXPECT_EQ(error.element(), "ImportOptions::" + name);
      EXPECT_NE(error.remedy().find(remedy), string::npos) << error.what();
    }
  };
  expect({.density = 1.0}, "density");
  expect({.leave_out_foreign = true}, "leave_out_foreign");
  expect({.keyframe = "home"}, "keyframe");
  expect({.body = "three"}, "body");
  expect({.body = "twoo"}, "body", "'two' exists");
  expect({.ignore = {.friction = {"xx"}}}, "ignore", "correct the name");
  for (const auto& [options, name] : {std::pair<ImportOptions, string>{{.keyframe = "k"}, "keyframe"},
                                      {{.body = "b"}, "body"},
                                      {{.loops = Loops::leave_out}, "loops"},
                                      {{.soft = Soft::as_in_file}, "soft"},
                                      {{.self_collisions = false}, "self_collisions"}})
    try {
      import_urdf("<robot name='r'><link name='a'/></robot>", "file", options);
      ADD_FAILURE() << name;
    } catch (const SettingsError& error) {
      EXPECT_EQ(error.element(), "ImportOptions::" + name);
    }
}

TEST(MjcfRefusal, sends_each_format_to_its_reader) {
  expect_refused("<robot name='r'/>", "1: <robot>", "URDF");
  expect_refused("<sdf/>", "1: <sdf>", "is SDF");
  try {
    import_urdf(world(""), "file");
    FAIL() << "accepted";
  } catch (const ImportError& error) {
    EXPECT_NE(error.remedy().find("import_mjcf_file"), string::npos) << error.what();
  }
}

// A folder of files for one test.
class MjcfFiles : public testing::Test {
 protected:
  void SetUp() override {
    folder = std::filesystem::temp_directory_path() / ("lockstep_mjcf_" + std::to_string(getpid()));
    std::filesystem::create_directories(folder / "robot/parts");
  }
  void TearDown() override { std::filesystem::remove_all(folder); }
  void write(const string& name, const string& text) const { std::ofstream(folder / name) << text; }
  void expect_refused_file(const string& place, const string& rule) const {
    try {
      import_mjcf_file(folder / "robot/main.xml");
      ADD_FAILURE() << "accepted";
    } catch (const ImportError& error) {
      EXPECT_TRUE(error.element().starts_with((folder / "robot" / place).string())) << error.what();
      EXPECT_NE(error.rule().find(rule), string::npos) << error.what();
    }
  }
  std::filesystem::path folder;
};

TEST_F(MjcfFiles, are_included_from_their_folder_alone) {
  write("outside.xml", world(""));
  std::filesystem::create_symlink(folder / "outside.xml", folder / "robot/link.xml");
  const auto including = [](const string& name) { return world("", "\n<include file='" + name + "'/>"); };
  for (const auto& [name, rule] : {std::pair<string, string>{"/etc/passwd", "outside of the folders"},
                                   {"../outside.xml", "outside of the folders"},
                                   {"link.xml", "outside of the folders"},
                                   {"parts/../../outside.xml", "outside of the folders"},
                                   {"https://example.org/a.xml", "names no path"},
                                   {"none.xml", "does not exist"},
                                   {"", "is empty"},
                                   {"main.xml", "twice"}}) {
    write("robot/main.xml", including(name));
    expect_refused_file("main.xml:2: <include>", rule);
  }
  write("robot/main.xml", including("a.xml"));
  write("robot/a.xml", "<mujoco>\n\n<include file='parts/b.xml'/></mujoco>");
  write("robot/parts/b.xml", "<mujoco><include file='c.xml'/></mujoco>");
  write("robot/parts/c.xml", "<mujoco><include file='a.xml'/></mujoco>");
  expect_refused_file("parts/c.xml:1: <include>", "twice");
  write("robot/parts/c.xml", "<mujoco><worldbody><body><joint/></mujoco>");
  expect_refused_file("parts/c.xml:1", "well-formed");
  write("robot/parts/c.xml", "<mujoco>\n<worldbody><joint/></worldbody></mujoco>");
  expect_refused_file("parts/c.xml:2: <joint>", "world");
  write("robot/parts/c.xml", "<robot/>");
  expect_refused_file("parts/c.xml:1", "no MJCF");
  EXPECT_THROW(import_mjcf(including("a.xml")), ImportError);
}

TEST_F(MjcfFiles, are_included_to_a_bounded_depth) {
  for (int i = 0; i < 30; ++i)
    write("robot/" + std::to_string(i) + ".xml",
          "<mujoco><include file='" + std::to_string(i + 1) + ".xml'/></mujoco>");
  write("robot/main.xml", world("", "<include file='0.xml'/>"));
  expect_refused_file("19.xml:1", "deeper than 20");
}

TEST_F(MjcfFiles, are_told_from_urdf_by_the_root) {
  write("robot/main.xml", world(pair));
  write("robot/a.urdf", "<robot name='r'><link name='a'/></robot>");
  EXPECT_EQ(import_file(folder / "robot/main.xml").model.joints.size(), 2u);
  EXPECT_EQ(import_file(folder / "robot/a.urdf").model.name, "r");
  EXPECT_THROW(import_file(folder / "robot/none"), ImportError);
}

TEST(MjcfHostile, is_refused_in_bounded_time_and_memory) {
  string deep = ball, defaults;
  for (int i = 0; i < 90; ++i) deep = "<body><joint/>" + ball + deep + "</body>";
  EXPECT_EQ(import_mjcf(world(deep)).model.joints.size(), 90u);
  for (int i = 0; i < 200; ++i) deep = "<body>" + deep + "</body>";
  expect_refused(world(deep), "2", "nests elements deeper");
  for (int i = 0; i < 90; ++i) defaults = "<default class='c" + std::to_string(i) + "'>" + defaults + "</default>";
  EXPECT_NO_THROW(import_mjcf(world(body("<joint class='c0'/>"), "<default>" + defaults + "</default>")));
  for (int i = 0; i < 100; ++i) defaults = "<default class='d" + std::to_string(i) + "'>" + defaults + "</default>";
  expect_refused(world(pair, "<default>" + defaults + "</default>"), "1", "nests elements deeper");
  expect_refused(world("<replicate count='1000000'>" + body("<joint/>", "r") + "</replicate>"), "2: <replicate>",
                 "copies");
  string nested = "<geom size='0.1'/>";
  for (int i = 0; i < 20; ++i) nested = "<replicate count='100'>" + nested + "</replicate>";
  expect_refused(world(nested), "2: <replicate>", "copies");
  expect_refused(world(pair, "<equality><joint joint1='x' joint2='y' polycoef='nan 1'/></equality>"), "1:", "finite");
  expect_refused(world("<body pos='1e400 0 0'/>"), "2: <body>", "beyond the range");
  expect_refused(world(body("<joint range='0 inf'/>")), "2: <joint>", "finite");
  expect_refused("<!DOCTYPE d [<!ENTITY e 'x'>]>" + world(pair), "1", "entities");
  expect_refused("<mujoco><worldbody>", "1", "well-formed");
  expect_refused(world("<replicate count='-5'/>"), "2: <replicate>", "count of 0");
}

// What the parser would compare with each other is counted before.
TEST(MjcfRefusal, of_many_attributes_comes_before_they_are_compared) {
  string many = "<mujoco><option";
  for (int i = 0; i < 200000; ++i) many += " a" + std::to_string(i) + "='0'";
  expect_refused(many + "/></mujoco>", "1", "more than 5000 attributes");
  const string before = "<mujoco><option x='<!--'", behind = many.substr(string("<mujoco><option").size());
  expect_refused(before + behind + " z='-->'/></mujoco>", "1", "more than 5000 attributes");
  expect_refused("<mujoco><option x='<'" + behind + "/></mujoco>", "1", "more than 5000 attributes");
  string comment = "<!--";
  for (int i = 0; i < 20000; ++i) comment += " a == b";
  EXPECT_NO_THROW(import_mjcf(world(comment + "-->" + body("<joint/>")), "file"));
}

// MuJoCo refuses all that stands elsewhere than in its schema. What moves is not left out for that.
TEST(MjcfRefusal, of_parts_of_the_mechanism_that_stand_where_they_are_not_read) {
  expect_refused(world(body("<joint><body name='c'/></joint>")), "2: <body>", "stands where");
  expect_refused(world(body("<joint/><geom size='0.1'><joint name='k'/></geom>")), "2: <joint>", "stands where");
  expect_refused(world("<option gravity='0 0 0'/>" + body("<joint/>")), "2: <option>", "stands where");
  expect_refused(world(body("<joint/>"), "<default><joint damping='1'/><joint armature='1'/></default>"), "1: <joint>",
                 "once more");
  EXPECT_NO_THROW(
      import_mjcf(world(body("<joint/>") + "<replicate count='0'>" + body("<joint/>", "c") + "</replicate>"), "file"));
  expect_refused(world(body("<joint/>"), "<compiler><option gravity='0 0 0'/></compiler>"), "1: <option>",
                 "stands where");
}

}  // namespace
}  // namespace lockstep
