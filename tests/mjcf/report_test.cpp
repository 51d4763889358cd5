// What is lost, changed or not used is named; options do what they say. SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "lockstep/batch.h"
#include "lockstep/error.h"
#include "lockstep/plan.h"
#include "mjcf/worlds.h"
#include "unit/import_helpers.h"

namespace lockstep {
namespace {

struct Line {
  bool is_warning;
  string text, line;
  ImportOptions options = {};
};

// One line each, in the report or among the warnings, too.
const std::vector<Line> lines = {
    {false, world(pair, "<option timestep='0.003'/>"), "step size of the file, kept as Model::time_step (1): 0.003 s"},
    {true, world(pair, "<option viscosity='0.1' density='2'/>"), "forces of a fluid, left out (2): density, viscosity"},
    {true, world(pair, "<option wind='1 0 0'/>"), "forces of a fluid, left out (1): wind"},
    {true,
     world(pair,
           "<option><flag gravity='disable' limit='disable' equality='disable' actuation='disable' "
           "frictionloss='disable' spring='disable'/></option>"),
     "switched off by the file's flags, left out (6): equality, limit, frictionloss, spring, actuation, gravity"},
    {true, world(pair, "<option><flag constraint='disable' passive='disable'/></option>"),
     "switched off by the file's flags, left out (2): constraint, passive"},
    {false, world(body("<joint range='-1 90' solreflimit='0.01 2'/>", "a")),
     "position limits made hard, soft in MuJoCo: 1 of solref 0.01 2, solimp 0.9 0.95 0.001 0.5 2"},
    {true, world(body("<joint range='-1 90' margin='0.2'/>", "a")),
     "margins of position limits, left out (1): 0.2 of <joint>"},
    {true, world(body("<joint range='9 1'/>", "a")),
     "ranges that are empty, so that they limit nothing (1): range of <joint>"},
    {true, world(body("<joint name='j' actuatorfrcrange='-1 2'/>", "a")),
     "effort limits whose ends differ, taken as the smaller one (1): actuatorfrcrange of joint 'j' is -1 to 2"},
    {true, world(body("<joint name='j' actuatorgravcomp='true'/>", "a")),
     "gravity compensation by actuators, made passive: no effort limit bounds it (1): joint 'j'"},
    {true, world(body("<joint name='j' type='free' armature='1'/>", "a")),
     "springs, damping, armature and friction of free joints, left out (1): joint 'j': 0 0 1 0"},
    {true, world(body("<joint range='-0.5 0.7'/>", "a")),
     "no <compiler angle>, so hinge angles are degrees, and perhaps meant as radians (1): the widest range ends at 0.7 "
     "degrees"},
    {false, world(pair, "<compiler settotalmass='3'/>"), "masses scaled to the file's total mass (1): 3 kg"},
    {false,
     world(body("<joint/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>", "a"),
           "<compiler inertiafromgeom='true'/>"),
     "inertials that geoms override (1): a"},
    {true, world(pair + "<body name='m' mocap='true'/>"),
     "mocap bodies, part of the world: Parameter::loop_frame moves their loops, not their geoms (1): m"},
    {false, world(pair, "<equality><connect body1='one' body2='two' anchor='0 0 0' solref='0.1 2'/></equality>"),
     "loops made hard, soft in MuJoCo: 1 of solref 0.1 2, solimp 0.9 0.95 0.001 0.5 2"},
    {false,
     world(pair, "<equality><weld body1='one'/></equality>"),
     "loops soft as in MuJoCo, without its virtual mass: 1 of solref 0.02 1, solimp 0.9 0.95 0.001 0.5 2",
     {.soft = Soft::as_in_file}},
    {false,
     world(pair, "<equality><joint joint1='x' joint2='y' polycoef='0 1 0.5 0 0'/></equality>"),
     "followers by a function made hard, soft in MuJoCo: 1 of solref 0.02 1, solimp 0.9 0.95 0.001 0.5 2",
     {.soft = Soft::as_in_file}},
    {true, world(pair, "<equality><weld name='w' body1='one' body2='two' torquescale='0.5'/></equality>"),
     "torque scales of welds, left out (1): 0.5 of weld 'w'"},
    {true,
     world(pair, "<equality><weld name='w' body1='one' body2='two'/></equality>"),
     "loops of bodies left out, left out (1): MJCF text:1: weld 'w'",
     {.body = "one"}},
    {true, world(pair, "<equality><weld name='w' body1='one' body2='two' active='false'/></equality>"),
     "equalities that are not active, left out (1): MJCF text:1: weld 'w'"},
    {false, world(floating + body("", "table")), "bodies that stand still beside floating ones, left out (1): table"},
    {false, world(floating + body("", "table")), "masses of bodies that stand still, left out: 1 4.18879 kg"},
    {false, world(floating + "<site name='s'/>"), "sites in the world, left out (1): s"},
    {false, world(pair + "<site/>"), "not used: 1 site without a name"},
    {false, world(body("<joint name='p'/><joint name='q' axis='1 0 0'/>", "a")),
     "links without mass between the joints of one body (1): p"},
    {false, world(pair + "<body><geom type='mesh' mesh='m'/></body>", "<asset><mesh name='m' file='m.stl'/></asset>"),
     "meshes that give bodies that stand still no mass, as they are not opened (1): MJCF text:1: <geom>"},
    {true,
     world(body("<joint/><geom type='mesh' mesh='m'/>", "a"), "<asset><mesh name='m' file='m.stl'/></asset>"),
     "meshes that give moving bodies no inertia, left out on request (1): MJCF text:1: <geom>",
     {.leave_out_meshes = true}},
    {true, world(body("<joint/><plugin plugin='p'/>", "a")), "plugins, left out (1): MJCF text:1: <plugin>"},
    {false, world(pair + "<body name='g' gravcomp='-1'><joint/>" + ball + "</body>"),
     "gravcomp below 0 with none above, which MuJoCo does not use (1): g"},
    {true, world(pair, "<equality><joint joint1='x' joint2='y' active='false'/></equality>"),
     "equalities that are not active, left out (1): MJCF text:1: equality <joint>"},
    {true,
     world(pair, "<equality><connect name='c' body1='one' body2='two' anchor='0 0 0'/></equality>"),
     "closed loops, left out on request (1): MJCF text:1: connect 'c'",
     {.loops = Loops::leave_out}},
    {false, world(pair + body("", "still"), "<equality><weld name='w' body1='still'/></equality>"),
     "loops of bodies that do not move against each other, without effect (1): MJCF text:1: weld 'w'"},
    {true,
     world(pair, "<equality><joint joint1='x' joint2='y'/></equality>"),
     "equalities of bodies left out, left out (1): MJCF text:1: equality <joint>",
     {.body = "one"}},
    {false, world(pair), "bodies left out on request (1): 1 beside one", {.body = "one"}},
    {false, world(pair, "<equality><joint joint1='x'/></equality>"),
     "joints that an equality holds alone, made fixed (1): x at 0"},
    {false, world(pair, "<equality><joint joint1='x'/><joint joint1='x'/></equality>"),
     "equalities that hold anyway (1): MJCF text:1: equality <joint>"},
    {false, world(pair, "<equality><joint joint1='x' joint2='y'/><joint joint1='y' joint2='x'/></equality>"),
     "equalities that follow from others (1): MJCF text:1: equality <joint>"},
    {false, world(pair, "<equality><joint joint1='x' joint2='y' solref='0.1 2'/></equality>"),
     "couplings made hard, soft in MuJoCo: 1 of solref 0.1 2, solimp 0.9 0.95 0.001 0.5 2"},
    {false,
     world(pair, "<equality><joint joint1='x' joint2='y'/></equality>"),
     "couplings soft as in MuJoCo, without its virtual mass: 1 of solref 0.02 1, solimp 0.9 0.95 0.001 0.5 2",
     {.soft = Soft::as_in_file}},
    {false, world(pair, "<equality><joint joint1='x' joint2='y' polycoef='0.5 1'/></equality>"),
     "followers that start where their coupling puts them (1): x at 0.5"},
    {false,
     world(pair,
           "<tendon><fixed name='t' range='0 1'>"
           "<joint joint='x' coef='1'/><joint joint='y' coef='1'/></fixed></tendon>"),
     "tendons as joints of their own, whose position is the tendon's length (1): t"},
    {false,
     world(pair,
           "<tendon><fixed name='t' frictionloss='1'>"
           "<joint joint='x' coef='1'/><joint joint='y' coef='1'/></fixed></tendon>"),
     "tendons as joints of their own, whose position is the tendon's length (1): t"},
    {false,
     world(pair,
           "<tendon><fixed name='t' armature='1'>"
           "<joint joint='x' coef='1'/><joint joint='y' coef='1'/></fixed></tendon>"),
     "tendons as joints of their own, whose position is the tendon's length (1): t"},
    {false,
     world(pair,
           "<tendon><fixed name='t' armature='1'>"
           "<joint joint='x' coef='1'/><joint joint='y' coef='1'/></fixed></tendon>"),
     "armature of tendons across branches, which MuJoCo keeps on each branch alone (1): t"},
    {false,
     world(pair,
           "<tendon><fixed name='t'><joint joint='x' coef='1'/><joint joint='y' coef='1'/></fixed></tendon>"
           "<actuator><motor name='m' tendon='t' gear='2'/></actuator>"),
     "efforts by the file's controls u (1): m of t: 2 u"},
    {false, world(pair, "<tendon><fixed name='t' range='-1 1'><joint joint='x' coef='1'/></fixed></tendon>"),
     "limits of tendons, on the joint that moves them (1): t on x"},
    {false,
     world(pair,
           "<tendon><fixed name='t' stiffness='1' springlength='0 1'><joint joint='x' coef='1'/></fixed></tendon>"),
     "springs of tendons with a range without force, as soft limits of tendons (1): t"},
    {false,
     world(
         pair,
         "<tendon><fixed name='t' damping='1'><joint joint='x' coef='1'/><joint joint='y' coef='1'/></fixed></tendon>"),
     "springs of tendons, as soft couplings (1): t"},
    {false,
     world(pair,
           "<equality><joint joint1='x'/></equality><tendon><fixed name='t' damping='1'><joint joint='x' "
           "coef='1'/></fixed></tendon>"),
     "tendons whose length no joint changes, without effect (1): t (damping 1)"},
    {true,
     world(pair, "<tendon><fixed name='t'><joint joint='x' coef='1'/><joint joint='x' coef='2'/></fixed></tendon>"),
     "joints that a tendon names twice, summed; the last alone gives forces in MuJoCo (1): x of tendon 't'"},
    {true,
     world(pair,
           "<tendon><fixed name='t' frictionloss='1'><joint joint='x' coef='1'/>"
           "<joint joint='y' coef='1e-7'/></fixed></tendon>"),
     "joints that move a tendon by less than a millionth of what others do, left out (1): y of t"},
    {false, world(pair, "<tendon><fixed name='t' range='-1 1'><joint joint='x' coef='1'/></fixed></tendon>"),
     "position limits made hard, soft in MuJoCo: 1 of solref 0.02 1, solimp 0.9 0.95 0.001 0.5 2"},
    {true,
     world("<site name='a'/>" + body("<joint name='j'/><geom size='1'/><site name='b' pos='1 0 0'/>", "one"),
           "<tendon><spatial name='t' armature='0.1' damping='1'><site site='a'/><site site='b'/></spatial></tendon>"),
     "armature of spatial tendons, left out (1): 0.1 of t"},
    {false,
     world("<site name='a'/><site name='b' pos='1 0 0'/>" + pair,
           "<tendon><spatial name='t' damping='1'><site site='a'/><site site='b'/></spatial></tendon>"),
     "tendons whose length no joint changes, without effect (1): t (damping 1)"},
    {true,
     world(pair, "<tendon><fixed name='t' damping='1'><joint joint='y' coef='1'/></fixed></tendon>"),
     "tendons over bodies left out, left out (1): t (damping 1)",
     {.body = "one"}},
    {false, world(body("<joint name='s' springdamper='0.1 1'/>", "a")),
     "springs by springdamper, at the inertia of the drawn pose (1): s 1.67552, damping 0.335103"},
    {false, world(pair, "<actuator><motor name='m' joint='x' gear='3'/></actuator>"),
     "efforts by the file's controls u (1): m of x: 3 u"},
    {false, world(pair, "<actuator><position name='m' joint='x' gear='2'/></actuator>"),
     "servos, with position targets by the file's controls u (1): m of x: 0.5 u"},
    {false, world(pair, "<actuator><velocity name='m' joint='x' gear='2'/></actuator>"),
     "servos, with velocity targets by the file's controls u (1): m of x: 0.5 u"},
    {false, world(pair, "<actuator><position joint='x' ctrlrange='-1 2'/></actuator>"),
     "ranges of servos' controls, which no step keeps: 1 -1 to 2"},
    {false, world(pair, "<actuator><position name='m' joint='x' kp='4' dampratio='0.5'/></actuator>"),
     "damping of servos by dampratio, at the inertia of the drawn pose (1): m 0.258883"},
    {false, world(pair, "<actuator><motor joint='x'/><position joint='x'/></actuator>"),
     "joints with several actuators, whose gains are added (1): x"},
    {true, world(pair, "<actuator><motor joint='x' ctrlrange='-1 1'/><position joint='x'/></actuator>"),
     "limits of single actuators that share a joint, taken for their sum (1): x"},
    {false, world(pair, "<actuator><general name='m' joint='x' dyntype='filter'/></actuator>"),
     "lags of actuators (1): 1 s at x"},
    {false, world(pair, "<actuator><position name='m' joint='x' timeconst='0.1'/></actuator>"),
     "lags of actuators (1): 0.1 s at x"},
    {false, world(pair, "<actuator><motor name='m' joint='x' delay='0.1'/></actuator>"),
     "delays of actuators, in steps of the file (1): 50 of m: 0.1 s"},
    {true, world(pair, "<actuator><motor name='m' joint='x' delay='3'/></actuator>"),
     "delays of actuators above 1000 steps, left out (1): 3 s of m"},
    {true, world(pair, "<actuator><motor joint='x'/><position joint='x' timeconst='0.1'/></actuator>"),
     "lags and delays of actuators that share a joint and differ, left out (1): x"},
    {true, world(pair, "<deformable><skin/><flex name='f' body='one' dim='1' element='0 1'/></deformable>"),
     "flexes, left out (1): MJCF text:1: <flex>"},
    {true, world(pair, "<actuator><intvelocity name='m' joint='x'/></actuator>"),
     "dynamics of actuators, left out (1): integrator of m"},
    {true, world(pair, "<actuator><muscle name='m' joint='x'/></actuator>"),
     "actuators left out (1): m is a muscle (1 u)"},
    {true, world(pair, "<actuator><damper name='m' joint='x' kv='1'/></actuator>"),
     "actuators left out (1): m is a damper (1 u)"},
    {true, world(pair, "<actuator><pid name='m' joint='x'/></actuator>"), "actuators left out (1): m is a pid (1 u)"},
    {true, world(pair, "<actuator><general name='m' joint='x' dyntype='pid' biastype='affine'/></actuator>"),
     "actuators left out (1): m has dynamics that are not linear (1 u)"},
    {true, world(pair, "<actuator><plugin name='m' joint='x'/></actuator>"),
     "actuators left out (1): m is a plugin (1 u)"},
    {true, world(pair + "<site name='s'/>", "<actuator><motor name='m' site='s'/></actuator>"),
     "actuators left out (1): m acts on a site (1 u)"},
    {true, world(pair + "<site name='s'/>", "<actuator><motor name='m' site='s' gear='0 0 2'/></actuator>"),
     "actuators left out (1): m acts on a site along 0 0 2 0 0 0 (1 u)"},
    {true, world(pair, "<actuator><adhesion name='m' body='one'/></actuator>"),
     "actuators left out (1): m is an adhesion (1 u)"},
    {true,
     world(body("<joint name='x' actuatorfrcrange='-1 1'/>", "one") + body("<joint name='y'/>", "two"),
           "<equality><joint joint1='y' joint2='x'/></equality><tendon><fixed name='t'><joint joint='x' coef='1'/>"
           "<joint joint='y' coef='1'/></fixed></tendon><actuator><motor tendon='t'/></actuator>"),
     "effort limits of single joints that a tendon drives together, kept as they are (1): x"},
    {true,
     world("<site name='a'/>" + body("<joint name='x' actuatorfrcrange='-1 1'/><site name='b' pos='1 0 0'/>", "one"),
           "<tendon><spatial name='t'><site site='a'/><site site='b'/></spatial></tendon>"
           "<actuator><motor tendon='t'/></actuator>"),
     "effort limits of single joints that a tendon drives together, kept as they are (1): x"},
    {true, world(floating, "<actuator><motor name='m' joint='f'/></actuator>"),
     "actuators left out (1): m acts on a free joint (1 u)"},
    {true,
     world(body("<joint name='b' type='ball'/>", "c"), "<actuator><motor name='m' joint='b' gear='0 1 2'/></actuator>"),
     "actuators left out (1): m acts on a ball joint along 0 1 2 0 0 0 (1 u)"},
    {true,
     world(body("<joint name='b' type='ball'/>", "c"), "<actuator><motor name='m' jointinparent='b'/></actuator>"),
     "actuators left out (1): m acts on a ball joint along its parent's axes (1 u)"},
    {true,
     world(pair, "<actuator><general name='m' joint='x' dyntype='filter' dynprm='0.2' actrange='-1 1'/></actuator>"),
     "ranges of the activation of actuators, left out (1): actuator 'm'"},
    {true, world("<replicate count='2' quat='0 1 0 0'>" + body("<joint/>", "one") + "</replicate>"),
     "places of replicates but offset and euler, without effect (1): MJCF text:1: <replicate>"},
    {true, world(body("<joint type='free' springdamper='1 1'/>", "one")),
     "springdampers of free joints, left out (1): <joint>"},
    {true, world(pair, "<actuator><general name='m' joint='x' biasprm='0 -1'/></actuator>"),
     "biasprm of actuators without a biastype, without effect (1): actuator 'm'"},
    {true, world(pair, "<actuator><general name='m' joint='x' biastype='affine' biasprm='0 1'/></actuator>"),
     "actuators left out (1): m pushes away from its target (1 u + 1 length)"},
    {true, world(pair, "<actuator><position name='m' joint='x' forcerange='0 3'/></actuator>"),
     "actuators left out (1): m pushes one way only (1 u + -1 length, force 0 to 3)"},
    {true, world(pair, "<actuator><general name='m' joint='x' gaintype='affine'/></actuator>"),
     "actuators left out (1): m has a gain that is not fixed (1 u)"},
    {true, world(pair, "<actuator><general name='m' joint='x' biastype='muscle'/></actuator>"),
     "actuators left out (1): m has a bias that is not affine (1 u)"},
    {true,
     world(pair, "<actuator><motor name='m' joint='y'/></actuator>"),
     "actuators left out (1): m acts on a body that is left out (1 u)",
     {.body = "one"}},
    {true, world(pair, "<equality><joint joint1='x'/></equality><actuator><motor name='m' joint='x'/></actuator>"),
     "actuators left out (1): m acts on what no joint moves (1 u)"},
    {true, world(pair, "<actuator><motor name='m' joint='x' forcerange='-1 3'/></actuator>"),
     "effort limits whose ends differ, taken as the smaller one (1): forcerange of actuator 'm' is -1 to 3"},
    {false, world(pair, "<keyframe><key name='k'/></keyframe>"), "keyframes, kept as poses (1): k"},
    {true, world(pair, "<keyframe><key name='k' qpos='1'/></keyframe>"),
     "keyframes that do not fit, left out (1): k qpos has 1 number, not 2"},
    {true,
     world(pair, "<keyframe><key name='k' act='1'/></keyframe>"),
     "parts of the keyframe, left out (1): act",
     {.keyframe = "k"}},
    {true,
     world(pair + body("<joint/><geom size='1'/><geom name='c' type='sdf' mesh='m' mass='0'/>", "a"),
           "<asset><mesh name='m' vertex='0 0 0 1 0 0 0 1 0 0 0 1'/></asset>"),
     "geoms of types that no collider has, left out of the colliders (1): sdf of c",
     {.colliders = true}},
    {false,
     world(pair),
     "contacts take lockstep's own softness, in MuJoCo: 2 of solref 0.02 1, solimp 0.9 0.95 0.001 0.5 2",
     {.colliders = true}},
    {true,
     world(body("<joint/><geom name='c' size='1' margin='0.1'/>", "a")),
     "margins and gaps of contacts, left out (1): c",
     {.colliders = true}},
    {true,
     world(body("<joint/><geom name='p' size='1'/>", "a") +
               body("<joint/><geom size='1'/><geom name='q' type='sdf' mesh='m' mass='0'/>", "b"),
           "<asset><mesh name='m' vertex='0 0 0 1 0 0 0 1 0 0 0 1'/></asset>"
           "<contact><pair geom1='p' geom2='q'/></contact>"),
     "contact pairs of geoms that are no colliders, left out (1): MJCF text:1: <pair>",
     {.colliders = true}},
    {true,
     world(body("<joint/><geom name='p' size='1'/>", "a") + body("<joint/><geom name='q' size='1'/>", "b"),
           "<contact><pair name='n' geom1='p' geom2='q' friction='0.1 0.5'/></contact>"),
     "contact pairs whose two tangential frictions differ, taken as the first (1): n of p and q has 0.1 and 0.5",
     {.colliders = true}},
    {true,
     world(body("<joint/><geom name='p' size='1'/>", "a") + body("<joint/><geom name='q' size='1'/>", "b"),
           "<contact><pair name='n' geom1='p' geom2='q' condim='6' friction='1 1 0.1 0.2 0.3'/></contact>"),
     "contact pairs whose two rolling frictions differ, taken as the first (1): n of p and q has 0.2 and 0.3",
     {.colliders = true}},
    {true,
     world(body("<joint/><geom name='p' size='1' friction='500'/>", "a") +
           body("<joint/><geom name='q' size='1'/>", "b")),
     "frictions above 100, taken as 100 (1): p",
     {.colliders = true}},
    {true, world(pair, "<option o_friction='1 0.5'><flag override='enable'/></option>"),
     "o_friction whose two tangential or two rolling frictions differ, taken as the first (1): option"},
    {false,
     world(body("<joint name='x' range='-1 1'/><geom size='1'/>", "a"),
           "<compiler angle='radian'/><actuator><position joint='x' kp='5' ctrllimited='true' "
           "inheritrange='2'/></actuator>"),
     "ranges of servos' controls, which no step keeps: 1 -2 to 2"},
    {true,
     world(body("<joint name='x'/><geom size='1'/>", "a"),
           "<option actuatorgroupdisable='0 2'/><actuator><motor name='m' joint='x' group='2'/></actuator>"),
     "actuators left out (1): m is of group 2, which actuatorgroupdisable switches off (1 u)"},
    {true,
     world(body("<joint/><geom name='c' size='1'/><geom name='d' size='1'/>", "a"),
           "<contact><pair geom1='c' geom2='d'/></contact>"),
     "contact pairs that cannot move against each other, left out (1): MJCF text:1: <pair>",
     {.colliders = true}},
    {true, world(body("<joint dampng='1'/>", "a")), "unknown, not used (check the spelling): 1 'dampng' of joint"},
    {true,
     world(body("<joint name='x' coef='2'/><geom size='1' kp='3'/>", "a"),
           "<tendon><fixed><joint joint='x' coef='1'/></fixed></tendon><actuator><motor joint='x' kp='5'/></actuator>"),
     "unknown, not used (check the spelling): 1 'coef' of joint, 1 'kp' of geom, 1 'kp' of motor"},
    {false, world(body("<joint user='2'/><geom size='1' rgba='1 1 1 1'/>", "a"), "<sensor kp='2'/>"),
     "not used: 1 'rgba' of geom, 1 'user' of joint, 1 sensor"},
    {false, world(pair, "<contact><exclude body1='one' body2='two'/></contact><sensor/><custom/>"),
     "not used: 1 custom, 1 exclude, 1 sensor"},
};

TEST(MjcfReport, names_what_is_lost_changed_and_not_used) {
  for (const Line& line : lines) {
    SCOPED_TRACE(line.text);
    try {
      const Import import = import_mjcf(line.text, "MJCF text", line.options);
      expect_reports(import, line.line);
      EXPECT_EQ(warns(import, line.line), line.is_warning);
    } catch (const Error& error) {
      ADD_FAILURE() << error.what();
    }
  }
}

TEST(MjcfOptions, soften_couplings_as_the_derivation_says) {
  const auto softness = [](const string& attributes) {
    const Import import =
        import_mjcf(world(pair, "<equality><joint joint1='x' joint2='y' " + attributes + "/></equality>"), "",
                    {.soft = Soft::as_in_file});
    return std::get<Frequency>(import.model.couplings.at(0).softness);
  };
  // With impedance d: mu = 1 / (t z sqrt(1 - d)) and zeta = z / sqrt(1 - d).
  EXPECT_NEAR(softness("").rad_per_s, 1.0 / (0.02 * std::sqrt(0.05)), 1e-9);
  EXPECT_NEAR(softness("").damping_ratio, 1.0 / std::sqrt(0.05), 1e-12);
  EXPECT_NEAR(softness("solref='0.1 0.5' solimp='0.8 0.84'").rad_per_s, 1.0 / (0.05 * 0.4), 1e-9);
  EXPECT_NEAR(softness("solref='-100 -4' solimp='0.5 0.75'").rad_per_s, 20.0, 1e-9);
  EXPECT_NEAR(softness("solref='-100 -4' solimp='0.5 0.75'").damping_ratio, 0.4, 1e-12);
}

TEST(MjcfOptions, start_in_a_keyframe) {
  const string text =
      world(pair,
            "<actuator><position joint='x' kp='4'/><motor joint='y' gear='2' ctrlrange='-1 1'/></actuator>"
            "<keyframe><key qpos='1 2'/><key name='k' qpos='0.1 0.2' qvel='3 4' ctrl='0.7 5'/></keyframe>");
  const Model drawn = import_mjcf(text).model, first = import_mjcf(text, "", {.keyframe = "0"}).model;
  const Model named = import_mjcf(text, "", {.keyframe = "k"}).model;
  EXPECT_EQ(joint(drawn, "x").position, 0.0);
  EXPECT_EQ(joint(first, "y").position, 2.0);
  EXPECT_EQ(joint(first, "x").drive.position_target, 1.0);  // servos hold the start
  EXPECT_EQ(joint(named, "x").position, 0.1);
  EXPECT_EQ(joint(named, "y").velocity, 4.0);
  EXPECT_EQ(joint(named, "x").drive.position_target, 0.7);
  EXPECT_EQ(joint(named, "y").effort, 2.0);  // MuJoCo clamps the control
}

// A model that starts in a key, and one that goes there, are the same.
TEST(MjcfOptions, keep_all_keyframes_as_poses) {
  const string text =
      world(pair + floating,
            "<option timestep='0.005'/><actuator><position joint='x' kp='4'/><motor joint='y' gear='2'/>"
            "<velocity joint='y' kv='3'/></actuator>"
            "<keyframe><key qpos='1 2 0 0 1 1 0 0 0'/>"
            "<key name='k' qpos='0.1 0.2 1 2 3 0 1 0 0' qvel='3 4 1 0 0 0 2 0' ctrl='0.7 0.5 0.25'/></keyframe>");
  const Model drawn = import_mjcf(text).model;
  EXPECT_EQ(drawn.time_step, 0.005);
  ASSERT_EQ(drawn.poses.size(), 2u);
  EXPECT_EQ(drawn.poses[0].name, "0");
  EXPECT_EQ(drawn.poses[1].name, "k");
  Batch<double> there(compile(drawn), 1);
  for (const NamedPose& pose : drawn.poses) {
    const Model model = import_mjcf(text, "", {.keyframe = pose.name}).model;
    EXPECT_EQ(model.poses.size(), 2u);
    Batch<double> starts(compile(model), 1);
    there.reset_to({0}, pose.name);
    EXPECT_TRUE((there.positions() == starts.positions()).all());
    EXPECT_TRUE((there.velocities() == starts.velocities()).all());
    EXPECT_TRUE((there.root_poses() == starts.root_poses()).all());
    EXPECT_TRUE((there.root_velocities() == starts.root_velocities()).all());
    EXPECT_TRUE((there.position_targets() == starts.position_targets()).all());
    EXPECT_TRUE((there.velocity_targets() == starts.velocity_targets()).all());
    EXPECT_TRUE((there.efforts() == starts.efforts()).all());
  }
  EXPECT_EQ(import_mjcf(text, "", {.body = "one"}).model.poses.at(1).positions.count("y"), 0u);
}

TEST(MjcfOptions, read_one_body_where_the_file_draws_it) {
  const string text =
      world("<body name='base' pos='0 0 1'><joint name='j' ref='90'/>" + ball +
            "<body name='arm' pos='0.5 0 0'><joint name='k' axis='0 1 0'/>" + ball + "</body></body>" + floating);
  const Model model = import_mjcf(text, "", {.body = "arm"}).model;
  ASSERT_EQ(model.joints.size(), 1u);
  EXPECT_EQ(model.joints[0].parent, "world");
  EXPECT_LT((model.joints[0].origin.translation() - Eigen::Vector3d(0.5, 0, 1)).norm(), 1e-15);
  const Model car = import_mjcf(text, "", {.body = "car"}).model;
  EXPECT_EQ(car.links.size(), 1u);
  EXPECT_TRUE(car.roots.at(0).floating);
}

TEST(MjcfOptions, are_those_of_urdf_where_they_apply) {
  const string text = world(body("<joint name='x' range='-9 90' frictionloss='-1'/>", "a"));
  EXPECT_THROW(import_mjcf(text), ModelError);
  const string light = world("<body name='a'><joint/><geom size='0.001'/></body>");
  EXPECT_EQ(import_mjcf(light, "", {.least_mass = 2.0}).model.links[1].inertia.mass, 2.0);
  const Model changed = import_mjcf(world(pair), "", {.change = [](Model& model) { model.name = "other"; }}).model;
  EXPECT_EQ(changed.name, "other");
}

}  // namespace
}  // namespace lockstep
