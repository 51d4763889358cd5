// SPDX-License-Identifier: Apache-2.0
#include "solids.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace lockstep::view {
namespace {

constexpr double water = 1000.0;      // kg/m^3
constexpr double least_share = 0.01;  // of the longest edge
constexpr double same_moment = 1e-3;

std::vector<Solid> colliders_of(const Model& model, const std::string& link) {
  std::vector<Solid> solids;
  for (const Collider& collider : model.colliders)
    if (collider.link == link) solids.push_back({collider.shape, collider.pose});
  return solids;
}

// The axis of the one moment that differs from the two others, which agree; -1 where there is none.
int axis_of_symmetry(const Eigen::Vector3d& moments) {
  const auto agree = [&](int a, int b) {
    return std::abs(moments[a] - moments[b]) <= same_moment * moments.maxCoeff();
  };
  for (int axis = 0; axis < 3; ++axis) {
    const int a = (axis + 1) % 3, b = (axis + 2) % 3;
    if (agree(a, b) && !agree(axis, a) && !agree(axis, b)) return axis;
  }
  return -1;
}

// The joint that carries the link, or none for a root.
const Joint* carrier(const Model& model, const std::string& link) {
  for (const Joint& joint : model.joints)
    if (joint.child == link) return &joint;
  return nullptr;
}

Role role_of(const Plan& plan, const std::string& link) {
  const Joint* joint = carrier(plan.model(), link);
  if (!joint) {
    const std::vector<std::string>& floating = plan.root_names();
    return std::find(floating.begin(), floating.end(), link) == floating.end() ? Role::base : Role::free;
  }
  if (!joint->moves()) return role_of(plan, joint->parent);
  const std::vector<int>& followers = plan.follower_dofs();
  const bool follows = std::find(followers.begin(), followers.end(), plan.dof(joint->name)) != followers.end();
  return follows ? Role::follower : Role::driver;
}

}  // namespace

std::optional<Solid> solid_of(const Inertia& inertia) {
  if (!(inertia.mass > 0.0)) return std::nullopt;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(inertia.about_center);
  const Eigen::Vector3d moments = solver.eigenvalues().cwiseMax(0.0) / inertia.mass;  // m^2
  Eigen::Matrix3d axes = solver.eigenvectors();
  if (axes.determinant() < 0.0) axes.col(0) = -axes.col(0);
  Solid solid{.shape = {}, .pose = Pose::Identity(), .from_inertia = true};
  solid.pose.translation() = inertia.center;
  if (moments.maxCoeff() == 0.0) {
    solid.shape = Shape::sphere(std::cbrt(0.75 * inertia.mass / (std::numbers::pi * water)));
    return solid;
  }
  if (const int axis = axis_of_symmetry(moments); axis >= 0) {
    const double radius = std::sqrt(2.0 * moments[axis]);
    const double length = std::sqrt(std::max(0.0, 12.0 * moments[(axis + 1) % 3] - 3.0 * radius * radius));
    const double least = least_share * std::max(radius, length);
    solid.shape = Shape::cylinder(std::max(radius, least), std::max(length, least));
    solid.pose.linear() << axes.col((axis + 1) % 3), axes.col((axis + 2) % 3), axes.col(axis);
    return solid;
  }
  const Eigen::Vector3d squares = 6.0 * (Eigen::Vector3d::Constant(moments.sum()) - 2.0 * moments);
  const Eigen::Vector3d edges = squares.cwiseMax(0.0).cwiseSqrt();
  solid.shape = Shape::box(edges.cwiseMax(least_share * edges.maxCoeff()));
  solid.pose.linear() = axes;
  return solid;
}

Solid made_small(Solid solid, double mass) {
  Eigen::Vector3d& size = solid.shape.size;
  const bool is_cylinder = solid.shape.kind == ShapeKind::cylinder;  // its radius, then its length
  const double longest = is_cylinder ? std::max(2.0 * size[0], size[1]) : size.maxCoeff();
  size *= std::min(1.0, 2.0 * std::cbrt(mass / water) / longest);
  return solid;
}

const char* to_string(Role role) noexcept {
  switch (role) {
    case Role::base: return "base";
    case Role::driver: return "driver";
    case Role::follower: return "follower";
    case Role::free: break;
  }
  return "free";
}

std::vector<DrawnLink> drawn_links(const Plan& plan, const std::vector<VisualMesh>& meshes) {
  const Model& model = plan.model();
  std::vector<DrawnLink> links;
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    const Link& link = model.links[i];
    DrawnLink drawn{.link = static_cast<int>(i), .role = role_of(plan, link.name), .meshes = {}, .solids = {}};
    for (const VisualMesh& mesh : meshes)
      if (mesh.link == link.name) drawn.meshes.push_back(mesh);
    if (drawn.meshes.empty()) drawn.solids = colliders_of(model, link.name);
    if (drawn.meshes.empty() && drawn.solids.empty())
      if (std::optional<Solid> solid = solid_of(link.inertia))
        drawn.solids.push_back(made_small(*std::move(solid), link.inertia.mass));
    if (!drawn.meshes.empty() || !drawn.solids.empty()) links.push_back(std::move(drawn));
  }
  return links;
}

std::vector<Solid> world_solids(const Model& model) { return colliders_of(model, ""); }

}  // namespace lockstep::view
