// Kinematics and dynamics of the reference. SPDX-License-Identifier: Apache-2.0
#include "mechanism.h"

#include <cmath>
#include <complex>
#include <map>

#include "lockstep/error.h"
#include "model/tendons.h"

namespace lockstep::reference {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using Complex = std::complex<double>;

template <class T>
using Vec3 = Eigen::Matrix<T, 3, 1>;
template <class T>
using Mat3 = Eigen::Matrix<T, 3, 3>;
template <class T>
using VecX = Eigen::Matrix<T, Eigen::Dynamic, 1>;
template <class T>
using MatX = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>;

// The kinematics are templates, so that complex numbers can differentiate them: for analytic f, Im f(x + i e dx) / e is
// the derivative along dx to rounding, because no two nearly equal numbers are subtracted.
constexpr double complex_step = 1e-20;

template <class T>
struct Pose {
  Mat3<T> rotation;
  Vec3<T> position;
};

template <class T>
Mat3<T> skew(const Vec3<T>& a) {
  Mat3<T> matrix;
  matrix << T(0), -a[2], a[1], a[2], T(0), -a[0], -a[1], a[0], T(0);
  return matrix;
}

// Rodrigues' formula.
template <class T>
Mat3<T> turn(const Vector3d& axis, T angle) {
  using std::cos, std::sin;
  const Mat3<T> k = skew<T>(axis.cast<T>());
  return Mat3<T>::Identity() + sin(angle) * k + (T(1) - cos(angle)) * (k * k);
}

std::vector<Pose<double>> root_poses(const State& state) {
  std::vector<Pose<double>> poses;
  for (const RootPose& root : state.roots)
    poses.push_back({root.orientation.normalized().toRotationMatrix(), root.position});
  return poses;
}

// The turns of ball joints, by joint.
template <class T>
using BallTurns = std::map<int, Mat3<T>>;

bool is_ball(const Mechanism& mechanism, int joint) { return mechanism.model().joints[joint].kind == JointKind::ball; }
bool begins_ball(const Mechanism& mechanism, int joint) {
  return is_ball(mechanism, joint) && mechanism.model().joints[joint].axis.x() != 0.0;
}

Matrix3d turn_of_vector(const Vector3d& vector) {
  const double angle = vector.norm();
  return angle == 0.0 ? Matrix3d::Identity() : turn<double>(vector / angle, angle);
}

BallTurns<double> ball_turns(const Mechanism& mechanism, const VectorXd& q) {
  BallTurns<double> turns;
  for (std::size_t j = 0; j < mechanism.model().joints.size(); ++j)
    if (begins_ball(mechanism, static_cast<int>(j)))
      turns[static_cast<int>(j)] = turn_of_vector(q.segment<3>(mechanism.dof_of_joint(static_cast<int>(j))));
  return turns;
}

template <class T>
std::vector<Pose<T>> forward(const Mechanism& mechanism, const std::vector<Pose<T>>& roots, const VecX<T>& q,
                             const BallTurns<T>& balls) {
  std::vector<Pose<T>> poses(mechanism.links());
  for (std::size_t tree = 0; tree < roots.size(); ++tree) poses[mechanism.trees().root_link[tree]] = roots[tree];
  for (const int j : mechanism.trees().joints_depth_first) {
    const Joint& joint = mechanism.model().joints[j];
    const Pose<T>& parent = poses[mechanism.trees().joint_parent[j]];
    Pose<T> child;
    child.rotation = parent.rotation * joint.origin.linear().template cast<T>();
    child.position = parent.rotation * joint.origin.translation().template cast<T>() + parent.position;
    if (joint.moves()) {
      const Vector3d axis = joint.axis.normalized();
      const T value = q[mechanism.dof_of_joint(j)];
      if (begins_ball(mechanism, j))
        child.rotation = (child.rotation * balls.at(j)).eval();  // the other parts follow it
      else if (joint.kind == JointKind::prismatic)
        child.position += child.rotation * (axis.cast<T>() * value);
      else if (!is_ball(mechanism, j))
        child.rotation = (child.rotation * turn<T>(axis, value)).eval();
    }
    poses[mechanism.trees().joint_child[j]] = child;
  }
  return poses;
}

std::vector<Pose<double>> poses_of(const Mechanism& mechanism, const State& state) {
  return forward<double>(mechanism, root_poses(state), state.q, ball_turns(mechanism, state.q));
}

// Each column has the link's angular velocity, and the velocity of a point of the link, for a unit of one generalised
// velocity. The point is given in the world.
template <class T>
MatX<T> point_jacobian(const Mechanism& mechanism, const std::vector<Pose<T>>& poses, int link, const Vec3<T>& point) {
  MatX<T> jacobian = MatX<T>::Zero(6, mechanism.velocities());
  const auto set_rotation = [&](int column, const Vec3<T>& axis, const Vec3<T>& origin) {
    jacobian.col(column) << axis, skew<T>(axis) * (point - origin);
  };
  const Trees& trees = mechanism.trees();
  int l = link;
  for (; trees.parent_joint[l] >= 0; l = trees.joint_parent[trees.parent_joint[l]]) {
    const Joint& joint = mechanism.model().joints[trees.parent_joint[l]];
    if (!joint.moves()) continue;
    const int column = mechanism.root_velocities() + mechanism.dof_of_joint(trees.parent_joint[l]);
    const Vec3<T> axis = poses[l].rotation * joint.axis.normalized().cast<T>();
    if (joint.kind == JointKind::prismatic)
      jacobian.col(column).tail(3) = axis;
    else
      set_rotation(column, axis, poses[l].position);
  }
  if (const int first = mechanism.root_velocity(trees.tree_of[l]); first >= 0)
    for (int k = 0; k < 3; ++k) {
      set_rotation(first + k, poses[l].rotation.col(k), poses[l].position);
      jacobian.col(first + 3 + k).tail(3) = poses[l].rotation.col(k);
    }
  return jacobian;
}

// The links' poses a step along the velocities: q + i e dq/dt, and the roots' poses moved to first order by their
// twists.
std::vector<Pose<Complex>> moving_poses(const Mechanism& mechanism, const State& state) {
  const Complex step(0.0, complex_step);
  std::vector<Pose<Complex>> moved_roots;
  for (const Pose<double>& root : root_poses(state)) {
    Pose<Complex> moved = {root.rotation.cast<Complex>(), root.position.cast<Complex>()};
    if (const int first = mechanism.root_velocity(static_cast<int>(moved_roots.size())); first >= 0) {
      moved.rotation += step * (root.rotation * skew<double>(state.v.segment<3>(first))).cast<Complex>();
      moved.position += step * (root.rotation * state.v.segment<3>(first + 3)).cast<Complex>();
    }
    moved_roots.push_back(moved);
  }
  const VecX<Complex> moved_q = state.q.cast<Complex>() + step * state.v.tail(mechanism.dofs()).cast<Complex>();
  BallTurns<Complex> moved_balls;
  for (const auto& [joint, turned] : ball_turns(mechanism, state.q)) {
    const Vector3d w = state.v.segment<3>(mechanism.root_velocities() + mechanism.dof_of_joint(joint));
    moved_balls[joint] = turned.cast<Complex>() + step * (turned * skew<double>(w)).cast<Complex>();
  }
  return forward<Complex>(mechanism, moved_roots, moved_q, moved_balls);
}

// The rotation vector after a further turn in the child's axes; beyond pi it goes on.
Vector3d ball_advanced(const Vector3d& vector, const Vector3d& turn) {
  Eigen::AngleAxisd whole(Matrix3d(turn_of_vector(vector) * turn_of_vector(turn)));
  const Vector3d near = whole.angle() * whole.axis();
  const Vector3d opposite = (whole.angle() - 2.0 * M_PI) * whole.axis();
  return (near - vector).norm() <= (opposite - vector).norm() ? near : opposite;
}

template <class T>
Vec3<T> center_of_mass(const Pose<T>& pose, const Inertia& inertia) {
  return pose.rotation * inertia.center.cast<T>() + pose.position;
}

Matrix3d world_inertia(const Matrix3d& rotation, const Inertia& inertia) {
  return rotation * inertia.about_center * rotation.transpose();
}

}  // namespace

Mechanism::Mechanism(const Model& model) : model_((model.validate(), model)), trees_(model) {
  model_.roots = trees_.roots;
  for (const Joint& joint : model_.joints)
    if (is_spatial(joint))
      throw ModelError("joint '" + joint.name + "'", "is a spatial tendon, which the reference does not know",
                       "leave it out, and give its tension as efforts and wrenches");
  place_tendons(model_);
  for (const Root& root : model_.roots) {
    root_velocity_.push_back(root.floating ? root_velocities_ : -1);
    root_velocities_ += root.floating ? 6 : 0;
  }
  dof_of_joint_.assign(model.joints.size(), -1);
  for (std::size_t j = 0; j < model.joints.size(); ++j)
    if (model.joints[j].moves()) {
      dof_of_joint_[j] = dofs();
      joint_of_dof_.push_back(static_cast<int>(j));
    }
  for (VectorXd* constants : {&armature_, &damping_, &kp_, &kd_, &stiffness_, &rest_})
    *constants = VectorXd::Zero(velocities());
  for (int i = 0; i < dofs(); ++i) {
    const int row = root_velocities() + i;
    armature_[row] = joint(i).armature;
    damping_[row] = joint(i).damping;
    stiffness_[row] = joint(i).stiffness;
    rest_[row] = joint(i).rest;
    kp_[row] = joint(i).drive.kp;
    kd_[row] = joint(i).drive.kd;
  }
}

State Mechanism::initial_state() const {
  State state;
  state.q.resize(dofs());
  state.v.resize(velocities());
  for (std::size_t tree = 0; tree < model_.roots.size(); ++tree) {
    const Root& root = model_.roots[tree];
    state.roots.push_back({root.pose.translation(), Eigen::Quaterniond(root.pose.linear()).normalized()});
    if (root.floating) state.v.segment<6>(root_velocity_[tree]) = root.velocity;
  }
  for (int i = 0; i < dofs(); ++i) {
    state.q[i] = joint(i).position;
    state.v[root_velocities() + i] = joint(i).velocity;
  }
  return state;
}

Inputs Mechanism::initial_inputs() const {
  Inputs inputs;
  inputs.position_targets.resize(dofs());
  inputs.velocity_targets.resize(dofs());
  inputs.efforts.resize(dofs());
  inputs.wrenches = MatrixXd::Zero(6, links());
  for (int i = 0; i < dofs(); ++i) {
    inputs.position_targets[i] = joint(i).drive.position_target;
    inputs.velocity_targets[i] = joint(i).drive.velocity_target;
    inputs.efforts[i] = joint(i).effort;
  }
  return inputs;
}

std::vector<Isometry3d> Mechanism::link_poses(const State& state) const {
  std::vector<Isometry3d> result;
  for (const Pose<double>& pose : poses_of(*this, state)) {
    Isometry3d isometry = Isometry3d::Identity();
    isometry.linear() = pose.rotation;
    isometry.translation() = pose.position;
    result.push_back(isometry);
  }
  return result;
}

MatrixXd Mechanism::jacobian(const State& state, int link, const Vector3d& point) const {
  const auto poses = poses_of(*this, state);
  return point_jacobian<double>(*this, poses, link, poses[link].rotation * point + poses[link].position);
}

Vector6d Mechanism::link_velocity(const State& state, int link) const { return jacobian(state, link) * state.v; }

Vector3d Mechanism::site_position(const State& state, int site) const {
  const Site& s = model_.sites[site];
  return link_poses(state)[model_.link_index(s.link)] * s.pose.translation();
}

MatrixXd Mechanism::site_jacobian(const State& state, int site) const {
  const Site& s = model_.sites[site];
  return jacobian(state, model_.link_index(s.link), s.pose.translation());
}

MatrixXd Mechanism::mass_matrix(const State& state) const {
  const auto poses = poses_of(*this, state);
  MatrixXd mass = MatrixXd::Zero(velocities(), velocities());
  for (int l = 0; l < links(); ++l) {
    const Inertia& inertia = model_.links[l].inertia;
    const MatrixXd j = point_jacobian<double>(*this, poses, l, center_of_mass(poses[l], inertia));
    const auto angular = j.topRows<3>(), linear = j.bottomRows<3>();
    mass += inertia.mass * linear.transpose() * linear +
            angular.transpose() * world_inertia(poses[l].rotation, inertia) * angular;
  }
  for (const Coupling& coupling : model_.couplings) {
    if (!tendon_of(coupling, model_)) continue;
    VectorXd error = VectorXd::Unit(velocities(), root_velocities() + dof(coupling.joint));
    for (const CouplingTerm& term : coupling.terms) error[root_velocities() + dof(term.joint)] = term.ratio;
    mass += error * error.transpose();
  }
  return mass;
}

Vector6d Mechanism::acceleration(const State& state, int link, const Vector3d& point) const {
  const auto poses = moving_poses(*this, state);
  const Vec3<Complex> place = poses[link].rotation * point.cast<Complex>() + poses[link].position;
  const VecX<Complex> velocity = point_jacobian<Complex>(*this, poses, link, place) * state.v.cast<Complex>();
  return velocity.imag() / complex_step;
}

VectorXd Mechanism::bias(const State& state) const {
  const auto poses = moving_poses(*this, state);
  VectorXd result = VectorXd::Zero(velocities());
  for (int l = 0; l < links(); ++l) {
    const Inertia& inertia = model_.links[l].inertia;
    const MatX<Complex> j = point_jacobian<Complex>(*this, poses, l, center_of_mass(poses[l], inertia));
    const VecX<Complex> velocity = j * state.v.cast<Complex>();
    const Vector6d acceleration = velocity.imag() / complex_step;  // dJ/dt v
    const Vector3d omega = velocity.real().head<3>();
    const Matrix3d tensor = world_inertia(poses[l].rotation.real(), inertia);
    const Vector3d force = inertia.mass * (acceleration.tail<3>() - model_.links[l].gravity * model_.gravity);
    const Vector3d torque = tensor * acceleration.head<3>() + omega.cross(tensor * omega);
    result += j.topRows<3>().real().transpose() * torque + j.bottomRows<3>().real().transpose() * force;
  }
  return result;
}

VectorXd Mechanism::wrench_forces(const State& state, const MatrixXd& wrenches) const {
  VectorXd forces = VectorXd::Zero(velocities());
  for (int l = 0; l < links(); ++l)
    if (!wrenches.col(l).isZero(0.0)) forces += jacobian(state, l).transpose() * wrenches.col(l);
  return forces;
}

VectorXd Mechanism::joint_forces(const State& state, const Inputs& inputs) const {
  VectorXd forces = VectorXd::Zero(velocities());
  const VectorXd v = state.v.tail(dofs());
  forces.tail(dofs()) = inputs.efforts - damping_.tail(dofs()).cwiseProduct(v) -
                        kp_.tail(dofs()).cwiseProduct(state.q - inputs.position_targets) -
                        kd_.tail(dofs()).cwiseProduct(v - inputs.velocity_targets) -
                        stiffness_.tail(dofs()).cwiseProduct(state.q - rest_.tail(dofs()));
  return forces;
}

double Mechanism::kinetic_energy(const State& state) const {
  return 0.5 * state.v.dot(mass_matrix(state) * state.v) + 0.5 * state.v.dot(armature_.cwiseProduct(state.v));
}

double Mechanism::potential_energy(const State& state) const {
  const auto poses = poses_of(*this, state);
  double energy = 0.0;
  for (int l = 0; l < links(); ++l) {
    const Inertia& inertia = model_.links[l].inertia;
    energy -= model_.links[l].gravity * inertia.mass * model_.gravity.dot(center_of_mass(poses[l], inertia));
  }
  return energy;
}

Vector6d Mechanism::momentum(const State& state) const {
  const auto poses = poses_of(*this, state);
  Vector6d momentum = Vector6d::Zero();
  for (int l = 0; l < links(); ++l) {
    const Inertia& inertia = model_.links[l].inertia;
    const Vector3d center = center_of_mass(poses[l], inertia);
    const Vector6d velocity = point_jacobian<double>(*this, poses, l, center) * state.v;
    const Vector3d linear = inertia.mass * velocity.tail<3>();
    momentum.head<3>() += center.cross(linear) + world_inertia(poses[l].rotation, inertia) * velocity.head<3>();
    momentum.tail<3>() += linear;
  }
  return momentum;
}

VectorXd Mechanism::inertial_axes_bias(const MatrixXd& mass, const VectorXd& v) const {
  VectorXd change = VectorXd::Zero(velocities());
  for (const int first : root_velocity_)
    if (first >= 0)
      change.segment<3>(first + 3) = -Vector3d(v.segment<3>(first)).cross(Vector3d(v.segment<3>(first + 3)));
  return mass * change;
}

void Mechanism::turn_axes(const State& before, State& next) const {
  for (std::size_t tree = 0; tree < before.roots.size(); ++tree) {
    const int first = root_velocity_[tree];
    if (first < 0) continue;
    const Eigen::Quaterniond turn =
        next.roots[tree].orientation.normalized().conjugate() * before.roots[tree].orientation.normalized();
    for (int part : {first, first + 3}) next.v.segment<3>(part) = turn * Vector3d(next.v.segment<3>(part));
  }
}

VectorXd Mechanism::moved(const VectorXd& q, const VectorXd& way) const {
  VectorXd next = q + way;
  for (std::size_t j = 0; j < model_.joints.size(); ++j)
    if (begins_ball(*this, static_cast<int>(j))) {
      const int dof = dof_of_joint_[j];
      next.segment<3>(dof) = ball_advanced(q.segment<3>(dof), way.segment<3>(dof));
    }
  return next;
}

VectorXd Mechanism::rates(const VectorXd& q, const VectorXd& v) const {
  VectorXd rates = v.tail(dofs());
  for (std::size_t j = 0; j < model_.joints.size(); ++j) {
    if (!begins_ball(*this, static_cast<int>(j))) continue;
    const int dof = dof_of_joint_[j];
    const Vector3d vector = q.segment<3>(dof), w = rates.segment<3>(dof);
    const double angle = vector.norm();
    if (angle < 1e-4) {
      rates.segment<3>(dof) = w + 0.5 * vector.cross(w) + vector.cross(vector.cross(w)) / 12.0;
      continue;
    }
    // w is what the rate turns by: the right Jacobian of the exponential map.
    const Matrix3d k = skew<double>(vector / angle);
    const Matrix3d turned =
        Matrix3d::Identity() - (1.0 - std::cos(angle)) / angle * k + (1.0 - std::sin(angle) / angle) * k * k;
    rates.segment<3>(dof) = turned.lu().solve(w);
  }
  return rates;
}

State Mechanism::advanced(const State& state, const VectorXd& v, double h) const {
  State next = state;
  next.q = moved(state.q, h * v.tail(dofs()));
  for (std::size_t tree = 0; tree < state.roots.size(); ++tree) {
    const int first = root_velocity_[tree];
    if (first < 0) continue;
    const Eigen::Quaterniond& orientation = state.roots[tree].orientation;
    const Vector3d rotation = h * v.segment<3>(first);
    const double angle = rotation.norm();
    const Vector3d axis = angle > 0.0 ? Vector3d(rotation / angle) : Vector3d::UnitX();
    next.roots[tree].position += h * (orientation * v.segment<3>(first + 3));
    next.roots[tree].orientation = (orientation * Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis))).normalized();
  }
  return next;
}

}  // namespace lockstep::reference
