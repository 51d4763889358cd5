// What MJCF says of a Model, and what its report says. SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "export/export_helpers.h"
#include "lockstep/batch.h"
#include "lockstep/plan.h"
#include "unit/import_helpers.h"

namespace lockstep {
namespace {

using std::string;

TEST(MjcfExport, says_what_it_cannot_say) {
  Model model = fingers();
  Joint& lead = model.joints[0];
  lead.velocity_limit = 2.0;
  lead.restitution = 0.5;
  lead.lower = -1.0, lead.upper = 1.0;
  model.joints[1].limit_softness = Spring{10.0, 1.0};
  model.joints[1].upper = 1.0;
  model.joints[1].drive.kinematic = true;
  model.couplings[0].force_limit = 3.0;
  model.couplings[0].softness = Hard{0.1};
  model.colliders = {{.name = "floor", .shape = Shape::half_space(), .restitution = 0.3},
                     {.name = "ball", .link = "l1", .shape = Shape::sphere(0.1), .softness = Frequency{30.0, 1.0}},
                     {.name = "idle", .link = "l1", .shape = Shape::sphere(0.1)}};
  model.contacts = {{"floor", "ball"}};
  const Export made = export_mjcf(model);
  for (const char* line :
       {"velocity limits, left out (1): j0", "restitution of position limits, left out (1): j0",
        "softness of position limits, left out: they are MuJoCo's (1): j1", "kinematic drives, left out (1): j1",
        "force limits of couplings, left out (1): j1", "restitution of contacts, left out (1): floor-ball",
        "softness of contacts, left out: it is MuJoCo's (1): floor-ball"})
    EXPECT_TRUE(warns(made, line)) << line << "\n" << report_of(made);
  for (const char* line :
       {"shares of an error that a step corrects (erp), left out (1): j1",
        "ranges with an open end, written as 1e+10 (1): j1", "bolted roots, written as bodies of the world (1): base",
        "colliders that touch nothing, written as geoms that touch nothing (1): idle"})
    EXPECT_TRUE(reports(made, line)) << line << "\n" << report_of(made);
  EXPECT_EQ(made.warnings.size(), 7u) << report_of(made);
}

// Over sites of the model's own and new ones, with a pulley before each branch.
TEST(MjcfExport, of_spatial_tendons_is_read_again) {
  Model model = wrist();
  model.add_site("tip", "hand").pose.translation() = Eigen::Vector3d(0.1, 0.0, 0.02);
  Joint tendon;
  tendon.name = "cable", tendon.kind = JointKind::tendon;
  tendon.path = {{"", "hand", Eigen::Vector3d(0.2, 0.1, 1.0), Eigen::Vector3d(0.1, 0.0, 0.02)},
                 {"hand", model.links.front().name, Eigen::Vector3d(0.1, 0.0, 0.02), Eigen::Vector3d(0.0, 0.3, 0.0)},
                 {"", "hand", Eigen::Vector3d(0.2, -0.1, 1.0), Eigen::Vector3d(0.0, 0.0, 0.1), 0.5}};
  tendon.stiffness = 30.0, tendon.rest = 0.7, tendon.damping = 0.4, tendon.friction = 0.1, tendon.upper = 2.5;
  tendon.drive = {.kp = 10.0, .kd = 1.0, .position_target = 0.9}, tendon.effort_limit = 20.0;
  model.joints.push_back(tendon);
  const Export made = export_mjcf(model);
  EXPECT_TRUE(made.warnings.empty()) << report_of(made);
  EXPECT_NE(made.text.find("<site site=\"tip\"/>"), std::string::npos);
  const Model again = read(made);
  const Joint& theirs = again.joints[static_cast<std::size_t>(again.joint_index("cable"))];
  ASSERT_EQ(theirs.path.size(), tendon.path.size());
  for (std::size_t s = 0; s < tendon.path.size(); ++s) EXPECT_NEAR(theirs.path[s].share, tendon.path[s].share, 1e-15);
  for (double Joint::*number :
       {&Joint::stiffness, &Joint::rest, &Joint::damping, &Joint::friction, &Joint::upper, &Joint::effort_limit})
    EXPECT_NEAR(theirs.*number, tendon.*number, 1e-12);
  Batch<double> ours(compile(model), 1), read_again(compile(again), 1);
  const auto length = [](const Batch<double>& batch) { return batch.positions()(batch.plan().dof("cable"), 0); };
  EXPECT_NEAR(length(ours), length(read_again), 1e-12);
  EXPECT_NE(length(ours), 0.0);
}

// A ball is one joint of the file, with its quaternion in the keyframe, and its actuators act along its axes.
TEST(MjcfExport, of_balls_is_read_again) {
  Model model = wrist();
  const int first = model.add_ball("grip", "hand", "tool", Pose(Eigen::Translation3d(0.1, 0.0, 0.05)));
  model.links.push_back({"tool", Inertia::box(0.3, {0.05, 0.1, 0.2}, {0.0, 0.02, 0.1})});
  const double position[] = {0.4, -0.9, 1.1};
  for (int k = 0; k < 3; ++k) {
    Joint& part = model.joints[static_cast<std::size_t>(first + k)];
    part.position = position[k], part.velocity = 0.3 * k;
    part.damping = 0.1, part.armature = 0.02, part.stiffness = 0.5, part.friction = 0.03;
  }
  Joint& along_y = model.joints[static_cast<std::size_t>(first + 1)];
  along_y.drive = {.kp = 2.0, .kd = 0.1, .position_target = -0.5}, along_y.effort_limit = 1.5;
  model.joints[static_cast<std::size_t>(first)].upper = 2.0;
  const Export made = export_mjcf(model);
  EXPECT_TRUE(made.warnings.empty()) << report_of(made);
  const Model again = read(made);
  ASSERT_EQ(again.joints.size(), model.joints.size() - 1);  // the fixed one has no name in MJCF
  for (int k = 0; k < 3; ++k) {
    const Joint& own = model.joints[static_cast<std::size_t>(first + k)];
    const Joint& theirs = again.joints[static_cast<std::size_t>(again.joint_index(own.name))];
    SCOPED_TRACE(own.name);
    EXPECT_EQ(theirs.kind, JointKind::ball);
    for (double Joint::*number : {&Joint::position, &Joint::velocity, &Joint::damping, &Joint::armature,
                                  &Joint::stiffness, &Joint::friction, &Joint::effort_limit, &Joint::upper})
      EXPECT_TRUE(own.*number == theirs.*number || std::abs(own.*number - theirs.*number) < 1e-9);
    EXPECT_NEAR(own.drive.kp, theirs.drive.kp, 1e-12);
    EXPECT_NEAR(own.drive.position_target, theirs.drive.position_target, 1e-12);
  }
  expect_same(mechanism_of(again), mechanism_of(model));
  EXPECT_THROW(export_urdf(model), ModelError);
}

TEST(MjcfExport, says_which_effort_and_velocity_limits_mean_more_in_mujoco) {
  Model model = fingers();
  for (const int j : {0, 2}) model.joints[static_cast<std::size_t>(j)].effort_limit = 2.0;
  const Model alone = model;
  Joint belt;
  belt.name = "belt", belt.kind = JointKind::tendon;
  model.joints.push_back(belt);
  model.couplings.push_back({"belt", {{"j0", -1.0}, {"j2", -1.0}}, 0.0, Hard{}});
  const char* const line = "effort limits of joints that a driven tendon moves, which bound its force too in MuJoCo";
  EXPECT_TRUE(warns(export_mjcf(model), string(line) + " (2): j0, j2"));
  model = alone;
  Joint cable = belt;
  cable.effort = 1.0, cable.path = {{"", "l0", Eigen::Vector3d(0.2, 0.1, 1.0), Eigen::Vector3d(0.1, 0.0, 0.02)}};
  model.joints.push_back(cable);
  EXPECT_TRUE(warns(export_mjcf(model), string(line) + " (1): j0"));
  model.joints.back().effort = 0.0;
  EXPECT_TRUE(export_mjcf(model).warnings.empty()) << "it is not driven";

  model = wrist();
  const auto first = static_cast<std::size_t>(model.add_ball("grip", "hand", "tool"));
  model.links.push_back({"tool", Inertia::box(0.3, {0.05, 0.1, 0.2}, {0.0, 0.02, 0.1})});
  model.joints[first + 1].velocity_limit = 0.5;
  model.joints[first + 2].drive = {.kp = 2.0, .kd = 0.1};
  model.joints[first + 2].effort_limit = 1.5;
  EXPECT_TRUE(warns(export_mjcf(model), "velocity limits, left out (1): grip.y"));
  EXPECT_EQ(export_mjcf(model).warnings.size(), 1u);
  model.joints[first + 2].effort = 0.1;
  EXPECT_TRUE(warns(export_mjcf(model),
                    "effort limits of parts of balls, which each of several actuators has to itself (1): grip.z"));
}

TEST(MjcfExport, keeps_what_delays_efforts) {
  Model model = fingers();
  model.joints[0].drive.delay = 5;
  model.joints[2].drive.lag = 0.05;
  const Export made = export_mjcf(model);
  EXPECT_TRUE(made.warnings.empty()) << report_of(made);
  const Model again = read(made);
  const auto drive = [&](const char* joint) {
    return again.joints[static_cast<std::size_t>(again.joint_index(joint))].drive;
  };
  EXPECT_EQ(drive("j0").delay, 5);
  EXPECT_EQ(drive("j2").lag, 0.05);
}

TEST(MjcfExport, warns_of_nothing_that_it_says) {
  Model model = fingers();
  model.joints[0].drive = {.kp = 3.0, .kd = 0.2, .position_target = 0.1, .velocity_target = 0.5};
  model.joints[0].effort = 0.7, model.joints[0].effort_limit = 0.0;
  model.joints[1].lower = model.joints[1].upper = 0.25;
  model.joints[2].lower = model.joints[2].upper = 0.0;
  const Export made = export_mjcf(model);
  EXPECT_TRUE(made.warnings.empty()) << report_of(made);
  expect_same(mechanism_of(read(made)), mechanism_of(model));
  EXPECT_EQ(made.text.find("e-324"), string::npos);  // MuJoCo refuses denormal numbers
}

TEST(MjcfExport, folds_links_without_mass_into_the_next_body) {
  const Model model = wrist();
  const Export made = export_mjcf(model);
  EXPECT_TRUE(reports(made, "links without mass, left out: the next body has their joints (2): roll, frame"))
      << report_of(made);
  const Model again = read(made);
  EXPECT_EQ(again.links.size(), 4u);  // the world, the arm, one between the joints, the hand
  expect_same(mechanism_of(again), mechanism_of(model));
}

TEST(MjcfExport, gives_mass_to_links_that_cannot_be_folded) {
  Model model = wrist();
  model.add_site("eye", "frame");
  const Export made = export_mjcf(model);
  EXPECT_TRUE(warns(made, "moving bodies that MuJoCo finds too light")) << report_of(made);
  Mechanism own = mechanism_of(read(made));
  EXPECT_EQ(own.erase("body on joint roll") + own.erase("weight on joint roll"), 2u);
  expect_same(own, mechanism_of(model));
}

// MuJoCo judges each body alone, and without any tolerance.
TEST(MjcfExport, has_inertias_that_mujoco_takes) {
  Model model = fingers();
  const auto tensor = [&](const char* name) -> Eigen::Matrix3d& {
    return model.links[static_cast<std::size_t>(model.link_index(name))].inertia.about_center;
  };
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  tensor("l0") = turn * Eigen::Vector3d(0.01, 0.02, 0.03).asDiagonal() * turn.transpose();           // a plate
  tensor("l1") = turn * Eigen::Vector3d(0.01, 0.02, 0.03 * 1.0003).asDiagonal() * turn.transpose();  // of four digits
  const Export made = export_mjcf(model);
  EXPECT_TRUE(warns(made, "inertias that MuJoCo refuses, changed to the nearest that it takes (1): l1"))
      << report_of(made);
  for (const Eigen::Vector3d& m : triples_of(made.text, "diaginertia"))
    EXPECT_TRUE(m[0] + m[1] >= m[2] && m[1] + m[2] >= m[0] && m[2] + m[0] >= m[1]) << m.transpose();
  const Model again = read(made);
  EXPECT_NEAR((link(again, "l0").inertia.about_center - tensor("l0")).norm(), 0.0, 1e-15);
  EXPECT_NEAR((link(again, "l1").inertia.about_center - tensor("l1")).norm(), 0.0, 1e-5);
}

TEST(MjcfExport, moves_inertias_of_fixed_links_that_are_impossible_alone) {
  Model model = fingers();
  Joint weld;
  weld.name = weld.child = "sensor", weld.parent = "l1";
  weld.origin.translation() = Eigen::Vector3d(0.1, 0.0, 0.0);
  model.joints.push_back(weld);
  model.links.push_back({"sensor", {0.01, Eigen::Vector3d::Zero(), Eigen::Vector3d(1e-6, 1e-6, 5e-6).asDiagonal()}});
  const Export made = export_mjcf(model);
  EXPECT_TRUE(made.warnings.empty()) << report_of(made);
  EXPECT_TRUE(reports(made, "inertias of fixed links, added to the link that carries them (1): sensor"));
  expect_same(mechanism_of(read(made)), mechanism_of(model));
}

TEST(MjcfExport, writes_shares_of_gravity) {
  Model model = fingers();
  model.links[1].gravity = 0.0, model.links[3].gravity = 2.0;
  const Export made = export_mjcf(model);
  EXPECT_TRUE(made.warnings.empty()) << report_of(made);
  expect_same(mechanism_of(read(made)), mechanism_of(model));

  model.links[1].gravity = 1.0;
  const Export heavy = export_mjcf(model);
  EXPECT_TRUE(warns(heavy, "shares of gravity above 1, which MuJoCo takes only beside one below 1 (1): l2"));
  EXPECT_EQ(link(read(heavy), "l2").gravity, 1.0);

  Joint weld;
  weld.name = weld.child = "sensor", weld.parent = "l1";
  model.joints.push_back(weld);
  model.links.push_back(
      {"sensor", {0.05, Eigen::Vector3d::Zero(), Eigen::Vector3d(1e-6, 1e-6, 5e-6).asDiagonal()}, 0.5});
  const Export mixed = export_mjcf(model);  // MuJoCo takes the sensor only as a part of the link, which has 0.2 kg
  EXPECT_TRUE(warns(mixed, "shares of gravity of links that become one body, which gets their mean (1): l1"))
      << report_of(mixed);
  EXPECT_DOUBLE_EQ(link(read(mixed), "l1").gravity, 0.9);
}

// Softness that depends on the step or on the inertia becomes the spring that moves the same way in a step.
class SoftCouplings : public testing::TestWithParam<Softness> {};

TEST_P(SoftCouplings, move_as_in_the_file) {
  Model model = fingers();
  model.couplings[0].softness = GetParam();
  model.couplings.push_back({"j2", {{"j0", 0.5}, {"j1", -0.7}}, 0.02, GetParam()});
  model.joints[0].position = 0.3;
  const double step = 1.0 / 512;
  const Export made = export_mjcf(model, {.timestep = step});
  EXPECT_TRUE(warns(made, "(2): j1, j2")) << report_of(made);
  const Model again = read(made);
  const auto moved = [&](const Model& from) {
    Model alone = from;  // each by itself: the inertia that they move together is another one
    std::vector<double> found;
    for (std::size_t c = 0; c < 2; ++c) {
      alone.couplings = {from.couplings[c]};
      const Plan plan = compile(alone, {.dt = step, .method = Method::direct, .integrator = Integrator::euler});
      Batch<double> batch(plan, 1);
      batch.step();
      for (const char* name : {"j0", "j1", "j2"}) found.push_back(batch.velocities()(plan.dof(name), 0));
    }
    return found;
  };
  const std::vector<double> own = moved(again), wanted = moved(model);
  for (std::size_t i = 0; i < own.size(); ++i) EXPECT_NEAR(own[i], wanted[i], 1e-9 * (1.0 + std::abs(wanted[i]))) << i;
}
INSTANTIATE_TEST_SUITE_P(kinds, SoftCouplings,
                         testing::Values(Softness(Frequency{40.0, 0.3}), Softness(ErpCfm{0.1, 0.02})),
                         [](const auto& info) { return info.index == 0 ? "frequency" : "erp_cfm"; });

TEST(MjcfExport, keeps_a_spring_whose_length_would_mean_another) {
  Model model = fingers();
  model.couplings[0].softness = Spring{3.0, 0.1};
  model.couplings[0].offset = 1.0;  // a springlength of -1 means that of the joints
  expect_same(mechanism_of(read(export_mjcf(model))), mechanism_of(model));
}

TEST(MjcfExport, keeps_names_and_the_bits_of_numbers) {
  Model model = fingers();
  model.name = "a <b> & \"c\"";
  model.joints[0].damping = 0.1 + 0.2;
  const Export made = export_mjcf(model);
  EXPECT_NE(made.text.find("damping=\"0.30000000000000004\""), string::npos);
  EXPECT_NE(made.text.find("model=\"a &lt;b&gt; &amp; &quot;c&quot;\""), string::npos) << made.text;
  EXPECT_EQ(read(made).name, model.name);
}

TEST(MjcfExport, warns_where_bodies_nest_deeper_than_xml_is_read) {
  const auto chain = [](int length) {
    Model model;
    model.links.push_back({"world", {}});
    for (int i = 0; i < length; ++i) {
      Joint joint;
      joint.name = joint.child = "l" + std::to_string(i);
      joint.kind = JointKind::revolute, joint.parent = model.links.back().name;
      model.links.push_back({joint.child, Inertia::box(1.0, {0.1, 0.1, 0.1}, Eigen::Vector3d::Zero())});
      model.joints.push_back(joint);
    }
    return export_mjcf(model);
  };
  int longest = 50;
  while (!warns(chain(longest), "readers by tinyxml2 do not follow")) ++longest;
  EXPECT_THROW(read(chain(longest)), ImportError);
  EXPECT_NO_THROW(read(chain(longest - 1)));
}

TEST(MjcfExport, refuses_steps_and_models_that_cannot_be) {
  for (const double step : {0.0, -1.0, infinity, std::nan("")})
    EXPECT_THROW(export_mjcf(fingers(), {.timestep = step}), SettingsError);
  Model model = fingers();
  model.links[1].inertia.mass = -1.0;
  EXPECT_THROW(export_mjcf(model), ModelError);
  EXPECT_THROW(export_urdf(model), ModelError);
}

TEST(ExportFile, chooses_the_format_by_the_extension) {
  const string folder = testing::TempDir();
  EXPECT_EQ(export_file(fingers(), folder + "fingers.urdf").text, export_urdf(fingers()).text);
  EXPECT_EQ(export_file(fingers(), folder + "fingers.xml").text, export_mjcf(fingers()).text);
  expect_same(mechanism_of(import_file(folder + "fingers.xml").model), mechanism_of(fingers()));
  EXPECT_THROW(export_file(fingers(), folder + "fingers.sdf"), UsageError);
  try {
    export_file(fingers(), "/no/such/folder/fingers.urdf");
    FAIL() << "written";
  } catch (const UsageError& error) {
    EXPECT_NE(string(error.what()).find("/no/such/folder/fingers.urdf"), string::npos) << error.what();
  }
}

TEST(MjcfExport, writes_functions_up_to_the_fourth_power) {
  Model model = fingers();
  model.couplings = {Coupling::cam("j1", "j0", Polynomial{{0.1, 2.0, 0.0, -0.5, 0.3}}),
                     Coupling::cam("j2", "j0", Polynomial{{0.0, 0.02, 0.1}})};
  const Export made = export_mjcf(model);
  EXPECT_TRUE(made.warnings.empty()) << report_of(made);
  expect_same(mechanism_of(read(made)), mechanism_of(model));
  for (const Function& function :
       {Function(Polynomial{{0.1, 2.0, 0.0, 0.0, 0.0, 1.0}}), Function(Harmonic{0.0, 0.1, 0.1, 1.0}),
        Function(CamTable{{0.0, 0.5, 1.0}, {0.1, 0.3, 0.2}})}) {
    model.couplings[0].function = function;
    const Export other = export_mjcf(model);
    EXPECT_TRUE(warns(other, "followers by a function that is no polynomial of at most degree 4, left out (1): j1"))
        << report_of(other);
    EXPECT_EQ(read(other).couplings.size(), 1u);
  }
}

TEST(MjcfExport, keeps_poses_and_the_time_step) {
  const Model model =
      import_mjcf(
          "<mujoco><option timestep='0.004'/><worldbody><body name='trunk'><freejoint/><geom size='0.1'/>"
          "<body name='leg'><joint name='hip'/><geom size='0.1'/></body></body></worldbody><actuator>"
          "<position joint='hip' kp='7'/></actuator><keyframe><key name='start' qpos='0 0 1 1 0 0 0 0.5'/>"
          "<key name='low' qpos='1 2 3 0 0 1 0 -0.25' qvel='1 2 3 4 5 6 7' ctrl='0.125'/></keyframe></mujoco>")
          .model;
  const Export made = export_mjcf(model);
  EXPECT_TRUE(made.warnings.empty()) << report_of(made);
  const Model again = read(made);
  EXPECT_EQ(again.time_step, 0.004);
  ASSERT_EQ(again.poses.size(), 3u);
  EXPECT_EQ(again.poses[0].name, "start") << "as drawn";
  EXPECT_EQ(again.poses[1].name, "start#2") << "the file's own key of that name";
  for (const std::size_t k : {0u, 1u}) {
    const NamedPose &own = model.poses[k], &other = again.poses[k + 1];
    EXPECT_EQ(other.positions, own.positions);
    EXPECT_EQ(other.velocities, own.velocities);
    EXPECT_EQ(other.position_targets, own.position_targets);
    EXPECT_TRUE(other.root_poses.at("trunk").isApprox(own.root_poses.at("trunk"), 1e-15));
    EXPECT_TRUE(other.root_velocities.at("trunk").isApprox(own.root_velocities.at("trunk"), 1e-14));
  }
  EXPECT_EQ(read(export_mjcf(again)).poses.size(), 3u) << "the start is written once";
  EXPECT_TRUE(warns(export_urdf(model), "poses to start in, left out (2): start, low"));
  EXPECT_EQ(read(export_mjcf(model, {.timestep = 0.001})).time_step, 0.001);
}

}  // namespace
}  // namespace lockstep
