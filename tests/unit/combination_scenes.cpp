// One list of all features, and one of all scenes. SPDX-License-Identifier: Apache-2.0
#include "combination_scenes.h"

#include "contact_scenes.h"
#include "physics.h"

namespace lockstep::combinations {

Joint& joint_of(Model& model, const char* name) {
  return model.joints[static_cast<std::size_t>(model.joint_index(name))];
}

Model arm() {
  Model model = physics::sliders({1.0, 1.0, 1.0});
  for (std::size_t i = 0; i < model.joints.size(); ++i) model.joints[i].name = "q" + std::to_string(i);
  for (std::size_t i = 1; i < model.links.size(); ++i) {
    const std::string before = model.links[i].name, after = "l" + std::to_string(i - 1);
    for (Joint& joint : model.joints)
      if (joint.child == before) joint.child = after;
    model.links[i].name = after;
  }
  return model;
}

namespace {

void range(Joint& joint, Softness softness = Hard{}) {
  joint.lower = -1.0, joint.upper = 1.0, joint.limit_softness = softness;
}
void servo(Joint& joint) { joint.drive = {.kp = 20.0, .kd = 1.0}, joint.effort_limit = 3.0; }
Joint& add_tendon(Model& model) {
  Joint joint;
  joint.name = "tendon", joint.kind = JointKind::tendon;
  model.couplings.push_back({"tendon", {{"q0", -1.0}, {"q1", -0.5}}, 0.0, Hard{}});
  return model.joints.emplace_back(joint);
}
template <Parameter field>
void vary(Model&, StepSettings& settings) {
  settings.per_environment.insert(field);
}

const Feature hard{"hard coupling",
                   [](Model& m, StepSettings&) { m.couplings.push_back(Coupling::mimic("q2", "q0", -1.5)); }};
const Feature soft{"soft coupling", [](Model& m, StepSettings& s) {
                     hard.add(m, s);
                     m.couplings.back().softness = Spring{40.0, 0.5};
                   }};
const Feature stiff{"very stiff soft coupling", [](Model& m, StepSettings& s) {
                      hard.add(m, s);
                      m.couplings.back().softness = Spring{1e8, 1e3};
                    }};
const Feature limits{"position limits",
                     [](Model& m, StepSettings&) { range(joint_of(m, "q0")), range(joint_of(m, "q1")); }};
const Feature speed{"velocity limits", [](Model& m, StepSettings&) { joint_of(m, "q0").velocity_limit = 2.0; }};
const Feature friction{"dry friction", [](Model& m, StepSettings&) { joint_of(m, "q1").friction = 0.1; }};
const Feature servos{"limited servos",
                     [](Model& m, StepSettings&) { servo(joint_of(m, "q0")), servo(joint_of(m, "q1")); }};
void make_late(Drive& drive) { drive.delay = 4, drive.lag = 0.02; }
const Feature late{"late servos", [](Model& m, StepSettings& s) {
                     if (joint_of(m, "q0").drive.kp == 0.0) servos.add(m, s);
                     make_late(joint_of(m, "q0").drive), make_late(joint_of(m, "q1").drive);
                   }};
const Feature late_drive{"late kinematic drive", [](Model& m, StepSettings&) {
                           joint_of(m, "q1").drive.kinematic = true;
                           make_late(joint_of(m, "q1").drive);
                         }};
const Feature lags{"delays and lags per environment", [](Model&, StepSettings& s) {
                     for (const Parameter own : {Parameter::drive_delay, Parameter::drive_lag})
                       s.per_environment.insert(own);
                   }};
const Feature motors{"motors", [](Model& m, StepSettings& s) {
                       if (joint_of(m, "q0").drive.kp == 0.0) servos.add(m, s);
                       for (const char* name : {"q0", "q1"})
                         joint_of(m, name).drive.stall_effort = 4.0, joint_of(m, name).drive.no_load_speed = 6.0;
                     }};
const Feature curves{"motors' curves per environment", vary<Parameter::motor_curve>};
const Feature drive{"kinematic drive", [](Model& m, StepSettings&) { joint_of(m, "q1").drive.kinematic = true; }};
const Feature soft_limit{"soft limit", [](Model& m, StepSettings&) { range(joint_of(m, "q1"), Spring{30.0, 1.0}); }};
const Feature soft_drive{
    "soft kinematic drive", [](Model& m, StepSettings&) {
      joint_of(m, "q1").drive.kinematic = true, joint_of(m, "q1").drive.softness = Spring{30.0, 1.0};
    }};
const Feature force_limit{"coupling with a force limit", [](Model& m, StepSettings& s) {
                            hard.add(m, s);
                            m.couplings.back().force_limit = 1.0;
                          }};
const Feature sum{"follower of two", [](Model& m, StepSettings&) {
                    m.couplings.push_back({"q2", {{"q0", -1.0}, {"q1", -0.5}}, 0.0, Hard{}});
                  }};
const Feature sum_limits{"its limits", [](Model& m, StepSettings&) { range(joint_of(m, "q2")); }};
const Feature spring{"spring of a tendon", [](Model& m, StepSettings&) { add_tendon(m).stiffness = 5.0; }};
const Feature tendon_servo{"servo of a tendon",
                           [](Model& m, StepSettings&) { add_tendon(m).drive = {.kp = 20.0, .kd = 1.0}; }};
const Feature tendon_range{"range of a tendon", [](Model& m, StepSettings&) { range(add_tendon(m)); }};
const Feature tendon_limited{"limited servo of a tendon", [](Model& m, StepSettings&) { servo(add_tendon(m)); }};
const Feature ratios{"gear ratios per environment", vary<Parameter::gear_ratio>};
const Feature masses{"masses per environment", vary<Parameter::mass>};
const Feature softness{"softness per environment", vary<Parameter::softness>};
const Feature switches{"switches per environment", vary<Parameter::coupling_switch>};
const Feature impulses{"recorded impulses", [](Model&, StepSettings& s) { s.record_impulses = true; }};
const Feature balances{"recorded diagnostics", [](Model&, StepSettings& s) { s.record_diagnostics = true; }};
const Feature records{
    "records", [](Model&, StepSettings& s) { s.record_efforts = s.record_contacts = s.record_accelerations = true; }};
const Feature contact{"contact", [](Model& m, StepSettings&) {
                        m.colliders.push_back({.name = "ball", .link = "l2", .shape = Shape::sphere(0.05)});
                        contact_scenes::add_floor(m, 0.5);  // as a wall in the way of the joints
                        Pose& wall = m.colliders.back().pose;
                        wall.linear() = Eigen::AngleAxisd(0.9, Eigen::Vector3d::UnitY()).toRotationMatrix();
                        wall.translation().x() = -0.2;
                        m.gravity.x() = -1.0;
                        m.contacts = {{"floor", "ball"}};
                      }};
// The same wall as a box too: a hull on the box, a cylinder on the half-space, and an ellipsoid on both.
const Feature solids{"contact of solids", [](Model& m, StepSettings& s) {
                       contact.add(m, s);
                       Eigen::Matrix3Xd corners(3, 8);
                       for (int i = 0; i < 8; ++i)
                         corners.col(i) << (i & 1 ? 0.04 : -0.04), (i & 2 ? 0.05 : -0.05), (i & 4 ? 0.03 : -0.03);
                       m.colliders[0] = {.name = "hull", .link = "l2", .shape = Shape::hull(corners, 0.01)};
                       Collider can{.name = "can", .link = "l2", .shape = Shape::cylinder(0.05, 0.1)};
                       can.pose.translation().y() = 0.2;
                       Collider egg{.name = "egg", .link = "l2", .shape = Shape::ellipsoid({0.05, 0.06, 0.04})};
                       egg.pose.translation().y() = -0.2;
                       Collider box{.name = "box", .shape = Shape::box({1.0, 1.0, 0.2}), .pose = m.colliders[1].pose};
                       box.pose.translation() -= 0.1 * box.pose.linear().col(2);
                       for (const Collider& collider : {can, egg, box}) m.colliders.push_back(collider);
                       m.contacts = {{"box", "hull"}, {"floor", "can"}, {"floor", "egg"}, {"box", "egg"}};
                     }};

// The wall of the solids with waves on it.
const Feature field{"contact with a height field", [](Model& m, StepSettings& s) {
                      solids.add(m, s);
                      Eigen::MatrixXd heights(21, 25);
                      for (int j = 0; j < heights.rows(); ++j)
                        for (int i = 0; i < heights.cols(); ++i) heights(j, i) = 0.02 * std::sin(i) * std::cos(2.0 * j);
                      m.colliders[1].shape = Shape::height_field(heights, 5.0, 4.0);
                      Collider pill{.name = "pill", .link = "l2", .shape = Shape::capsule(0.03, 0.1)};
                      pill.pose.translation().y() = 0.4;
                      m.colliders.push_back(pill);
                      m.contacts = {{"floor", "hull"}, {"floor", "can"}, {"floor", "egg"}, {"floor", "pill"}};
                    }};
const Feature turning{"torsional and rolling friction", [](Model& m, StepSettings&) {
                        for (Collider& collider : m.colliders)
                          collider.torsional_friction = 0.01, collider.rolling_friction = 0.002;
                      }};
const Feature soft_contact{"soft contacts", [](Model& m, StepSettings&) {
                             for (Contact& contact : m.contacts) contact.softness = Spring{2e4, 50.0};
                           }};
const Feature colliders{
    "places, sizes and restitution of colliders per environment", [](Model&, StepSettings& s) {
      for (const Parameter own : {Parameter::collider_place, Parameter::collider_size, Parameter::contact_restitution})
        s.per_environment.insert(own);
    }};

// Two rods from the base to the first body, whose end a loop holds.
Loop& add_loop(Model& model) {
  constexpr double length = 2.5;
  const auto add_rod = [&](const char* name, const std::string& parent, double along, double angle) {
    model.links.push_back({name, Inertia::box(0.2, {length, 0.05, 0.05}, {0.5 * length, 0.0, 0.0})});
    Joint& joint = model.joints.emplace_back();
    joint.name = std::string(name) + " turn", joint.kind = JointKind::revolute;
    joint.parent = parent, joint.child = name, joint.axis = Eigen::Vector3d::UnitY();
    joint.origin.translation().x() = along, joint.position = angle;
  };
  add_rod("first rod", "base", -length, -1.0);
  add_rod("second rod", "first rod", length, 2.0);
  Loop& loop = model.loops.emplace_back();
  loop.name = "loop", loop.first = "second rod", loop.second = "l0";
  loop.first_pose.translation().x() = length;
  return loop;
}
const Feature cam{"function of a joint", [](Model& m, StepSettings&) {
                    m.couplings.push_back(Coupling::cam("q2", "q0", Polynomial{{0.0, 1.5, 0.2}}));
                  }};
const Feature functions{"functions per environment", vary<Parameter::function>};
const Feature loop{"loop", [](Model& m, StepSettings&) { add_loop(m); }};
const Feature soft_loop{"soft loop", [](Model& m, StepSettings&) { add_loop(m).softness = Spring{200.0, 5.0}; }};
const Feature limited_loop{"loop with a force limit", [](Model& m, StepSettings&) { add_loop(m).force_limit = 2.0; }};
const Feature loop_switches{"loop switches per environment", vary<Parameter::loop_switch>};
const Feature loop_frames{"frames of loops per environment", vary<Parameter::loop_frame>};

// A bob turns on the last body about its centre of mass, and touches the wall where that does.
const Feature ball{"ball joint", [](Model& m, StepSettings&) {
                     m.links.push_back({"bob", Inertia::box(1.0, {0.3, 0.2, 0.4}, Eigen::Vector3d::Zero())});
                     const int first = m.add_ball("ball", "l2", "bob");
                     for (int k = 0; k < 3; ++k) {
                       Joint& part = m.joints[static_cast<std::size_t>(first + k)];
                       part.damping = 0.05, part.position = 0.2 * k - 0.1, part.velocity = 1.0 - k;
                     }
                     if (m.contacts.empty()) return;
                     Collider tip{.name = "tip", .link = "bob", .shape = Shape::sphere(0.05)};
                     tip.pose.translation().z() = -0.45;
                     m.colliders.push_back(tip);
                     m.contacts.push_back({"floor", "tip"});
                   }};
const Feature ball_range{"its range", [](Model& m, StepSettings&) { joint_of(m, "ball.x").upper = 0.6; }};
const Feature soft_ball_range{"its soft range", [](Model& m, StepSettings&) {
                                Joint& first = joint_of(m, "ball.x");
                                first.upper = 0.6, first.limit_softness = Spring{30.0, 1.0};
                              }};
const Feature ball_drives{"its friction, spring and limited servos", [](Model& m, StepSettings&) {
                            for (const char* name : {"ball.x", "ball.y", "ball.z"})
                              servo(joint_of(m, name)), joint_of(m, name).stiffness = 2.0;
                            joint_of(m, "ball.y").friction = 0.05, joint_of(m, "ball.z").velocity_limit = 3.0;
                          }};

// From a hook beside the first body over it to the second one, or to the bob where there is one.
const Feature cable{"spatial tendon", [](Model& m, StepSettings&) {
                      Joint joint;
                      joint.name = "cable", joint.kind = JointKind::tendon;
                      const bool has_bob = m.links.back().name == "bob";
                      const Eigen::Vector3d hook(0.3, 0.4, 0.1), first(0.0, 0.1, 0.0), last(0.0, -0.2, 0.1);
                      joint.path = {{"", "l0", hook, first}, {"l0", has_bob ? "bob" : "l1", first, last, 0.5}};
                      joint.stiffness = 5.0, joint.rest = 0.8, joint.damping = 0.3;
                      m.joints.push_back(joint);
                    }};
const Feature cable_range{"its range", [](Model& m, StepSettings&) { joint_of(m, "cable").upper = 1.3; }};
const Feature soft_cable_range{"its soft range", [](Model& m, StepSettings&) {
                                 joint_of(m, "cable").upper = 1.2;
                                 joint_of(m, "cable").limit_softness = Spring{60.0, 1.0};
                               }};
const Feature cable_drives{"its friction and limited servo", [](Model& m, StepSettings&) {
                             Joint& joint = joint_of(m, "cable");
                             servo(joint);
                             joint.drive.position_target = 0.9, joint.friction = 0.1, joint.velocity_limit = 3.0;
                           }};

}  // namespace

const std::vector<std::vector<Feature>>& all_scenes() {
  static const std::vector<std::vector<Feature>> all{
      {},
      {hard},
      {soft},
      {stiff},
      {hard, limits},
      {hard, speed},
      {hard, friction},
      {hard, drive},
      {hard, servos},
      {hard, limits, servos},
      {soft, limits},
      {soft, limits, servos},
      {stiff, limits},
      {hard, soft_limit},
      {hard, soft_drive},
      {force_limit},
      {force_limit, limits},
      {sum},
      {sum, limits},
      {sum, sum_limits},
      {spring},
      {tendon_servo},
      {tendon_range},
      {tendon_limited},
      {hard, tendon_range, servos},
      {hard, ratios},
      {hard, ratios, limits},
      {hard, masses, limits},
      {hard, softness},
      {soft, softness},
      {hard, switches},
      {soft, softness, limits},
      {hard, switches, limits},
      {tendon_servo, softness},
      {hard, tendon_servo, switches},
      {hard, impulses},
      {hard, balances},
      {hard, limits, balances},
      {contact},
      {contact, hard},
      {contact, soft},
      {contact, stiff},
      {contact, hard, limits},
      {contact, hard, speed},
      {contact, hard, friction},
      {contact, hard, drive},
      {contact, hard, limits, servos},
      {contact, soft, limits},
      {contact, stiff, limits},
      {contact, hard, soft_limit},
      {contact, hard, soft_drive},
      {contact, force_limit},
      {contact, sum, sum_limits},
      {contact, tendon_servo},
      {contact, tendon_range},
      {contact, tendon_limited},
      {contact, hard, tendon_range, servos},
      {contact, hard, ratios},
      {contact, hard, masses},
      {contact, soft, softness},
      {contact, soft, softness, limits},
      {contact, hard, switches},
      {contact, hard, impulses},
      {contact, hard, balances},
      {loop},
      {soft_loop},
      {limited_loop},
      {loop, hard},
      {loop, soft},
      {loop, stiff},
      {loop, hard, limits},
      {loop, hard, speed},
      {loop, hard, friction},
      {loop, hard, drive},
      {loop, hard, limits, servos},
      {soft_loop, hard, limits, servos},
      {loop, hard, soft_limit},
      {loop, hard, soft_drive},
      {loop, force_limit},
      {loop, sum, sum_limits},
      {loop, tendon_servo},
      {loop, tendon_range},
      {loop, tendon_limited},
      {loop, hard, ratios},
      {loop, hard, masses},
      {loop, soft, softness},
      {loop, hard, switches},
      {loop, loop_switches},
      {loop, hard, limits, loop_switches},
      {loop, loop_frames},
      {loop, hard, impulses},
      {loop, hard, balances},
      {contact, loop},
      {contact, soft_loop},
      {contact, limited_loop},
      {contact, loop, hard},
      {contact, loop, hard, limits, servos},
      {contact, loop, hard, drive},
      {contact, loop, soft, softness, limits},
      {contact, loop, tendon_range},
      {contact, loop, hard, masses},
      {contact, loop, loop_switches},
      {contact, loop, hard, impulses},
      {contact, loop, hard, balances},
      {cam},
      {cam, limits},
      {cam, limits, sum_limits},
      {cam, speed},
      {cam, friction},
      {cam, drive},
      {cam, servos},
      {cam, soft_limit},
      {cam, tendon_servo},
      {cam, masses},
      {cam, functions},
      {cam, limits, functions},
      {cam, impulses},
      {cam, balances},
      {contact, cam},
      {contact, cam, limits, servos},
      {contact, cam, functions},
      {loop, cam},
      {loop, cam, limits, servos},
      {loop, cam, functions},
      {contact, loop, cam, limits},
      {late},
      {late, hard, limits},
      {late, hard, lags},
      {late, stiff, friction},
      {hard, late_drive},
      {late, tendon_servo},
      {motors},
      {motors, hard, limits},
      {motors, late, hard, curves, lags},
      {contact, late, hard},
      {contact, motors, hard, limits, curves},
      {contact, loop, motors, late, hard, limits, lags},
      {loop, late, hard},
      {loop, cam, motors, late},
      {hard, limits, servos, records},
      {contact, late, motors, hard, limits, records},
      {contact, loop, hard, limits, servos, records},
      {contact, cam, functions, records},
      {solids},
      {solids, hard, limits, servos},
      {solids, soft, softness, limits},
      {solids, hard, masses, balances},
      {solids, loop, hard, drive},
      {solids, cam, functions},
      {solids, late, motors, hard, limits, records},
      {contact, colliders},
      {solids, colliders, hard, limits, servos},
      {field},
      {field, hard, limits, servos},
      {field, loop, hard, drive},
      {field, cam, functions, balances},
      {field, colliders, late, motors, hard, limits, records},
      {contact, turning},
      {contact, turning, hard, limits, servos},
      {contact, turning, soft_contact, soft, softness, limits},
      {contact, turning, loop, tendon_range},
      {solids, turning, hard, masses, balances},
      {solids, turning, colliders, cam, functions},
      {field, turning, colliders, late, motors, hard, limits, records},
      {ball},
      {ball, ball_range},
      {ball, soft_ball_range},
      {ball, ball_drives},
      {ball, ball_range, hard, limits, servos},
      {ball, ball_range, ball_drives, soft, softness, limits},
      {ball, ball_drives, hard, masses, balances},
      {ball, ball_range, tendon_range, switches},
      {ball, ball_range, ball_drives, cam, functions},
      {ball, ball_range, ball_drives, late, motors, hard, limits, records},
      {loop, ball, ball_range, ball_drives},
      {loop, ball, cam, limits, servos},
      {contact, ball},
      {contact, ball, ball_range, hard, limits, servos},
      {contact, turning, ball, ball_drives, soft, softness, limits},
      {contact, loop, ball, ball_range, tendon_range},
      {solids, colliders, ball, ball_range, ball_drives, cam, functions},
      {field, turning, colliders, ball, soft_ball_range, ball_drives, late, motors, hard, limits, records},
      {cable},
      {cable, cable_range},
      {cable, soft_cable_range},
      {cable, cable_drives},
      {cable, cable_range, hard, limits, servos},
      {cable, cable_range, cable_drives, soft, softness, limits},
      {cable, cable_drives, hard, masses, balances},
      {cable, cable_range, tendon_range, switches},
      {cable, cable_range, cable_drives, cam, functions},
      {cable, cable_range, cable_drives, late, motors, hard, limits, records},
      {cable, cable_range, sum, sum_limits, ratios},
      {ball, ball_range, cable, cable_range, cable_drives},
      {loop, cable, cable_range, cable_drives},
      {loop, ball, cable, soft_cable_range, cam, limits, servos},
      {contact, cable},
      {contact, cable, cable_range, hard, limits, servos},
      {contact, turning, cable, cable_drives, soft, softness, limits},
      {contact, loop, ball, ball_range, cable, cable_range, tendon_range},
      {solids, colliders, cable, cable_range, cable_drives, cam, functions},
      {field, turning, colliders, ball, cable, soft_cable_range, cable_drives, late, motors, hard, limits, records},
  };
  return all;
}

}  // namespace lockstep::combinations
