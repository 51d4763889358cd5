// Batch::bias_forces(): S^T ((M + armatures) dS/dt z + c) of (M146), by the equations of Newton and Euler in world axes
// (M5) to (M9). SPDX-License-Identifier: Apache-2.0
#include "links.h"
#include "model/joint_motion.h"

namespace lockstep {
namespace {

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& a) {
  Eigen::Matrix3d matrix;
  matrix << 0, -a[2], a[1], a[2], 0, -a[0], -a[1], a[0], 0;
  return matrix;
}

template <class Links, class Coordinates>
class BiasForces {
 public:
  BiasForces(const Links& links, const Coordinates& coordinates)
      : links_(links),
        trees_(links.trees()),
        coordinates_(coordinates),
        motions_(links.model().links.size()),
        forces_(motions_.size()),
        all_(coordinates.velocities()) {}

  void find(int e, Eigen::VectorXd& numbers) {
    all_.setZero();
    for (int tree = 0; tree < trees_.count(); ++tree) move_root(tree, e);
    for (const int j : trees_.joints_depth_first) move(j, e);
    for (std::size_t l = 0; l < forces_.size(); ++l) forces_[l] = force(static_cast<int>(l), e);
    for (auto j = trees_.joints_depth_first.rbegin(); j != trees_.joints_depth_first.rend(); ++j) pass(*j);
    for (int tree = 0; tree < trees_.count(); ++tree)
      if (const int first = links_.root_velocity(tree); first >= 0) {
        const int root = root_link(tree);
        all_.template segment<3>(first) = links_[root].turn.transpose() * at(forces_, root).moment;
        all_.template segment<3>(first + 3) = links_[root].turn.transpose() * at(forces_, root).force;
      }
    for (std::size_t j = 0; j < links_.model().joints.size(); ++j)
      if (const int dof = links_.dof(static_cast<int>(j)); dof >= 0) {
        const int velocity = links_.velocity(static_cast<int>(j));
        all_[velocity] += links_.field(Parameter::armature, dof, e) * coordinates_.acceleration()[velocity];
      }
    numbers.noalias() = coordinates_.shares().transpose() * all_;
  }

 private:
  struct Motion {
    Eigen::Vector3d angular, linear;  // accelerations, the second one of the frame's origin
  };

  template <class Rows>
  static auto& at(Rows& rows, int link) {
    return rows[static_cast<std::size_t>(link)];
  }
  int root_link(int tree) const { return trees_.root_link[static_cast<std::size_t>(tree)]; }
  Eigen::Matrix3d tensor(int link) const {  // (M5)
    const Eigen::Matrix3d turning = cross_matrix(links_[link].angular);
    return cross_matrix(at(motions_, link).angular) + turning * turning;
  }

  // Where the components of a root's twist stay, its origin accelerates by w x u.
  void move_root(int tree, int e) {
    Motion& root = at(motions_, root_link(tree));
    root = {Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
    if (const int first = links_.root_velocity(tree); first >= 0) {
      Eigen::Vector3d velocity;
      for (int k = 0; k < 3; ++k) velocity[k] = links_.root_twist(first + 3 + k, e);
      root.linear = links_[root_link(tree)].angular.cross(links_[root_link(tree)].turn * velocity);
    }
  }

  void move(int j, int e) {  // (M6)
    const int parent = links_.parent(j), child = links_.child(j);
    Motion& own = at(motions_, child);
    own = {at(motions_, parent).angular, at(motions_, parent).linear + tensor(parent) * links_.arm(j)};
    if (!links_.joint(j).moves()) return;
    const Eigen::Vector3d axis = links_.axis(j);
    // All parts of a ball turn with what carries the first.
    const Joint& joint = links_.joint(j);
    const int carrier = joint.kind == JointKind::ball ? links_.parent(j - part_of_ball(joint)) : parent;
    const Eigen::Vector3d turning = links_[carrier].angular.cross(axis * links_.speed(j, e)),
                          added = axis * coordinates_.acceleration()[links_.velocity(j)];
    if (links_.slides(j))
      own.linear += 2.0 * turning + added;
    else
      own.angular += turning + added;
  }

  LinkForce force(int l, int e) const {  // (M7), with the link's own share of gravity
    const auto& link = links_[l];
    Eigen::Vector3d gravity;
    for (int k = 0; k < 3; ++k) gravity[k] = links_.field(Parameter::gravity, k, e);
    const Eigen::Vector3d origin =
        at(motions_, l).linear - links_.model().links[static_cast<std::size_t>(l)].gravity * gravity;
    const Eigen::Matrix3d turning = tensor(l), x = turning * link.second;
    const Eigen::Vector3d ax(x(2, 1) - x(1, 2), x(0, 2) - x(2, 0), x(1, 0) - x(0, 1));
    return {link.mass * origin + turning * link.moment, link.moment.cross(origin) + ax};
  }

  void pass(int j) {  // (M9)
    const LinkForce& own = at(forces_, links_.child(j));
    if (links_.joint(j).moves())
      all_[links_.velocity(j)] = links_.axis(j).dot(links_.slides(j) ? own.force : own.moment);
    LinkForce& parent = at(forces_, links_.parent(j));
    parent.moment += own.moment + links_.arm(j).cross(own.force), parent.force += own.force;
  }

  const Links& links_;
  const Trees& trees_;
  const Coordinates& coordinates_;
  std::vector<Motion> motions_;
  std::vector<LinkForce> forces_;
  Eigen::VectorXd all_;
};

}  // namespace

template <class S>
auto Batch<S>::bias_forces(const EnvironmentSet& which) const -> Array {
  using Links = typename Impl::Links;
  return Links::template of_each<BiasForces<Links, Coordinates<S>>>(impl(), which, Coordinates<S>(plan()).count());
}

template auto Batch<float>::bias_forces(const EnvironmentSet&) const -> Array;
template auto Batch<double>::bias_forces(const EnvironmentSet&) const -> Array;

}  // namespace lockstep
