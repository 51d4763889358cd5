// Batch::mass_matrices(): S^T (M + armatures) S of (M146), by composite rigid bodies in world axes (M10) to (M12).
// SPDX-License-Identifier: Apache-2.0
#include "links.h"

namespace lockstep {
namespace {

// What a link carries, about the origin of its frame.
struct Composite {
  double mass = 0.0;
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();

  /// (M10) of a body whose origin is at `arm`, in the same axes.
  void add(const Composite& other, const Eigen::Vector3d& arm) {
    const Eigen::Vector3d u = other.moment + 0.5 * other.mass * arm;
    mass += other.mass, moment += other.moment + other.mass * arm;
    second += other.second + arm * u.transpose() + u * arm.transpose();
  }

  /// (M11) What a unit acceleration about or along an axis through the origin needs.
  LinkForce turned(const Eigen::Vector3d& axis) const {
    return {axis.cross(moment), second.trace() * axis - second * axis};
  }
  LinkForce moved(const Eigen::Vector3d& axis) const { return {mass * axis, moment.cross(axis)}; }
};

template <class Links, class Coordinates>
class MassMatrix {
 public:
  MassMatrix(const Links& links, const Coordinates& coordinates)
      : links_(links),
        trees_(links.trees()),
        coordinates_(coordinates),
        composites_(links.model().links.size()),
        matrix_(coordinates.velocities(), coordinates.velocities()) {}

  void find(int e, Eigen::VectorXd& numbers) {
    matrix_.setZero();
    for (std::size_t l = 0; l < composites_.size(); ++l) {
      const auto& link = links_[static_cast<int>(l)];
      composites_[l] = {link.mass, link.moment, link.second};
    }
    for (auto j = trees_.joints_depth_first.rbegin(); j != trees_.joints_depth_first.rend(); ++j) {
      const Composite& own = composite(links_.child(*j));
      composite(links_.parent(*j)).add(own, links_.arm(*j));
      if (links_.joint(*j).moves())
        put_column(links_.velocity(*j), links_.child(*j),
                   links_.slides(*j) ? own.moved(links_.axis(*j)) : own.turned(links_.axis(*j)));
    }
    for (int tree = 0; tree < trees_.count(); ++tree)
      for (int k = 0; k < 3 && links_.root_velocity(tree) >= 0; ++k) {
        const int root = trees_.root_link[static_cast<std::size_t>(tree)];
        put_root(tree, links_.root_velocity(tree) + k, composite(root).turned(links_[root].turn.col(k)));
        put_root(tree, links_.root_velocity(tree) + 3 + k, composite(root).moved(links_[root].turn.col(k)));
      }
    for (std::size_t j = 0; j < links_.model().joints.size(); ++j)
      if (const int dof = links_.dof(static_cast<int>(j)); dof >= 0) {
        const int velocity = links_.velocity(static_cast<int>(j));
        matrix_(velocity, velocity) += links_.field(Parameter::armature, dof, e);
      }

    half_.noalias() = matrix_.template selfadjointView<Eigen::Lower>() * coordinates_.shares();
    reduced_.noalias() = coordinates_.shares().transpose() * half_;
    const int n = coordinates_.count();
    for (int row = 0; row < n; ++row)
      for (int column = 0; column <= row; ++column)
        numbers[n * row + column] = numbers[n * column + row] = reduced_(row, column);
  }

 private:
  Composite& composite(int link) { return composites_[static_cast<std::size_t>(link)]; }

  // In the lower triangle.
  void put(int row, int column, double number) { matrix_(std::max(row, column), std::min(row, column)) = number; }

  // What the joints on the way to the root, and the root, take of a force on a link.
  void put_column(int column, int link, LinkForce needed) {
    for (int j; (j = trees_.parent_joint[static_cast<std::size_t>(link)]) >= 0; link = links_.parent(j)) {
      if (links_.joint(j).moves())
        put(links_.velocity(j), column, links_.axis(j).dot(links_.slides(j) ? needed.force : needed.moment));
      needed.moment += links_.arm(j).cross(needed.force);
    }
    put_root(trees_.tree_of[static_cast<std::size_t>(link)], column, needed);
  }

  void put_root(int tree, int column, const LinkForce& needed) {
    const int first = links_.root_velocity(tree);
    if (first < 0) return;
    const Eigen::Matrix3d& turn = links_[trees_.root_link[static_cast<std::size_t>(tree)]].turn;
    const Eigen::Vector3d moment = turn.transpose() * needed.moment, force = turn.transpose() * needed.force;
    for (int k = 0; k < 3; ++k) put(first + k, column, moment[k]), put(first + 3 + k, column, force[k]);
  }

  const Links& links_;
  const Trees& trees_;
  const Coordinates& coordinates_;
  std::vector<Composite> composites_;
  Eigen::MatrixXd matrix_, half_, reduced_;
};

}  // namespace

template <class S>
auto Batch<S>::mass_matrices(const EnvironmentSet& which) const -> Array {
  using Links = typename Impl::Links;
  const int n = Coordinates<S>(plan()).count();
  return Links::template of_each<MassMatrix<Links, Coordinates<S>>>(impl(), which, n * n);
}

template auto Batch<float>::mass_matrices(const EnvironmentSet&) const -> Array;
template auto Batch<double>::mass_matrices(const EnvironmentSet&) const -> Array;

}  // namespace lockstep
