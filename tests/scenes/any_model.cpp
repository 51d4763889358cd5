// SPDX-License-Identifier: Apache-2.0
#include "any_model.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <random>

namespace lockstep::scenes {

std::vector<std::uint8_t> bytes_of(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<std::uint8_t> bytes(1024);
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random() >> 56);
  return bytes;
}

int AnyModel::whole(int low, int high) {
  const int byte = used_ < bytes_.size() ? bytes_[used_++] : 0;
  return low + byte % (high - low + 1);
}

double AnyModel::real(double low, double high) { return low + (high - low) * (whole(0, 255) / 255.0); }

Eigen::Vector3d AnyModel::vector(double most) {
  Eigen::Vector3d result;
  for (double& component : result) component = real(-most, most);
  return result;
}

Pose AnyModel::pose(double distance) {
  Pose result = Pose::Identity();
  if (chance()) result.linear() = Eigen::AngleAxisd(real(-3.0, 3.0), Eigen::Vector3d::UnitZ()).toRotationMatrix();
  result.translation() = vector(distance);
  return result;
}

// No initializer here draws two numbers outside of braces: compilers differ in the order of a call's arguments.
Softness AnyModel::softness() {
  switch (whole(0, 3)) {
    case 0: return Hard{real(0.0, 1.0)};
    case 1: return Spring{real(0.0, 100.0), real(0.0, 5.0)};
    case 2: return Frequency{real(0.0, 50.0), real(0.0, 2.0)};
    default: return Hard{};
  }
}

std::string AnyModel::link() { return "l" + std::to_string(whole(0, links_ - 1)); }

std::string AnyModel::moving_link() {
  if (careless_ || moving_.empty()) return link();
  return "l" + std::to_string(moving_[static_cast<std::size_t>(whole(0, static_cast<int>(moving_.size()) - 1))]);
}

void AnyModel::add_joint(Model& model, int child) {
  const std::string name = "j" + std::to_string(child), link = "l" + std::to_string(child);
  const std::string parent = "l" + std::to_string(whole(0, child - 1));
  if (one_in(5)) {
    model.add_ball(name, parent, link, pose(0.2));
    return;
  }
  Joint joint;
  joint.name = name, joint.parent = parent, joint.child = link, joint.origin = pose(0.2);
  joint.kind = one_of({JointKind::revolute, JointKind::revolute, JointKind::continuous, JointKind::prismatic});
  if (one_in(8)) joint.kind = JointKind::fixed;
  joint.axis = Eigen::Vector3d::Unit(whole(0, 2));
  joint.armature = real(0.01, 0.1);
  if (chance()) joint.damping = real(0.0, 1.0);
  if (chance()) joint.stiffness = real(0.0, 50.0), joint.rest = real(-1.0, 1.0);
  Drive& drive = joint.drive;
  if (chance()) drive.kp = real(0.0, 100.0), drive.kd = real(0.0, 10.0), drive.position_target = real(-1.0, 1.0);
  if (one_in(6)) drive.delay = whole(0, 3), drive.lag = real(0.0, 0.05);
  if (one_in(6)) drive.stall_effort = real(1.0, 9.0), drive.no_load_speed = real(1.0, 20.0);
  if (one_in(8)) drive = {}, drive.kinematic = true;
  if (chance() && joint.kind != JointKind::continuous) joint.lower = real(-1.0, 0.0), joint.upper = real(0.0, 1.0);
  if (one_in(4)) joint.limit_softness = softness();
  if (one_in(4) && (careless_ || is_hard(joint.limit_softness))) joint.restitution = real(0.0, 1.0);
  if (one_in(3)) joint.velocity_limit = real(0.1, 5.0);
  if (one_in(3) || (!careless_ && drive.stall_effort < infinity)) joint.effort_limit = real(0.0, 10.0);
  if (one_in(3)) joint.friction = real(0.0, 1.0);
  joint.position = real(-0.5, 0.5), joint.velocity = real(-2.0, 2.0);
  if (!careless_) joint.position = std::clamp(joint.position, joint.lower, joint.upper);
  if (careless_ || joint.kind != JointKind::fixed) coupled_.push_back(name);
  model.joints.push_back(joint);
}

void AnyModel::add_coupling(Model& model) {
  // Neighbours in a list that is turned are different joints.
  const int joints = static_cast<int>(coupled_.size());
  if (joints < 2 && !careless_) return;
  const int first = whole(0, joints - 1);
  const auto joint = [&](int i) { return coupled_[static_cast<std::size_t>((first + i) % joints)]; };
  Coupling coupling;
  coupling.joint = joint(0);
  const int terms = whole(1, std::max(1, std::min(2, joints - 1)));
  for (int i = 1; i <= terms; ++i) {
    CouplingTerm term;
    term.joint = joint(i), term.ratio = real(-3.0, 3.0);
    coupling.terms.push_back(term);
  }
  if (one_in(4)) coupling.offset = real(-0.1, 0.1);
  coupling.softness = softness();
  if (one_in(5)) coupling.force_limit = real(0.1, 10.0);
  if (one_in(5)) {
    coupling.terms.resize(1);
    coupling.terms[0].ratio = 1.0;
    coupling.function = Polynomial{{0.0, real(-1.0, 1.0), real(-1.0, 1.0)}};
    if (!careless_) coupling.offset = 0.0, coupling.softness = Hard{}, coupling.force_limit = infinity;
  }
  model.couplings.push_back(coupling);
}

void AnyModel::add_loop(Model& model) {
  Loop loop;
  loop.name = "loop" + std::to_string(model.loops.size());
  loop.kind = one_of({LoopKind::point, LoopKind::weld, LoopKind::hinge, LoopKind::slider});
  loop.first = moving_link();
  if (!chance()) loop.second = link();
  loop.first_pose = pose(0.1), loop.second_pose = pose(0.1), loop.softness = softness();
  model.loops.push_back(loop);
}

void AnyModel::add_tendon(Model& model) {
  Joint tendon;
  tendon.name = "tendon", tendon.kind = JointKind::tendon;
  tendon.path.emplace_back();
  tendon.path.back().second = moving_link();
  tendon.path.back().first_point = vector(1.0), tendon.path.back().second_point = vector(0.1);
  tendon.stiffness = real(0.0, 50.0), tendon.rest = real(0.0, 1.0);
  if (chance()) tendon.upper = real(0.5, 2.0);
  model.joints.push_back(tendon);
}

void AnyModel::add_collider(Model& model) {
  Collider own;
  own.name = "c" + std::to_string(model.colliders.size()), own.link = moving_link(), own.pose = pose(0.05);
  const double size = real(0.02, 0.1);
  Eigen::Matrix3Xd corners(3, 4);
  corners << 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1;
  switch (whole(0, 5)) {
    case 0: own.shape = Shape::sphere(size); break;
    case 1: own.shape = Shape::box({size, size, 2 * size}); break;
    case 2: own.shape = Shape::capsule(size, size); break;
    case 3: own.shape = Shape::cylinder(size, size); break;
    case 4: own.shape = Shape::ellipsoid({size, size, 0.5 * size}); break;
    default: own.shape = Shape::hull(size * corners);
  }
  own.friction = real(0.0, 1.5), own.restitution = real(0.0, 1.0);
  if (one_in(3)) own.softness = softness();
  if (one_in(3)) own.torsional_friction = real(0.0, 0.05), own.rolling_friction = real(0.0, 0.01);
  Collider ground;
  ground.name = "ground" + own.name, ground.shape = Shape::half_space();
  ground.pose.translation().z() = real(-1.0, 0.0);
  model.contacts.push_back({ground.name, own.name});
  if (!model.colliders.empty() && chance() && (careless_ || model.colliders[0].link != own.link))
    model.contacts.push_back({model.colliders[0].name, own.name});
  model.colliders.push_back(own), model.colliders.push_back(ground);
}

Model AnyModel::model() {
  Model model;
  careless_ = one_in(16);
  links_ = whole(1, 6);
  const bool floats = chance();
  for (int i = 0; i < links_; ++i) {
    if (i > 0 || floats) moving_.push_back(i);
    Link& link = model.links.emplace_back();
    link.name = "l" + std::to_string(i);
    link.inertia.mass = real(0.1, 2.0), link.inertia.center = vector(0.1);
    link.inertia.about_center = Eigen::Vector3d::Constant(link.inertia.mass * real(0.01, 0.1)).asDiagonal();
    if (i > 0) add_joint(model, i);
  }
  if (floats) model.roots.push_back({"l0", true, Pose::Identity(), Twist::Constant(real(-1.0, 1.0))});
  if (chance()) model.gravity = vector(10.0);
  for (int i = whole(0, 3); i > 0 && !coupled_.empty(); --i) add_coupling(model);
  if (moving_.empty()) return model;
  if (one_in(4)) add_loop(model);
  if (one_in(4)) add_tendon(model);
  for (int i = one_in(2) ? whole(1, 3) : 0; i > 0; --i) add_collider(model);
  return model;
}

StepSettings AnyModel::settings() {
  StepSettings settings;
  if (one_in(2)) settings.method = one_of({Method::reduced, Method::direct, Method::pgs, Method::tgs});
  settings.integrator = one_of({Integrator::automatic, Integrator::euler});
  if (one_in(4))
    settings.integrator = one_of({Integrator::leapfrog, Integrator::extrapolated, Integrator::runge_kutta});
  settings.dt = one_of({1.0 / 240.0, 1e-3, 1.0 / 60.0});
  settings.iterations = whole(1, 6), settings.velocity_iterations = whole(0, 2);
  for (int i = one_in(3) ? whole(1, 3) : 0; i > 0; --i)
    settings.per_environment.insert(static_cast<Parameter>(whole(0, parameter_count - 1)));
  settings.stage_inputs = one_in(8), settings.record_impulses = one_in(8), settings.record_diagnostics = one_in(8);
  settings.record_efforts = one_in(8), settings.record_contacts = one_in(8);
  settings.record_accelerations = one_in(8);
  return settings;
}

}  // namespace lockstep::scenes
