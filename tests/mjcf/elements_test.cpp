// What trees, joints, couplings, loops and mocap bodies of a file become. SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "lockstep/batch.h"
#include "lockstep/export_model.h"
#include "lockstep/plan.h"
#include "mjcf/worlds.h"
#include "unit/import_helpers.h"

namespace lockstep {
namespace {

// Trees that float and trees that stand, in the file's order.
TEST(MjcfTrees, may_be_several) {
  const Model model = import_mjcf(world(floating + pair + body("<freejoint/>", "ball"))).model;
  ASSERT_EQ(model.roots.size(), 3u);
  EXPECT_EQ(model.links[0].name, "world");
  EXPECT_EQ(model.roots[0].link, "world");
  EXPECT_EQ(model.roots[1].link, "car");
  EXPECT_EQ(model.roots[2].link, "ball");
  EXPECT_EQ(import_mjcf(world(floating)).model.links[0].name, "car");
  EXPECT_NO_THROW(compile(model, {}));
}

// Sections hold wherever they stand; angles are degrees unless the file says otherwise.
TEST(MjcfSections, may_stand_anywhere) {
  const string bodies = "<worldbody>" + body("<joint name='x' range='-1 90'/>", "a") + "</worldbody>";
  const auto upper = [&](const string& behind) {
    return joint(import_mjcf("<mujoco>" + bodies + behind + "</mujoco>").model, "x").upper;
  };
  EXPECT_DOUBLE_EQ(upper(""), 3.14159265358979323846 / 2.0);
  EXPECT_EQ(upper("<compiler angle='radian'/>"), 90.0);
  EXPECT_EQ(upper("<compiler angle='radian'/><compiler autolimits='true'/>"), 90.0);
  EXPECT_DOUBLE_EQ(upper("<compiler angle='radian'/><compiler angle='degree'/>"), 3.14159265358979323846 / 2.0);
  const Model model = import_mjcf("<mujoco>" + bodies + "<default><joint damping='2'/></default></mujoco>").model;
  EXPECT_EQ(joint(model, "x").damping, 2.0);
}

// The drawn pose is q = ref; ranges and springs are in the joint's own coordinate.
TEST(MjcfJoints, keep_their_coordinate_with_a_ref) {
  const Model model = import_mjcf(world(body("<joint name='x' type='slide' axis='0 0 2' ref='0.3' range='0.1 0.4' "
                                             "stiffness='5' springref='0.2' pos='7 7 7'/>",
                                             "a")))
                          .model;
  const Joint& own = joint(model, "x");
  EXPECT_EQ(own.position, 0.3);
  EXPECT_EQ(own.lower, 0.1);
  EXPECT_EQ(own.upper, 0.4);
  EXPECT_EQ(own.rest, 0.2);
  EXPECT_LT((own.origin.translation() - Eigen::Vector3d(0, 0, -0.3)).norm(), 1e-15);
}

// Joints come by body, even those that stand behind child bodies.
TEST(MjcfJoints, come_in_the_order_of_mujoco) {
  const Model model = import_mjcf(world("<body name='a'>" + ball + body("<joint name='last'/>", "b") +
                                        "<joint name='first'/><joint name='second' axis='1 0 0'/></body>"))
                          .model;
  std::vector<string> names;
  for (const Joint& own : model.joints) names.push_back(own.name);
  EXPECT_EQ(names, (std::vector<string>{"first", "second", "last"}));
}

// Equalities hold in any place of a chain, and with more than two joints.
TEST(MjcfCouplings, may_have_many_joints) {
  const Model model =
      import_mjcf(
          world(pair + body("<joint name='z'/>", "three"),
                "<tendon><fixed name='t'><joint joint='x' coef='2'/><joint joint='y' coef='4'/><joint joint='z' "
                "coef='-6'/><joint joint='y' coef='2'/></fixed></tendon><equality><tendon tendon1='t' "
                "polycoef='1'/></equality>"))
          .model;
  ASSERT_EQ(model.couplings.size(), 1u);
  const Coupling& coupling = model.couplings[0];
  EXPECT_EQ(coupling.joint, "x");
  ASSERT_EQ(coupling.terms.size(), 2u);
  EXPECT_EQ(coupling.terms[0].ratio, 3.0);
  EXPECT_EQ(coupling.terms[1].ratio, -3.0);
  EXPECT_EQ(coupling.offset, -0.5);
  EXPECT_EQ(joint(model, "x").position, 0.5);
}

// The first pose of a weld is that of the mocap body, whatever its relpose, and a keyframe moves it alone.
// What is fused with the world has no mass that settotalmass would scale: 2 kg in MuJoCo 3.3.8.
TEST(MjcfMasses, of_fused_bodies_are_not_scaled) {
  const auto mass = [](const std::string& fused, const std::string& still = "") {
    const Import import =
        import_mjcf("<mujoco><compiler settotalmass='2' fusestatic='" + fused + "'/><worldbody><body " + still +
                    "><geom size='0.3'/></body><body name='moves'><joint/>"
                    "<geom size='0.1'/></body></worldbody></mujoco>");
    return link(import.model, "moves").inertia.mass;
  };
  EXPECT_NEAR(mass("true"), 2.0, 1e-12);
  EXPECT_NEAR(mass("false"), 2.0 / 28.0, 1e-12);
  EXPECT_NEAR(mass("true", "mocap='true'"), 2.0 / 28.0, 1e-12);
}

// MuJoCo 3.3.8: the damper of a pair without springs, and the spring without dampers.
TEST(MjcfSprings, by_time_constants_obey_the_flags) {
  const auto hinge = [](const std::string& flag) {
    return joint(import_mjcf("<mujoco><option><flag " + flag +
                             "='disable'/></option><worldbody><body><joint name='j' springdamper='0.5 1'/>"
                             "<geom size='0.1' pos='1 0 0'/></body></worldbody></mujoco>")
                     .model,
                 "j");
  };
  EXPECT_EQ(hinge("spring").stiffness, 0.0);
  EXPECT_GT(hinge("spring").damping, 0.0);
  EXPECT_EQ(hinge("damper").damping, 0.0);
  EXPECT_GT(hinge("damper").stiffness, 0.0);
}

TEST(MjcfMocap, is_the_first_pose_of_its_loops) {
  const string text =
      world(body("<freejoint/>", "hand") + "<body name='m' mocap='true' pos='1 2 3' quat='0.6 0 0.8 0'/>",
            "<keyframe><key name='k' mpos='4 5 6' mquat='0 0 2 0'/></keyframe><equality>"
            "<weld body1='hand' body2='m' relpose='0.1 0.2 0.3 0.5 0.5 0.5 0.5' anchor='0.4 0 0.1'/></equality>");
  const Loop drawn = import_mjcf(text).model.loops.at(0);
  const Loop moved = import_mjcf(text, "file", {.keyframe = "k"}).model.loops.at(0);
  EXPECT_EQ(drawn.first, "");
  EXPECT_EQ(drawn.second, "hand");
  Pose mocap = Pose::Identity();
  mocap.translation() = Eigen::Vector3d(1.0, 2.0, 3.0);
  mocap.linear() = Eigen::Quaterniond(0.6, 0.0, 0.8, 0.0).toRotationMatrix();
  EXPECT_TRUE(drawn.first_pose.isApprox(mocap, 1e-15));
  mocap.translation() = Eigen::Vector3d(4.0, 5.0, 6.0);
  mocap.linear() = Eigen::Vector3d(-1.0, 1.0, -1.0).asDiagonal();  // half a turn about y
  EXPECT_TRUE(moved.first_pose.isApprox(mocap, 1e-15));
  EXPECT_TRUE(moved.second_pose.isApprox(drawn.second_pose, 0.0));
  // The hand is where the mocap body's axes are those of relpose in the hand, and the points meet.
  const Pose hand = drawn.first_pose * drawn.second_pose.inverse();
  const Eigen::Matrix3d turn = Eigen::Quaterniond(0.5, 0.5, 0.5, 0.5).toRotationMatrix();
  EXPECT_TRUE((hand.linear() * turn).isApprox(drawn.first_pose.linear(), 1e-14));
  EXPECT_TRUE(
      (hand * Eigen::Vector3d(0.1, 0.2, 0.3)).isApprox(drawn.first_pose * Eigen::Vector3d(0.4, 0.0, 0.1), 1e-14));
}

// A body that stands still beside a floating one is part of the world, so it comes first. The file's own names stay.
TEST(MjcfLoops, have_the_world_first_and_the_names_of_the_file) {
  const Model model =
      import_mjcf(world(body("<freejoint/>", "free") + "<body name='still' pos='1 2 3'><geom size='0.1'/></body>",
                        "<equality><connect body1='free' body2='still' anchor='0 0 0'/>"
                        "<connect name='connect' body1='free' body2='still' anchor='0.1 0 0'/></equality>"))
          .model;
  ASSERT_EQ(model.loops.size(), 2u);
  for (const Loop& loop : model.loops) {
    EXPECT_EQ(loop.first, "");
    EXPECT_EQ(loop.second, "free");
  }
  EXPECT_EQ(model.loops[0].name, "connect#2");
  EXPECT_EQ(model.loops[1].name, "connect");
  EXPECT_EQ(model.loops[1].second_pose.translation().x(), 0.1);
}

TEST(MjcfMocap, has_geoms_in_the_world) {
  const Model model = import_mjcf(world(body("<freejoint/>", "hand") + "<body name='m' mocap='true' pos='0 0 3'>" +
                                        "<geom name='g' size='0.1' pos='0 0 1'/></body>"),
                                  "file", {.colliders = true})
                          .model;
  ASSERT_EQ(model.colliders.size(), 2u);
  EXPECT_EQ(model.colliders[1].link, "");
  EXPECT_EQ(model.colliders[1].group, "");
  EXPECT_EQ(model.colliders[1].pose.translation().z(), 4.0);
  EXPECT_EQ(model.contacts.size(), 1u);
  EXPECT_EQ(model.links.size(), 1u);
}

// Positions every 0.1 s by MuJoCo 3.14, extrapolated from steps of 0.1 and 0.05 ms to steps of 0. The control is 1, and
// -0.5 from 0.3 s on.
TEST(MjcfActuators, lag_and_delay_as_in_mujoco_and_are_written_again) {
  constexpr double expected[] = {0.21160315, 0.91732712, 1.17911890, 0.82111773, -0.22673183, -0.78252378};
  const string file =
      "<mujoco><option timestep='0.0001' gravity='0 0 0'/><worldbody><body name='b'>"
      "<joint name='j' axis='0 0 1' damping='0.1' armature='0.01'/>"
      "<inertial pos='0 0 0' mass='1' diaginertia='0.02 0.02 0.03'/></body></worldbody><actuator>"
      "<position joint='j' kp='10' kv='0.4' timeconst='0.05' delay='0.02' nsample='200' forcerange='-4 4'/>"
      "</actuator></mujoco>";
  const Model read = import_mjcf(file).model;
  EXPECT_EQ(joint(read, "j").drive.lag, 0.05);
  EXPECT_EQ(joint(read, "j").drive.delay, 200);
  const Export written = export_mjcf(read);
  const Model again = import_mjcf(written.text, "text", {.keyframe = "start"}).model;
  EXPECT_EQ(joint(again, "j").drive.lag, 0.05);
  EXPECT_EQ(joint(again, "j").drive.delay, 200);
  for (const Model& model : {read, again}) {
    Batch<double> batch(compile(model, {.dt = 1e-4}), 1, {.threads = 1});
    for (int tenth = 0; tenth < 6; ++tenth) {
      batch.position_targets().setConstant(tenth < 3 ? 1.0 : -0.5);
      batch.step(1000);
      EXPECT_NEAR(batch.positions()(0, 0), expected[tenth], 2e-4) << tenth;
    }
  }
}

// MuJoCo clamps the sum of the forces of a tendon's actuators to its actuatorfrcrange.
TEST(MjcfTendons, limit_the_sum_of_their_actuators) {
  const auto read = [](const string& tendon, const string& actuators) {
    return import_mjcf(
        "<mujoco><worldbody><site name='w' pos='-1 0 0'/><body name='a'>"
        "<joint name='x' type='slide' axis='1 0 0'/><geom size='0.1'/><site name='s'/></body>"
        "<body name='b'><joint name='y' type='slide' axis='1 0 0'/><geom size='0.1'/></body></worldbody>"
        "<tendon>" +
        tendon + "</tendon><actuator>" + actuators + "</actuator></mujoco>");
  };
  const string range = " name='t' actuatorfrcrange='-2 2'>", motor = "<motor tendon='t'/>",
               weak = "<motor tendon='t' forcerange='-0.5 0.5'/>", geared = "<motor tendon='t' gear='3'/>";
  const string spatial = "<spatial" + range + "<site site='w'/><site site='s'/></spatial>",
               two = "<fixed" + range + "<joint joint='x' coef='1'/><joint joint='y' coef='1'/></fixed>",
               one = "<fixed" + range + "<joint joint='x' coef='2'/></fixed>";
  for (const string& tendon : {spatial, two})
    for (const auto& [actuators, limit] :
         {std::pair(motor, 2.0), std::pair(motor + motor, 2.0), std::pair(motor + motor + motor, 2.0),
          std::pair(weak + weak, 1.0), std::pair(geared + geared, 6.0)}) {
      const Import import = read(tendon, actuators);
      EXPECT_DOUBLE_EQ(joint(import.model, "t").effort_limit, limit) << tendon << actuators;
    }
  EXPECT_DOUBLE_EQ(joint(read(one, motor + motor).model, "x").effort_limit, 4.0);  // twice the tendon's force
  EXPECT_DOUBLE_EQ(joint(read(one, motor + "<motor joint='x' forcerange='-5 5'/>").model, "x").effort_limit, 9.0);
  const auto warns = [](const Import& import) {
    return std::count_if(import.warnings.begin(), import.warnings.end(),
                         [](const string& line) { return line.find("limits of") != string::npos; });
  };
  EXPECT_EQ(warns(read(spatial, motor + motor)), 0);
  EXPECT_EQ(warns(read(spatial, motor + geared)), 1);
  EXPECT_EQ(warns(read(spatial, weak + weak)), 1);
}

// A range and a spring with a range without force are bounds of two joints along one path.
TEST(MjcfTendons, may_have_a_range_and_a_spring_with_slack) {
  const Model model =
      import_mjcf(
          "<mujoco><option gravity='0 0 0'/><worldbody><site name='w' pos='-1 0 0'/><body name='a'>"
          "<joint name='x' type='slide' axis='1 0 0'/><inertial pos='0 0 0' mass='1' diaginertia='.1 .1 .1'/>"
          "<site name='s'/></body></worldbody><tendon><spatial name='t' range='0.5 1.5' stiffness='10' "
          "springlength='.7 .9'><site site='w'/><site site='s'/></spatial></tendon></mujoco>")
          .model;
  Batch<double> batch(compile(model, {.dt = 1e-4, .integrator = Integrator::euler}), 1, {.threads = 1});
  batch.step();
  const int x = batch.plan().dof("x");
  EXPECT_NEAR(batch.velocities()(x, 0), -1e-4 * 10.0 * (1.0 - 0.9), 1e-7);  // m / s
  batch.positions()(x, 0) = 0.49, batch.velocities()(x, 0) = 2.0;
  for (int i = 0; i < 2000; ++i) {
    batch.step();
    ASSERT_LE(batch.positions()(x, 0), 0.5 + 1e-9);  // the end of the range
  }
  EXPECT_LT(batch.velocities()(x, 0), 0.0);  // the spring pulls it back
}

}  // namespace
}  // namespace lockstep
