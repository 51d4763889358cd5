// The reference: a mechanism's dynamics, dense and as in a textbook. SPDX-License-Identifier: Apache-2.0
//
// The reference checks the kernels, so it shares nothing with them but the Model and its Trees. It uses doubles and
// dense matrices, world-frame Jacobians of each link, and d'Alembert's principle. Every link is a body, also one that a
// fixed joint carries.
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "lockstep/model.h"
#include "model/trees.h"

namespace lockstep::reference {

using Vector6d = Eigen::Matrix<double, 6, 1>;

/// Where a root link's frame is in the world.
struct RootPose {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< m
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
};

/// Position and velocity of a mechanism. Generalised velocities: first the six of each floating root (angular, then
/// linear, in root-link axes, as at Root in model.h), then those of the moving joints in the order of Model::joints.
struct State {
  std::vector<RootPose> roots;  ///< by tree
  Eigen::VectorXd q;            ///< [dofs] joint positions
  Eigen::VectorXd v;            ///< [velocities] generalised velocities
};

/// The inputs of a step.
struct Inputs {
  Eigen::VectorXd position_targets, velocity_targets;  ///< [dofs] of the drives
  Eigen::VectorXd efforts;                             ///< [dofs] feed-forward
  Eigen::MatrixXd wrenches;  ///< [6][links] torque about the link frame's origin, then force, both in world axes
  std::vector<bool> off;     ///< [couplings] switched off; empty: none
};

class Mechanism {
 public:
  explicit Mechanism(const Model& model);  ///< throws ModelError if the model is not valid

  const Model& model() const { return model_; }
  const Trees& trees() const { return trees_; }
  int dofs() const { return static_cast<int>(joint_of_dof_.size()); }
  int root_velocities() const { return root_velocities_; }
  int root_velocity(int tree) const { return root_velocity_[tree]; }  ///< the first of its six, -1 if it is bolted
  int velocities() const { return root_velocities() + dofs(); }
  int links() const { return static_cast<int>(model_.links.size()); }
  const Joint& joint(int dof) const { return model_.joints[joint_of_dof_[dof]]; }
  int dof_of_joint(int joint) const { return dof_of_joint_[joint]; }  ///< -1 for a fixed one
  int dof(const std::string& joint) const { return dof_of_joint_[model_.joint_index(joint)]; }

  /// Constants of the joints, one for each generalised velocity; 0 for those of a floating root.
  const Eigen::VectorXd& armature() const { return armature_; }
  const Eigen::VectorXd& damping() const { return damping_; }
  const Eigen::VectorXd& kp() const { return kp_; }
  const Eigen::VectorXd& kd() const { return kd_; }
  const Eigen::VectorXd& stiffness() const { return stiffness_; }  ///< of springs

  State initial_state() const;    ///< the model's state
  Inputs initial_inputs() const;  ///< the model's targets and efforts, no wrenches

  // --- kinematics, all in world axes -----------------------------------------------------------------
  std::vector<Eigen::Isometry3d> link_poses(const State& state) const;
  /// [6][velocities]: angular velocity of the link, then velocity of a point given in the link's frame.
  Eigen::MatrixXd jacobian(const State& state, int link, const Eigen::Vector3d& point = Eigen::Vector3d::Zero()) const;
  Vector6d link_velocity(const State& state, int link) const;  ///< angular, then that of the frame's origin
  /// Of the same, at dv/dt = 0: dJ/dt v.
  Vector6d acceleration(const State& state, int link, const Eigen::Vector3d& point = Eigen::Vector3d::Zero()) const;
  Eigen::Vector3d site_position(const State& state, int site) const;
  Eigen::MatrixXd site_jacobian(const State& state, int site) const;

  // --- dynamics: M dv/dt + c = generalised forces; armatures are not in M ----------------------------
  /// Sum over the links of J^T I J, without armature. A coupling that says what a tendon's position is adds the inertia
  /// 1 of its error, which never moves: it changes nothing, and the matrix stays regular.
  Eigen::MatrixXd mass_matrix(const State& state) const;
  /// c(q, v): the forces of dv/dt = 0, with gravity. A root's dv/dt are the rates of the twist's components in root
  /// axes, so for a single body I dw/dt + w x I w = 0.
  Eigen::VectorXd bias(const State& state) const;
  Eigen::VectorXd wrench_forces(const State& state, const Eigen::MatrixXd& wrenches) const;
  /// Efforts, drives, springs and the joints' damping.
  Eigen::VectorXd joint_forces(const State& state, const Inputs& inputs) const;

  double kinetic_energy(const State& state) const;    ///< with the armatures' share
  double potential_energy(const State& state) const;  ///< gravity alone, zero at the world's origin
  Vector6d momentum(const State& state) const;        ///< angular about the world's origin, then linear

  /// What c becomes if roots step in inertial axes: a velocity u that is constant in these changes by -w x u in a
  /// root's axes. `mass` is the mass matrix, v all velocities.
  Eigen::VectorXd inertial_axes_bias(const Eigen::MatrixXd& mass, const Eigen::VectorXd& v) const;
  /// (M48): turns the twists of `next` from the axes that roots have in `before` to those in `next`.
  void turn_axes(const State& before, State& next) const;

  /// Positions after a way in the velocities' axes: a ball turns once, by its three ways. Beyond pi it goes on.
  Eigen::VectorXd moved(const Eigen::VectorXd& q, const Eigen::VectorXd& way) const;
  /// The rates of the positions at these generalised velocities.
  Eigen::VectorXd rates(const Eigen::VectorXd& q, const Eigen::VectorXd& v) const;

  /// The state moved for a time h with constant generalised velocities v. Joints and rotations of roots are exact; a
  /// root's translation keeps the direction R v of the start. Velocities do not change.
  State advanced(const State& state, const Eigen::VectorXd& v, double h) const;

 private:
  Model model_;
  Trees trees_;
  int root_velocities_ = 0;
  std::vector<int> root_velocity_;
  std::vector<int> joint_of_dof_, dof_of_joint_;
  Eigen::VectorXd armature_, damping_, kp_, kd_, stiffness_, rest_;
};

}  // namespace lockstep::reference
