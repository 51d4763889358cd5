// Which features stand beside which: the page that says it. SPDX-License-Identifier: Apache-2.0
//
// One file: every test goes through the one list of features and scenes.
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <random>
#include <sstream>

#include "contact_scenes.h"
#include "jit/compile.h"
#include "lockstep/error.h"
#include "lockstep/generate.h"
#include "physics.h"
#include "plan/program.h"

namespace lockstep {
namespace {

// Scenes are made of features, which change the model or the settings.
struct Feature {
  const char* name;
  void (*add)(Model&, StepSettings&);
};

Joint& joint_of(Model& model, const char* name) {
  return model.joints[static_cast<std::size_t>(model.joint_index(name))];
}
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

const std::vector<std::vector<Feature>> scenes{
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

struct Scene {
  Model model = arm();
  StepSettings settings;
  std::string name;

  explicit Scene(const std::vector<Feature>& features) {
    for (const Feature& feature : features) {
      feature.add(model, settings);
      name += (name.empty() ? "" : " + ") + std::string(feature.name);
    }
  }
  bool has(const char* feature) const { return name.find(feature) != std::string::npos; }
};

struct Cell {
  std::string text;      // engines, or "-"
  std::string obstacle;  // rule and remedy
};

Cell cell(const Model& model, StepSettings settings, Method method, Integrator integrator) {
  settings.method = method, settings.integrator = integrator;
  try {
    const Plan plan = compile(model, settings);
    std::string engines = "T";
    if (jit::plan_obstacle(program_of(plan)).empty()) engines += "C";
    if (kernel_hash(plan) != 0 && !program_of(plan).f64.contacts.used()) engines += "G";
    return {engines, ""};
  } catch (const Error& error) {
    return {"-", error.element() + ": " + error.rule() + "; " + error.remedy()};
  }
}

struct Table {
  std::string page;
  int by_default = 0, by_reduced = 0, in_leapfrog = 0;
};

Table table() {
  Table result;
  std::vector<std::string> obstacles;
  std::ostringstream rows;
  for (const std::vector<Feature>& features : scenes) {
    const Scene scene(features);
    rows << "| " << (scene.name.empty() ? "nothing" : scene.name);
    const auto add = [&](Method method, Integrator integrator) {
      const Cell found = cell(scene.model, scene.settings, method, integrator);
      if (!found.obstacle.empty()) {
        auto place = std::find(obstacles.begin(), obstacles.end(), found.obstacle);
        if (place == obstacles.end()) place = obstacles.insert(place, found.obstacle);
        rows << " " << found.text << " (" << place - obstacles.begin() + 1 << ")";
        return false;
      }
      rows << " " << found.text;
      return true;
    };
    rows << " |";
    result.by_default += add(Method::automatic, Integrator::automatic);
    rows << " |";
    result.by_reduced += add(Method::reduced, Integrator::euler);
    rows << " |";
    result.in_leapfrog += add(Method::reduced, Integrator::leapfrog);
    rows << " |";
    add(Method::reduced, Integrator::extrapolated), add(Method::reduced, Integrator::runge_kutta);
    rows << " |";
    add(Method::direct, Integrator::euler), add(Method::direct, Integrator::leapfrog);
    rows << " |";
    add(Method::pgs, Integrator::euler), add(Method::tgs, Integrator::euler);
    rows << " |\n";
  }
  std::ostringstream page;
  page << "# Which features stand beside which\n\n"
          "T: tables, C: compiled, G: generated code, -: refused, for the numbered reason below. Of "
       << scenes.size() << " scenes, " << result.by_default << " run by default, " << result.by_reduced
       << " by `reduced` with `euler`, " << result.in_leapfrog
       << " by `reduced` with `leapfrog`.\n\n"
          "| scene | default | reduced, euler | reduced, leapfrog | reduced, extrapolated and runge_kutta | direct, "
          "euler "
          "and leapfrog | pgs and tgs, euler |\n"
          "| --- | --- | --- | --- | --- | --- | --- |\n"
       << rows.str() << "\n";
  for (std::size_t i = 0; i < obstacles.size(); ++i) page << i + 1 << ". " << obstacles[i] << "\n";
  page << "\n`LOCKSTEP_WRITE_PAGES=1 ctest -R CombinationsPage` writes this page.\n";
  result.page = page.str();
  return result;
}

// Delays, lags, motors' curves and colliders, where they are parameters, of each environment its own.
void make_different(Batch<float>& batch) {
  const ParameterSet& own = batch.plan().settings().per_environment;
  for (int e = 0; e < batch.environments(); ++e)
    for (const char* name : {"q0", "q1"}) {
      const int dof = batch.plan().dof(name);
      if (own.contains(Parameter::drive_delay))
        batch.parameter(Parameter::drive_delay)(dof, e) = static_cast<float>(e % 5);
      if (own.contains(Parameter::drive_lag))
        batch.parameter(Parameter::drive_lag)(dof, e) = 0.004f * static_cast<float>(e % 7);
      if (own.contains(Parameter::motor_curve))
        batch.parameter(Parameter::motor_curve)(2 * dof, e) = 3.0f + 0.1f * static_cast<float>(e);
    }
  if (!own.contains(Parameter::collider_size)) return;
  for (int e = 0; e < batch.environments(); ++e) {
    const auto share = static_cast<float>(e) / static_cast<float>(batch.environments());
    batch.parameter(Parameter::contact_restitution).col(e) = 0.5f * share;
    for (int c = 0; c < batch.parameter(Parameter::collider_place).rows() / 4; ++c) {
      auto place = batch.parameter(Parameter::collider_place).col(e);
      place[4 * c] += 0.02f * share, place[4 * c + 3] += 0.3f * share;
    }
    const auto& all = batch.plan().model().colliders;
    for (std::size_t c = 0; c < all.size(); ++c)
      if (!is_ground(all[c].shape.kind))
        batch.parameter(Parameter::collider_size).col(e).segment(3 * static_cast<int>(c), 3) *= 0.8f + 0.4f * share;
  }
}

// Random efforts and targets, of each environment its own.
template <class S>
void act_differently(Batch<S>& batch, std::mt19937& random) {
  std::uniform_real_distribution<float> within(-1.0f, 1.0f);
  for (int e = 0; e < batch.environments(); ++e)
    for (const Joint& joint : batch.plan().model().joints) {
      const int dof = batch.plan().dof(joint.name);
      batch.efforts()(dof, e) = 2.0f * within(random);
      if (joint.drive.kp > 0.0 || joint.drive.kinematic) batch.position_targets()(dof, e) = within(random);
    }
}

// Whatever is accepted moves without a fault under random efforts and targets that differ, for two seconds. Where the
// coupling is hard it holds, ranges hold, but by sweeps, and hard loops stay closed. Contacts press in many of the
// steps.
TEST(Combinations, of_all_features_move_soundly_with_actions_that_differ) {
  constexpr int environments = 40, controls = 40, steps = 12;
  const std::pair<Method, Integrator> ways[] = {{Method::automatic, Integrator::automatic},
                                                {Method::reduced, Integrator::euler},
                                                {Method::reduced, Integrator::leapfrog},
                                                {Method::pgs, Integrator::euler}};
  int runs = 0;
  for (const std::vector<Feature>& features : scenes)
    for (const auto& [method, integrator] : ways) {
      Scene scene(features);
      scene.settings.method = method, scene.settings.integrator = integrator;
      if (cell(scene.model, scene.settings, method, integrator).text == "-") continue;
      const Plan plan = compile(scene.model, scene.settings);
      const std::string words = scene.name + " by " + to_string(plan.method()) + ", " + to_string(plan.integrator());
      Batch<float> batch(plan, environments, {.threads = 1});
      make_different(batch);
      std::mt19937 random(11);
      float coupling = 0.0f, range = 0.0f, gap = 0.0f;
      double pressed = 0.0;
      const int first = plan.dof("q0"), second = plan.dof("q1");
      for (int control = 0; control < controls; ++control) {
        act_differently(batch, random);
        batch.step(steps);
        if (scene.has("contact")) pressed += contact_scenes::counts_of(batch).row(3).sum();
        coupling = std::max(coupling, batch.coupling_errors().size() ? batch.coupling_errors().abs().maxCoeff() : 0.0f);
        if (!plan.loops().empty()) gap = std::max(gap, batch.loop_errors().maxCoeff());
        range = std::max(
            {range, batch.positions().row(first).abs().maxCoeff(), batch.positions().row(second).abs().maxCoeff()});
      }
      EXPECT_EQ(batch.faulted(), 0) << words << (batch.faulted() ? ": " + batch.explain_fault(0) : "");
      if (scene.has("contact")) {
        EXPECT_GT(pressed, 0.2 * controls * steps * environments) << words;
      }
      if (method == Method::pgs) continue;
      if (scene.has("hard coupling") && !scene.has("per environment")) {
        EXPECT_LT(coupling, 1e-5f) << words;
      }
      if (!plan.loops().empty() && !scene.has("soft loop") && !scene.has("loop with a force limit")) {
        EXPECT_LT(gap, 1e-3f) << words;
      }
      if (scene.has("position limits")) {
        EXPECT_LT(range, 1.0f + 1e-4f) << words;
      }
      ++runs;
    }
  EXPECT_GT(runs, 280);
}

// What is recorded changes no bit. Efforts keep their limits, accelerations are the changes of velocities, and all
// momentum comes from gravity, contacts and the joints at the base.
TEST(Combinations, are_recorded_as_they_move) {
  using contact_scenes::read;
  constexpr int environments = 9;
  const std::pair<Method, Integrator> ways[] = {{Method::automatic, Integrator::automatic},
                                                {Method::reduced, Integrator::euler},
                                                {Method::pgs, Integrator::euler}};
  int runs = 0;
  for (const std::vector<Feature>& features : scenes)
    for (const auto& [method, integrator] : ways) {
      Scene scene(features);
      scene.settings.method = method, scene.settings.integrator = integrator;
      StepSettings kept = scene.settings;
      kept.record_efforts = !scene.has("kinematic drive");
      kept.record_contacts = kept.record_accelerations = true;
      if (cell(scene.model, kept, method, integrator).text == "-") continue;
      const Plan plan = compile(scene.model, kept);
      const std::string words = scene.name + " by " + to_string(plan.method()) + ", " + to_string(plan.integrator());
      Batch<float> recorded(plan, environments, {.threads = 1});
      if (supported(Target::avx2) && jit::has_routines(program_of(plan))) {
        EXPECT_EQ(recorded.engine(), Engine::compiled);
      }
      Batch<float> plain(compile(scene.model, scene.settings), environments,
                         {.threads = 1, .engine = recorded.engine()});
      make_different(plain), make_different(recorded);
      std::mt19937 random(3), again(3);
      Eigen::ArrayXXf before;
      Eigen::ArrayXXd momentum;
      for (int control = 0; control < 10; ++control) {
        act_differently(plain, random), act_differently(recorded, again);
        plain.step(8), recorded.step(7);
        before = recorded.velocities(), momentum = recorded.momenta().template cast<double>();
        recorded.step();
      }
      EXPECT_TRUE((plain.positions() == recorded.positions()).all()) << words;
      EXPECT_TRUE((plain.velocities() == recorded.velocities()).all()) << words;

      const double dt = kept.dt;
      const Eigen::ArrayXXd change = (recorded.velocities() - before).cast<double>() / dt;
      EXPECT_LT((read(recorded, Quantity::joint_acceleration) - change).abs().maxCoeff(),
                1e-5 * change.abs().maxCoeff() + 1e-9)
          << words;
      if (kept.record_efforts && scene.has("limited servos")) {
        EXPECT_LE(read(recorded, Quantity::drive_effort).topRows(2).abs().maxCoeff(), 3.0 + 1e-6) << words;
      }

      const Eigen::ArrayXXd wrench = read(recorded, Quantity::joint_wrench),
                            touch = read(recorded, Quantity::link_contact_force),
                            gain = (recorded.momenta().template cast<double>() - momentum) / dt;
      if (scene.has("masses per environment")) continue;  // weights are not the model's
      for (int e = 0; e < environments; ++e) {
        Eigen::Vector3d force = Eigen::Vector3d::Zero();
        for (std::size_t l = 0; l < scene.model.links.size(); ++l)
          force += touch.col(e).segment<3>(3 * static_cast<int>(l)).matrix();
        double mass = 0.0;
        for (const Joint& joint : scene.model.joints) {
          if (joint.child.empty()) continue;
          const int link = scene.model.link_index(joint.child);
          mass += scene.model.links[static_cast<std::size_t>(link)].inertia.mass;
          if (std::any_of(scene.model.joints.begin(), scene.model.joints.end(),
                          [&](const Joint& other) { return other.child == joint.parent; }))
            continue;  // not at the base
          const Eigen::VectorXd pose = recorded.link_poses(link).col(e).matrix().template cast<double>();
          const Eigen::Quaterniond turn(pose(3), pose(4), pose(5), pose(6));
          force += turn * wrench.col(e).segment<3>(6 * plan.dof(joint.name)).matrix();
        }
        force += mass * scene.model.gravity;
        const double size = 1.0 + gain.col(e).abs().maxCoeff() + mass * scene.model.gravity.norm();
        EXPECT_LT((force - gain.col(e).tail<3>().matrix()).norm(), 0.02 * size) << words << ", environment " << e;
      }
      ++runs;
    }
  EXPECT_GT(runs, 230);
}

// What compile() refuses of a scene by its method or integrator, the plan by default lists, in the same words; and
// what it lists, compile() refuses.
TEST(Combinations, that_are_refused_are_obstacles_of_the_plan_by_default) {
  constexpr Integrator staged[] = {Integrator::leapfrog, Integrator::extrapolated, Integrator::runge_kutta};
  std::vector<std::pair<Method, Integrator>> ways{{Method::pgs, Integrator::euler},
                                                  {Method::tgs, Integrator::euler},
                                                  {Method::direct, Integrator::euler},
                                                  {Method::direct, Integrator::leapfrog}};
  for (const Integrator integrator : staged) ways.push_back({Method::reduced, integrator});
  int refused = 0, listed = 0;
  for (const std::vector<Feature>& features : scenes) {
    const auto [model, settings, name] = Scene(features);
    const Plan plan = compile(model, settings);
    const std::vector<Obstacle> obstacles = plan.obstacles();
    for (const auto& [method, integrator] : ways) {
      StepSettings asked = settings;
      asked.method = method, asked.integrator = integrator;
      try {
        compile(model, asked);
      } catch (const SettingsError& error) {
        const std::string what = error.element() == "method" ? to_string(method) : to_string(integrator);
        EXPECT_TRUE(std::any_of(obstacles.begin(), obstacles.end(),
                                [&](const Obstacle& o) {
                                  return o.applies_to == what && error.rule().ends_with(o.reason) &&
                                         error.remedy() == o.remedy && !o.feature.empty();
                                }))
            << name << ": " << error.what();
        ++refused;
      }
    }
    for (const Obstacle& obstacle : obstacles) {
      for (const Method method : {Method::pgs, Method::tgs, Method::direct, Method::reduced})
        if (obstacle.applies_to == to_string(method)) {
          EXPECT_EQ(cell(model, settings, method, Integrator::automatic).text, "-") << name << ": " << obstacle.reason;
          ++listed;
        }
      for (const Integrator integrator : staged)
        if (obstacle.applies_to == to_string(integrator)) {
          EXPECT_EQ(cell(model, settings, plan.method(), integrator).text, "-") << name << ": " << obstacle.reason;
          ++listed;
        }
    }
  }
  EXPECT_GT(refused, 150);
  EXPECT_GT(listed, 150);
}

// A looser tolerance may not cost more. Stiff rows go to and fro between their pieces where steps are not searched.
TEST(Combinations, with_contacts_need_no_more_rounds_for_learning_than_by_default) {
  constexpr int environments = 40;
  double by_default = 0.0, for_learning = 0.0;
  for (const std::vector<Feature>& features : scenes) {
    Scene scene(features);
    if (!scene.has("contact")) continue;
    scene.settings.integrator = Integrator::euler;
    double rounds[2] = {};
    for (int learning = 0; learning < 2; ++learning) {
      if (learning) scene.settings.contacts = ContactSettings::learning();
      Batch<float> batch(compile(scene.model, scene.settings), environments, {.threads = 1});
      std::mt19937 random(11);
      for (int control = 0; control < 20; ++control) {
        act_differently(batch, random);
        batch.step(12);
        rounds[learning] += contact_scenes::counts_of(batch).row(6).sum();
      }
    }
    EXPECT_LT(rounds[1], 1.3 * rounds[0]) << scene.name;
    by_default += rounds[0], for_learning += rounds[1];
  }
  EXPECT_GT(by_default, 0.0);
  EXPECT_LT(for_learning, by_default);
}

// Environments that differ, after a moment of random efforts and targets.
Batch<double> disturbed(const Plan& plan, int environments, int steps) {
  Batch<double> batch(plan, environments, {.threads = 1});
  std::mt19937 random(7);
  act_differently(batch, random);
  batch.step(steps);
  return batch;
}

// The derivatives of two steps are the product of those of each, but for what is held by friction or a bound, where a
// difference may lie on both sides of an edge.
TEST(Combinations, have_derivatives_of_two_steps_that_are_a_product) {
  constexpr int environments = 3;
  int smooth = 0;
  for (const std::vector<Feature>& features : scenes) {
    Scene scene(features);
    SCOPED_TRACE(scene.name);
    scene.settings.contacts = {10, 200, 1e-11};
    Batch<double> batch = disturbed(compile(scene.model, scene.settings), environments, 20);
    if (scene.has("late")) {
      EXPECT_THROW(batch.linearize(), UsageError);
      continue;
    }
    const auto both = batch.linearize(EnvironmentSet::all(), {.substeps = 2}), first = batch.linearize();
    batch.step();
    const auto second = batch.linearize();
    bool has_edges = false;
    for (const char* edge : {"contact", "limit", "friction", "range", "motors"}) has_edges |= scene.has(edge);
    const double bound = scene.has("loop") ? 8e-4 : 1e-6;  // they are closed before each of the derivatives
    for (std::size_t e = 0; e < environments; ++e) {
      EXPECT_EQ(both[e].fault, Fault::none);
      EXPECT_TRUE(both[e].state_by_state.allFinite() && both[e].state_by_input.allFinite());
      if (has_edges) continue;
      const Eigen::MatrixXd product = second[e].state_by_state * first[e].state_by_state;
      EXPECT_LT((both[e].state_by_state - product).cwiseAbs().maxCoeff(), bound * product.cwiseAbs().maxCoeff());
      ++smooth;
    }
  }
  EXPECT_GT(smooth, 50);
}

// A site that random joints carry somewhere is carried there from the start.
TEST(Combinations, reach_by_inverse_kinematics_where_random_joints_were) {
  constexpr int environments = 20;
  for (const std::vector<Feature>& features : scenes) {
    Scene scene(features);
    SCOPED_TRACE(scene.name);
    scene.model.add_site("tip", scene.has("loop") ? "second rod" : "l2").pose.translation().x() = 0.7;
    const Plan plan = compile(scene.model, scene.settings);
    Batch<double> batch(plan, environments, {.threads = 1});
    EXPECT_TRUE(batch.reset_random(EnvironmentSet::all(), {.spread = 0.5}).empty());
    const Batch<double>::Array targets = batch.site_positions(0);
    batch.reset();
    const Batch<double>::Array left = batch.inverse_kinematics(0, targets);
    EXPECT_LT(left.maxCoeff(), 1e-6);
    if (plan.couplings() > 0) {
      EXPECT_LT(batch.coupling_errors().abs().maxCoeff(), 1e-7);
    }
    if (!plan.loops().empty()) {
      EXPECT_LT(batch.loop_errors().maxCoeff(), 1e-6);
    }
    for (int dof = 0; dof < plan.dofs(); ++dof) {
      const Joint& joint = joint_of(scene.model, plan.dof_names()[static_cast<std::size_t>(dof)].c_str());
      EXPECT_GE(batch.positions().row(dof).minCoeff(), joint.lower - 1e-7) << joint.name;
      EXPECT_LE(batch.positions().row(dof).maxCoeff(), joint.upper + 1e-7) << joint.name;
    }
  }
}

// z M z / 2 is the kinetic energy.
TEST(Combinations, have_mass_matrices_of_their_energies) {
  constexpr int environments = 5;
  for (const std::vector<Feature>& features : scenes) {
    Scene scene(features);
    SCOPED_TRACE(scene.name);
    const Plan plan = compile(scene.model, scene.settings);
    Batch<double> batch = disturbed(plan, environments, 20);
    batch.project();
    const std::vector<int> dofs = open_coordinate_dofs(plan);
    const auto n = static_cast<Eigen::Index>(dofs.size());
    const auto masses = batch.mass_matrices(), energies = batch.kinetic_energies();
    for (int e = 0; e < environments; ++e) {
      Eigen::VectorXd z(n), momentum = Eigen::VectorXd::Zero(n);
      for (Eigen::Index k = 0; k < n; ++k) z[k] = batch.velocities()(dofs[static_cast<std::size_t>(k)], e);
      for (Eigen::Index k = 0; k < n * n; ++k) momentum[k / n] += masses(k, e) * z[k % n];
      const double energy = 0.5 * z.dot(momentum);
      EXPECT_NEAR(energy, energies(0, e), 1e-10 * (1.0 + energies(0, e)));
      EXPECT_GT(energy, 0.0);
    }
  }
}

TEST(CombinationsPage, is_what_compile_says) {
  const Table found = table();
  const std::string path = LOCKSTEP_MODELS "/../../docs/results/combinations.md";
  if (std::getenv("LOCKSTEP_WRITE_PAGES")) std::ofstream(path) << found.page;
  std::ostringstream committed;
  committed << std::ifstream(path).rdbuf();
  EXPECT_EQ(committed.str(), found.page);
}

}  // namespace
}  // namespace lockstep
