// Pivots of the mass matrix for joints that need the inertia of others (docs/mathematics.md, section 4).
// SPDX-License-Identifier: Apache-2.0
#include "moved_inertia.h"

#include <algorithm>
#include <cmath>

#include "inertia.h"
#include "joint_motion.h"

namespace lockstep {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

// A pivot below this share of the inertia that it is left of is rounding.
constexpr double rounding = 1e-12;

Matrix3d cross_matrix(const Vector3d& a) {
  Matrix3d matrix;
  matrix << 0.0, -a.z(), a.y(), a.z(), 0.0, -a.x(), -a.y(), a.x(), 0.0;
  return matrix;
}

// Angular first, about the frame's origin.
Matrix6 spatial(const Inertia& body) {
  const Matrix3d moment = body.mass * cross_matrix(body.center);
  Matrix6 inertia;
  inertia << body.about_center - moment * cross_matrix(body.center), moment, moment.transpose(),
      body.mass * Matrix3d::Identity();
  return inertia;
}

Vector6 direction(const Joint& joint) {
  Vector6 motion = Vector6::Zero();
  (joint.kind == JointKind::prismatic ? motion.tail<3>() : motion.head<3>()) = joint.axis.normalized();
  return motion;
}

// From a motion of the parent's frame to that of the frame that stands at `pose` in it.
Matrix6 motion_transform(const Isometry3d& pose) {
  const Matrix3d turn = pose.linear().transpose();
  Matrix6 transform = Matrix6::Zero();
  transform.topLeftCorner<3, 3>() = transform.bottomRightCorner<3, 3>() = turn;
  transform.bottomLeftCorner<3, 3>() = -turn * cross_matrix(pose.translation());
  return transform;
}

// A body and what it carries.
struct Carried {
  Matrix6 free;   // the articulated inertia: the joints behind the body move as they like
  Matrix6 scale;  // with these joints locked, and with m l^2 in place of the bodies' own tensors: measures rounding
  bool is_whole;  // the body alone resists every motion

  explicit Carried(const Inertia& body) : free(spatial(body)) {
    const Vector3d moments = principal_moments(body);
    const double size = inertia_scale(body.mass, moments);
    scale = spatial({body.mass, body.center, size * Matrix3d::Identity()});
    is_whole = body.mass > 0.0 && moments[0] > rounding * size;
  }

  double scale_for(const Joint& joint) const {
    return joint.armature + (joint.kind == JointKind::prismatic ? scale(3, 3) : scale.topLeftCorner<3, 3>().trace());
  }
  double pivot_for(const Joint& joint) const {
    const Vector6 motion = direction(joint);
    return motion.dot(free * motion) + joint.armature;
  }
  bool resists(const Joint& joint) const {
    const double pivot = pivot_for(joint);
    return pivot > 0.0 && pivot > rounding * scale_for(joint);
  }
  bool resists_all() const {
    if (is_whole) return true;
    if (!(scale.diagonal().minCoeff() > 0.0)) return false;
    const Vector6 unit = scale.diagonal().cwiseSqrt().cwiseInverse();
    const Matrix6 share = unit.asDiagonal() * free * unit.asDiagonal();
    // Its least eigenvalue is above `rounding`. A solver of six eigenvalues would take a minute to compile.
    return Eigen::LLT<Matrix6>(share - rounding * Matrix6::Identity()).info() == Eigen::Success;
  }
};

Unmoved reason(const Carried& carried, const Inertia& body, const Joint& joint) {
  if (!(carried.scale_for(joint) > 0.0)) return Unmoved::nothing;
  return body.mass > 0.0 || !body.about_center.isZero(0.0) ? Unmoved::axis : Unmoved::shared;
}

}  // namespace

std::vector<UnmovedLink> unmoved_links(const Model& model, const Trees& trees, const std::vector<Inertia>& bodies) {
  std::vector<Carried> carried(bodies.begin(), bodies.end());
  std::vector<UnmovedLink> unmoved;
  for (auto at = trees.joints_depth_first.rbegin(); at != trees.joints_depth_first.rend(); ++at) {
    const Joint& joint = model.joints[*at];
    if (!joint.moves()) continue;
    const int link = trees.joint_child[*at], parent = trees.joint_parent[*at];
    Carried& own = carried[link];
    // What a body carries can only add to its own pivot. A long chain behind it would hide it in the scale.
    const bool is_moved = Carried(bodies[link]).resists(joint) || own.resists(joint);
    if (!is_moved) unmoved.push_back({link, reason(own, bodies[link], joint)});
    Carried& base = carried[trees.carrier[parent]];
    if (base.is_whole) continue;  // no motion of it is free, whatever it carries
    const Matrix6 to_child =
        motion_transform(trees.in_carrier[parent] * Isometry3d(joint.origin) * motion_of(model, *at));
    if (is_moved) {
      const Vector6 force = own.free * direction(joint);
      own.free -= force * force.transpose() / own.pivot_for(joint);
    }
    base.free += to_child.transpose() * own.free * to_child;
    base.scale += to_child.transpose() * own.scale * to_child;
  }
  for (int tree = 0; tree < trees.count(); ++tree)
    if (const int root = trees.root_link[tree]; trees.roots[tree].floating && !carried[root].resists_all())
      unmoved.push_back({root, Unmoved::root});
  std::sort(unmoved.begin(), unmoved.end(), [](const auto& a, const auto& b) { return a.link < b.link; });
  return unmoved;
}

}  // namespace lockstep
