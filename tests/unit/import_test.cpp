// Models read from URDF against calculations by hand. SPDX-License-Identifier: Apache-2.0
//
// One file: element by element of the format, by the same short texts.
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <new>

#include "import_helpers.h"
#include "lockstep/error.h"
#include "lockstep/plan.h"

namespace lockstep {
namespace {

using std::string;

TEST(Import, reads_a_gripper_with_its_couplings) {
  const Import import = model_file("gripper");
  const Model& model = import.model;
  EXPECT_EQ(model.name, "gripper");
  EXPECT_EQ(model.links.size(), 11u);
  EXPECT_EQ(model.links[0].name, "base");
  ASSERT_EQ(model.couplings.size(), 5u);
  for (const Coupling& coupling : model.couplings) {
    const bool is_tip = coupling.joint.find("tip") != string::npos;
    ASSERT_EQ(coupling.terms.size(), 1u);
    EXPECT_EQ(coupling.terms[0].joint, "knuckle");
    EXPECT_EQ(coupling.terms[0].ratio, is_tip ? 1.0 : -1.0);  // the multiplier of tips is -1
    EXPECT_EQ(coupling.offset, 0.0);
    EXPECT_TRUE(std::holds_alternative<Hard>(coupling.softness));
  }
  const Joint& knuckle = joint(model, "knuckle");
  EXPECT_EQ(knuckle.kind, JointKind::revolute);
  EXPECT_EQ(knuckle.axis, Eigen::Vector3d::UnitX());
  EXPECT_EQ(knuckle.lower, 0.0);
  EXPECT_EQ(knuckle.upper, 0.73);
  EXPECT_EQ(knuckle.effort_limit, 8.0);
  EXPECT_EQ(knuckle.velocity_limit, 4.0);
  EXPECT_EQ(knuckle.damping, 0.05);
  EXPECT_EQ(knuckle.position, 0.0);
  expect_reports(import, "read 11 links, 9 moving joints, 5 couplings");
  expect_reports(import, "fixed joints, merged when compiling (1): wrist");
  expect_reports(import, "not used: 11 visual");
}

TEST(Import, gives_the_links_of_a_gripper_the_inertia_of_their_boxes) {
  const Model model = model_file("gripper").model;
  const Inertia knuckle = Inertia::box(0.06, {0.02, 0.014, 0.06}, {0, 0, 0.03});
  for (const char* name : {"left_knuckle", "right_knuckle"}) {
    const Inertia& inertia = link(model, name).inertia;
    EXPECT_EQ(inertia.mass, 0.06);
    EXPECT_EQ(inertia.center, knuckle.center);
    EXPECT_LT((inertia.about_center - knuckle.about_center).norm(), 1e-3 * knuckle.about_center.norm());
  }
}

// The parallelogram of each finger closes in any position: knuckle and tip lead to the end of the bar.
TEST(Import, keeps_the_direction_of_gripper_tips_until_they_meet) {
  const Model model = model_file("gripper").model;
  const auto pose = [&](const string& name, double q) -> Eigen::Isometry3d {
    const Joint& moved = joint(model, name);
    return moved.origin * Eigen::AngleAxisd(q, moved.axis);
  };
  for (const double q : {0.0, 0.4, 0.73})
    for (const string side : {"left", "right"}) {
      const Eigen::Isometry3d tip =
          pose(side == "left" ? "knuckle" : "right_knuckle_joint", q) * pose(side + "_tip_joint", -q);
      const Eigen::Vector3d bar_end = pose(side + "_bar_joint", q) * Eigen::Vector3d(0, 0, 0.06);
      EXPECT_LT((tip.linear() * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitZ()).norm(), 1e-12);
      EXPECT_LT((tip * Eigen::Vector3d(0, 0.016, 0) - bar_end).norm(), 1e-12);
      const double half_gap = (side == "left" ? 1.0 : -1.0) * tip.translation().y() - 0.006;
      if (q == 0.0) {
        EXPECT_NEAR(2.0 * half_gap, 0.0855, 1e-4);
      }
      if (q == 0.73) {
        EXPECT_NEAR(half_gap, 0.0, 5e-4);
      }
    }
}

// rpy turns about fixed axes, yaw last: R = Rz(yaw) Ry(pitch) Rx(roll). The matrix is written out by hand.
TEST(Import, turns_by_roll_pitch_yaw_about_fixed_axes) {
  const Model model = model_file("fixed_links").model;
  const double r = 0.3, p = -0.4, y = 1.1;
  const double sr = std::sin(r), cr = std::cos(r), sp = std::sin(p), cp = std::cos(p);
  const double sy = std::sin(y), cy = std::cos(y);
  Eigen::Matrix3d expected;
  expected << cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr,  //
      sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr,          //
      -sp, cp * sr, cp * cr;
  const Eigen::Isometry3d& origin = joint(model, "weld").origin;
  EXPECT_LT((origin.linear() - expected).norm(), 1e-15);
  EXPECT_EQ(origin.translation(), Eigen::Vector3d(0.1, 0, 0));

  // The image of one point: a roll of 90 degrees takes y to z, and yaw does not change z.
  const Import turned = import_urdf(R"(<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="fixed">
      <parent link="a"/><child link="b"/><origin rpy="1.5707963267948966 0 1.5707963267948966"/></joint></robot>)");
  EXPECT_LT((turned.model.joints[0].origin * Eigen::Vector3d::UnitY() - Eigen::Vector3d::UnitZ()).norm(), 1e-15);
}

TEST(Import, turns_inertia_into_the_axes_of_the_link) {
  const Model model = model_file("rotated_inertials").model;
  const auto expect = [&](const char* name, const Eigen::Matrix3d& tensor) {
    const Inertia& inertia = link(model, name).inertia;
    EXPECT_LT((inertia.about_center - tensor).norm(), 1e-17) << name << "\n" << inertia.about_center;
    EXPECT_EQ(inertia.center, Eigen::Vector3d(0.01, 0.02, 0.03));
    EXPECT_EQ(inertia.mass, 0.5);
  };
  // The principal moments along the turned axes are 1, 2 and 2.5 g m^2. Quarter turns swap them.
  expect("quarter_yaw", Eigen::Vector3d(0.002, 0.001, 0.0025).asDiagonal());
  expect("quarter_roll", Eigen::Vector3d(0.001, 0.0025, 0.002).asDiagonal());
  // An eighth of a turn gives the mean (a + b) / 2 on the diagonal and half the difference (a - b) / 2 beside it.
  Eigen::Matrix3d eighth;
  eighth << 0.0015, -0.0005, 0, -0.0005, 0.0015, 0, 0, 0, 0.0025;
  expect("eighth_yaw", eighth);

  // Any turn keeps the moment of inertia about a direction that is fixed in the body.
  Eigen::Matrix3d given;
  given << 0.001, 0.0001, -0.0002, 0.0001, 0.002, 0.0003, -0.0002, 0.0003, 0.0025;
  const Eigen::Matrix3d turn = joint(model_file("fixed_links").model, "weld").origin.linear();  // the same rpy
  const Eigen::Vector3d direction(0.2, -0.7, 0.5);
  EXPECT_NEAR((turn * direction).dot(link(model, "any").inertia.about_center * (turn * direction)),
              direction.dot(given * direction), 1e-17);
}

TEST(Import, reads_a_mimic_without_attributes_as_one_to_one) {
  const Model model = model_file("prismatic_pair").model;
  ASSERT_EQ(model.couplings.size(), 1u);
  EXPECT_EQ(model.couplings[0].joint, "right_slide");
  EXPECT_EQ(model.couplings[0].terms[0].joint, "left_slide");
  EXPECT_EQ(model.couplings[0].terms[0].ratio, -1.0);
  EXPECT_FALSE(std::signbit(model.couplings[0].offset));
  EXPECT_EQ(joint(model, "left_slide").kind, JointKind::prismatic);
}

TEST(Import, takes_a_leader_below_its_follower_and_later_in_the_file) {
  const Import import = model_file("leader_below");
  ASSERT_EQ(import.model.couplings.size(), 1u);
  const Coupling& coupling = import.model.couplings[0];
  EXPECT_EQ(coupling.joint, "inner_joint");
  EXPECT_EQ(coupling.terms[0].joint, "outer_joint");
  EXPECT_EQ(coupling.terms[0].ratio, 0.5);
  EXPECT_EQ(coupling.offset, -0.2);
  EXPECT_EQ(joint(import.model, "inner_joint").position, 0.2);
  expect_reports(import, "followers that start where their coupling puts them (1): inner_joint at 0.2");
}

// From distal = 0.5 middle - 0.3 and middle = 2 proximal + 0.1 follows distal = proximal - 0.25.
TEST(Import, makes_a_mimic_of_a_mimic_follow_the_last_leader) {
  const Import import = model_file("mimic_chain");
  ASSERT_EQ(import.model.couplings.size(), 2u);
  const Coupling& distal = import.model.couplings[0];
  EXPECT_EQ(distal.joint, "distal");
  EXPECT_EQ(distal.terms[0].joint, "proximal");
  EXPECT_DOUBLE_EQ(distal.terms[0].ratio, -1.0);
  EXPECT_DOUBLE_EQ(distal.offset, 0.25);
  EXPECT_EQ(import.model.couplings[1].joint, "middle");
  EXPECT_EQ(import.model.couplings[1].terms[0].ratio, -2.0);
  for (const Coupling& coupling : import.model.couplings) EXPECT_EQ(error_at_start(import.model, coupling), 0.0);
  expect_reports(import, "chains of mimics resolved (1): distal <- middle <- proximal is 1 proximal - 0.25");
  EXPECT_EQ(import.model.links[0].name, "palm");  // the root comes first; the other links keep their order
  EXPECT_EQ(import.model.links[1].name, "distal_link");
  EXPECT_EQ(import.model.links[3].name, "proximal_link");
}

TEST(Import, makes_a_slide_follow_a_crank_with_an_offset) {
  const Import import = model_file("slide_follows_turn");
  const Coupling& coupling = import.model.couplings.at(0);
  EXPECT_EQ(coupling.terms[0].ratio, 0.002);
  EXPECT_EQ(coupling.offset, -0.007);
  EXPECT_EQ(joint(import.model, "slide").position, 0.007);
  EXPECT_EQ(joint(import.model, "crank").position, 0.0);
  EXPECT_EQ(joint(import.model, "crank").friction, 0.1);
  EXPECT_EQ(joint(import.model, "crank").damping, 0.02);
  // At 1.5 rad the crank puts the slide at 4 mm, 1 mm below its lower limit.
  expect_reports(import, "followers that leave their limits while their leader keeps its own (1): slide by 0.001 m");
  expect_reports(import, "joints that start outside of their limits (1): crank at 0, not 0.1 to 1.5");
  expect_reports(import, "axes not of length 1, taken as directions (1): slide");
  expect_reports(import,
                 "kept and enforced by a step: dry friction of 1 joint, effort limits of 2 joints, "
                 "position limits of 2 joints, velocity limits of 2 joints");
}

// The follower turns against its leader. If both may only be between 0 and 1, both are locked at 0.
TEST(Import, reports_a_follower_that_locks_its_leader) {
  const auto imported = [](const string& range) {
    return import_urdf("<robot name='r'><link name='a'/><link name='b'>" + unit_body + "</link><link name='c'>" +
                       unit_body +
                       "</link><joint name='lead' type='revolute'><parent link='a'/><child link='b'/>"
                       "<limit lower='0' upper='1' effort='1' velocity='1'/></joint>"
                       "<joint name='back' type='revolute'><parent link='b'/><child link='c'/><limit " +
                       range + " effort='1' velocity='1'/><mimic joint='lead' multiplier='-1'/></joint></robot>");
  };
  const string line = "followers whose limits leave their leader no room to move (1): back";
  expect_reports(imported("lower='0' upper='1'"), line);
  for (const char* range : {"lower='-1' upper='0'", "lower='-0.1' upper='1'"})
    EXPECT_EQ(report_of(imported(range)).find("no room"), string::npos) << range;
}

TEST(Import, takes_a_follower_in_another_subtree_and_a_continuous_joint_without_range) {
  const Import import = model_file("other_subtree");
  EXPECT_EQ(import.model.couplings.at(0).joint, "lift");
  EXPECT_EQ(import.model.couplings.at(0).terms[0].joint, "wheel");
  EXPECT_EQ(joint(import.model, "wheel").kind, JointKind::continuous);
  EXPECT_EQ(joint(import.model, "wheel").lower, -infinity);
  EXPECT_EQ(joint(import.model, "wheel").upper, infinity);
  EXPECT_EQ(joint(import.model, "wheel").velocity_limit, 2.0);
  expect_reports(import, "no <limit>, taken as unlimited (1): right_turn");
  expect_reports(import, "limited followers of a leader without limits (1): lift");
  EXPECT_EQ(report_of(import).find("no room"), string::npos);
  expect_reports(import, "not used: 1 'lower' of limit of continuous joints, 1 'upper' of limit of continuous joints");
}

// Many files have placeholders of 0 for effort and velocity. They are not meant to lock the joint.
TEST(Import, reads_limits_of_zero_as_unlimited) {
  const Import import = model_file("placeholder_limits");
  const auto expect = [&](const char* name, double effort, double velocity) {
    EXPECT_EQ(joint(import.model, name).effort_limit, effort) << name;
    EXPECT_EQ(joint(import.model, name).velocity_limit, velocity) << name;
  };
  expect("pan", infinity, infinity);
  expect("tilt", 4.0, infinity);
  expect("lens", infinity, 0.5);
  expect("roll", 4.0, 2.0);
  expect_reports(import,
                 "<limit> with effort or velocity 0, taken as unlimited (4): pan (effort), pan (velocity), "
                 "tilt (velocity), lens (effort)");
  expect_reports(import, "joints that cannot move, lower = upper (1): roll");
  expect_reports(import,
                 "kept and enforced by a step: effort limits of 2 joints, position limits of 4 joints, "
                 "velocity limits of 2 joints");
  expect_reports(import, "not used: 1 safety_controller");
  EXPECT_EQ(joint(import.model, "pan").upper, 1.5);  // the limit of the joint, not of the safety controller
}

TEST(Import, counts_mass_behind_fixed_joints_and_ignores_their_axes_and_mimics) {
  const Import import = model_file("fixed_links");
  EXPECT_EQ(link(import.model, "arm").inertia.mass, 0.0);
  EXPECT_TRUE(import.model.couplings.empty());
  expect_reports(import, "fixed joints, merged when compiling (2): weld, bolt");
  expect_reports(import, "not used: 1 axis of fixed joints, 1 mimic of fixed joints");
}

// A bolted arm and two things that float beside it.
TEST(Import, makes_trees_of_links_that_float_below_the_root) {
  const auto link = [](const std::string& name) { return "<link name='" + name + "'>" + unit_body + "</link>"; };
  const auto joint = [](const std::string& name, const std::string& type, const std::string& child) {
    return "<joint name='" + name + "' type='" + type + "'><parent link='table'/><child link='" + child +
           "'/><origin xyz='0 0.2 1'/><axis xyz='0 0 1'/></joint>";
  };
  const Import import = import_urdf("<robot name='r'><link name='table'/>" + link("arm") + link("cup") + link("ball") +
                                    joint("shoulder", "continuous", "arm") + joint("free", "floating", "cup") +
                                    joint("free2", "floating", "ball") + "</robot>");
  ASSERT_EQ(import.model.roots.size(), 3u);
  EXPECT_EQ(import.model.roots[0].link, "table");
  EXPECT_FALSE(import.model.roots[0].floating);
  EXPECT_EQ(import.model.roots[1].link, "cup");
  EXPECT_EQ(import.model.roots[2].link, "ball");
  EXPECT_TRUE(import.model.roots[2].floating);
  EXPECT_EQ(import.model.roots[2].pose.translation(), Eigen::Vector3d(0, 0.2, 1));
  expect_reports(import, "floating roots instead of floating joints (2): free, free2");
  EXPECT_EQ(compile(import.model).root_names(), (std::vector<std::string>{"cup", "ball"}));
}

// What floats below a moving link stands where the joints put it at 0.
TEST(Import, makes_trees_of_links_that_float_below_others) {
  const auto link = [](const std::string& name) { return "<link name='" + name + "'>" + unit_body + "</link>"; };
  const auto joint = [](const std::string& type, const std::string& parent, const std::string& child) {
    return "<joint name='to " + child + "' type='" + type + "'><parent link='" + parent + "'/><child link='" + child +
           "'/><origin xyz='0 0.2 1' rpy='0 0 1.5707963267948966'/><axis xyz='0 0 1'/></joint>";
  };
  const Import import = import_urdf("<robot name='r'><link name='table'/>" + link("arm") + link("cup") + link("lid") +
                                    joint("continuous", "table", "arm") + joint("floating", "arm", "cup") +
                                    joint("floating", "cup", "lid") + "</robot>");
  ASSERT_EQ(import.model.roots.size(), 3u);
  EXPECT_LT((import.model.roots[1].pose.translation() - Eigen::Vector3d(-0.2, 0.2, 2.0)).norm(), 1e-12);
  EXPECT_LT((import.model.roots[2].pose.translation() - Eigen::Vector3d(-0.2, 0.0, 3.0)).norm(), 1e-12);
  EXPECT_TRUE(import.model.roots[1].floating && import.model.roots[2].floating);
  ASSERT_EQ(import.warnings.size(), 1u);
  EXPECT_NE(import.warnings[0].find("below links"), std::string::npos);
  EXPECT_THROW(import_urdf("<robot name='r'><link name='table'/>" + link("a") + link("b") + link("c") +
                           joint("continuous", "a", "b") + joint("continuous", "b", "a") + joint("floating", "a", "c") +
                           "</robot>"),
               Error);
}

TEST(Import, makes_balls_of_spherical_joints) {
  for (const std::string type : {"spherical", "ball"}) {
    const Model model = import_urdf("<robot name='r'><link name='base'/><link name='arm'>" + unit_body +
                                    "</link><joint name='shoulder' type='" + type +
                                    "'><parent link='base'/><child link='arm'/><origin xyz='0 0 1'/>"
                                    "<dynamics damping='0.3' friction='0.1'/></joint></robot>")
                            .model;
    ASSERT_EQ(model.joints.size(), 3u);
    for (const Joint& part : model.joints) {
      EXPECT_EQ(part.kind, JointKind::ball);
      EXPECT_EQ(part.damping, 0.3);
      EXPECT_EQ(part.friction, 0.1);
    }
    EXPECT_EQ(compile(model).dof_names(), (std::vector<std::string>{"shoulder.x", "shoulder.y", "shoulder.z"}));
  }
}

TEST(Import, makes_the_root_float_for_a_floating_joint_below_an_empty_root) {
  const Import import = model_file("floating_root");
  const Model& model = import.model;
  EXPECT_TRUE(model.roots[0].floating);
  ASSERT_EQ(model.links.size(), 2u);
  EXPECT_EQ(model.links[0].name, "body");
  EXPECT_EQ(model.joints.size(), 1u);
  EXPECT_EQ(model.roots[0].pose.translation(), Eigen::Vector3d(0, 0, 0.5));
  EXPECT_LT((model.roots[0].pose.linear() * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm(), 1e-15);
  expect_reports(import, "floating roots instead of floating joints (1): free, without its parent world");
}

TEST(Import, counts_unused_elements_and_reports_misspellings_separately) {
  const Import import = model_file("decorated");
  expect_reports(import,
                 "not used: 1 calibration, 1 collision, 1 gazebo, 1 material, 1 ros2_control, "
                 "1 safety_controller, 1 transmission, 2 visual");
  expect_reports(import,
                 "unknown, not used (check the spelling): 1 'speed' of joint, 1 inertal, "
                 "1 text 'stray words' in robot");
  EXPECT_EQ(joint(import.model, "turn").axis, Eigen::Vector3d::UnitX());  // URDF's default
  EXPECT_EQ(joint(import.model, "turn").upper, 0.0);                      // URDF's default
  EXPECT_EQ(joint(import.model, "turn").effort_limit, 1.0);
  EXPECT_EQ(joint(import.model, "turn").velocity_limit, infinity);
}

// A hand with several defects. The palm has an impossible tensor, the finger is too light, and base and tip have no
// mass. The thumb has none either, but the nail that is fixed to it has enough.
const string defective = R"(<robot name='defective'><link name='base'/>
  <link name='palm'><inertial><mass value='2'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='4'/></inertial></link>
  <link name='finger'><inertial><origin xyz='0.1 0 0'/><mass value='0.01'/>
    <inertia ixx='2e-6' ixy='0' ixz='0' iyy='3e-6' iyz='0' izz='4e-6'/></inertial></link>
  <link name='tip'/><link name='thumb'/>
  <link name='nail'><inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial></link>
  <joint name='j0' type='continuous'><parent link='base'/><child link='palm'/></joint>
  <joint name='j1' type='continuous'><parent link='palm'/><child link='finger'/></joint>
  <joint name='j2' type='continuous'><parent link='finger'/><child link='tip'/></joint>
  <joint name='j3' type='continuous'><parent link='palm'/><child link='thumb'/></joint>
  <joint name='j4' type='fixed'><parent link='thumb'/><child link='nail'/></joint></robot>)";

TEST(Import, fills_in_inertias_only_on_request_and_reports_where) {
  EXPECT_THROW(import_urdf(defective), ModelError);
  const Import import = import_urdf(defective, "defective", {.least_mass = 0.05, .least_inertia = 1e-5});
  expect_reports(import, "impossible inertias, changed to the nearest possible (1): palm");
  expect_reports(import, "masses raised to 0.05 kg (2): finger, tip");
  expect_reports(import, "masses raised to 0.05 kg, of a bolted root (1): base");
  expect_reports(import, "inertias raised to 1e-05 kg m^2 (2): finger, tip");
  EXPECT_TRUE(warns(import, "masses raised to 0.05 kg (2)"));
  EXPECT_FALSE(warns(import, "bolted root"));
  const Eigen::Matrix3d one = Eigen::Matrix3d::Identity();
  // Moments 1, 1, 4 exceed the rule by 2: a third of that goes to each.
  EXPECT_TRUE(link(import.model, "palm")
                  .inertia.about_center.isApprox(Eigen::Vector3d(5.0, 5.0, 10.0).asDiagonal().toDenseMatrix() / 3.0));
  EXPECT_EQ(link(import.model, "palm").inertia.mass, 2.0);
  EXPECT_EQ(link(import.model, "finger").inertia.mass, 0.05);
  EXPECT_EQ(link(import.model, "finger").inertia.center, Eigen::Vector3d(0.1, 0.0, 0.0));
  EXPECT_TRUE(link(import.model, "finger")
                  .inertia.about_center.isApprox(Eigen::Vector3d(1e-5, 1e-5, 1e-5).asDiagonal().toDenseMatrix()));
  EXPECT_EQ(link(import.model, "tip").inertia.mass, 0.05);
  EXPECT_TRUE(link(import.model, "tip").inertia.about_center.isApprox(1e-5 * one));
  EXPECT_EQ(link(import.model, "thumb").inertia.mass, 0.0) << "the nail has enough mass for both";
}

// Many files have frames without inertia that carry a fixed body.
TEST(Import, fills_in_inertia_at_the_link_that_has_the_mass) {
  const string frame = R"(<robot name='r'><link name='base'/><link name='frame'/><link name='body'><inertial>
    <mass value='1'/><inertia ixx='1e-9' ixy='0' ixz='0' iyy='1e-9' iyz='0' izz='1e-9'/></inertial></link>
    <joint name='j' type='continuous'><parent link='base'/><child link='frame'/></joint>
    <joint name='f' type='fixed'><parent link='frame'/><child link='body'/></joint></robot>)";
  const Import import = import_urdf(frame, "frame", {.least_inertia = 1e-5});
  expect_reports(import, "inertias raised to 1e-05 kg m^2 (1): body");
  EXPECT_EQ(link(import.model, "frame").inertia.mass, 0.0);
  EXPECT_NEAR(link(import.model, "body").inertia.about_center(0, 0), 1e-5, 1e-15);
}

TEST(Import, fills_in_nothing_in_complete_models) {
  for (const auto& entry : std::filesystem::directory_iterator(LOCKSTEP_MODELS)) {
    if (entry.path().extension() != ".urdf") continue;
    const Import original = import_urdf_file(entry.path());
    EXPECT_EQ(import_urdf_file(entry.path(), {.least_inertia = 1e-15}).report, original.report) << entry.path();
    const Model filled = import_urdf_file(entry.path(), {.least_mass = 1e-9}).model;  // only an empty root gets mass
    for (std::size_t i = 1; i < filled.links.size(); ++i) {
      EXPECT_EQ(filled.links[i].inertia.mass, original.model.links[i].inertia.mass) << entry.path();
      EXPECT_EQ(filled.links[i].inertia.about_center, original.model.links[i].inertia.about_center) << entry.path();
    }
  }
}

TEST(Import, refuses_invalid_least_masses_and_inertias) {
  EXPECT_THROW(import_urdf(defective, "defective", {.least_mass = -1.0}), SettingsError);
  EXPECT_THROW(import_urdf(defective, "defective", {.least_inertia = std::nan("")}), SettingsError);
  string negative = defective;
  negative.replace(negative.find("value='2'"), 9, "value='-2'");
  EXPECT_THROW(import_urdf(negative, "negative", {.least_mass = 0.05, .least_inertia = 1e-5}), ModelError);
}

TEST(Import, reads_every_model_of_the_tests) {
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(LOCKSTEP_MODELS)) {
    if (entry.path().extension() != ".urdf") continue;
    ++files;
    EXPECT_NO_THROW(import_urdf_file(entry.path()).model.validate()) << entry.path();
  }
  EXPECT_GE(files, 10);
}

// A chain of links, in which each joint mimics the next one: a deep tree and a long chain of mimics.
string chain_of_mimics(int links) {
  string text = "<robot name='r'><link name='l0'/>";
  for (int i = 1; i < links; ++i) {
    const string n = std::to_string(i);
    text += "<link name='l" + n + "'>" + unit_body + "</link><joint name='j" + n +
            "' type='continuous'><parent link='l" + std::to_string(i - 1) + "'/><child link='l" + n + "'/>" +
            (i + 1 < links ? "<mimic joint='j" + std::to_string(i + 1) + "'/>" : "") + "</joint>";
  }
  return text + "</robot>";
}

std::size_t allocated = 0;  // bytes, by operator new

// Buffers grow by doubling, so the sizes differ by a power of two.
TEST(Import, allocates_in_proportion_to_the_size_of_a_file) {
  const string small = chain_of_mimics(2500), large = chain_of_mimics(20000);
  const auto allocated_for = [](const string& text) {
    const std::size_t before = allocated;
    import_urdf(text);
    return allocated - before;
  };
  const std::size_t for_small = allocated_for(small);
  ASSERT_GT(for_small, small.size());
  EXPECT_LT(allocated_for(large), 10 * for_small);
}

TEST(Import, reads_chains_of_twenty_thousand_links_and_mimics) {
  const Import import = import_urdf(chain_of_mimics(20000));
  ASSERT_EQ(import.model.couplings.size(), 20000 - 2u);
  EXPECT_EQ(import.model.couplings[0].terms[0].joint, "j19999");
  for (const string& line : import.report) EXPECT_LT(line.size(), 2000u);
}

}  // namespace
}  // namespace lockstep

// Inlined, malloc() and free() would look like mismatched pairs to the compiler.
[[gnu::noinline]] void* operator new(std::size_t size) {
  lockstep::allocated += size;
  if (void* block = std::malloc(size > 0 ? size : 1)) return block;
  throw std::bad_alloc();
}
[[gnu::noinline]] void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  lockstep::allocated += size;
  return std::malloc(size > 0 ? size : 1);
}
[[gnu::noinline]] void operator delete(void* block) noexcept { std::free(block); }
[[gnu::noinline]] void operator delete(void* block, std::size_t) noexcept { std::free(block); }
