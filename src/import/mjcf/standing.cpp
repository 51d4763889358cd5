// The points that a tree stands on, and its weight shared among them. SPDX-License-Identifier: Apache-2.0
#include "standing.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "model/joint_motion.h"

namespace lockstep::importer::mjcf {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double level = 0.02;              // of a tree's height: as far above its lowest point it stands
constexpr double points_of_collider = 4.0;  // that a contact has at most

// Among these are all points of the shape that touch a plane below it; `down` is a unit vector in the shape's frame.
std::vector<Vector3d> lowest_points(const Shape& shape, const Vector3d& down) {
  const Vector3d& size = shape.size;
  const Vector3d end(0.0, 0.0, 0.5 * size[1]);  // of a cylinder or capsule
  std::vector<Vector3d> points;
  switch (shape.kind) {
    case ShapeKind::half_space:
    case ShapeKind::height_field: break;
    case ShapeKind::box:
      for (int corner = 0; corner < 8; ++corner)
        points.emplace_back(0.5 *
                            size.cwiseProduct(Vector3d(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1)));
      break;
    case ShapeKind::hull:
      for (const auto& point : shape.points.colwise()) points.emplace_back(point + size[0] * down);
      break;
    case ShapeKind::cylinder: {
      Vector3d out(down.x(), down.y(), 0.0);
      out = out.norm() > 1e-6 ? Vector3d(out.normalized()) : Vector3d::UnitX();
      const Vector3d across = Vector3d::UnitZ().cross(out);
      for (const Vector3d& rim : {out, across, Vector3d(-out), Vector3d(-across)})
        points.push_back(size[0] * rim + end), points.push_back(size[0] * rim - end);
      break;
    }
    case ShapeKind::capsule: points = {size[0] * down + end, size[0] * down - end}; break;
    case ShapeKind::ellipsoid: points = {size.cwiseAbs2().cwiseProduct(down) / size.cwiseProduct(down).norm()}; break;
    case ShapeKind::sphere: points = {size[0] * down}; break;
  }
  return points;
}

struct StandingPoint {
  std::size_t collider;
  Vector3d place;
  double depth;         // along gravity
  double weight = 1.0;  // less than 1 where the collider has more points than a contact
};

class Stand {
 public:
  Stand(const Model& model, const Trees& trees)
      : model_(model), trees_(trees), down_(model.gravity.normalized()), pose_(model.links.size()) {
    for (const Collider& collider : model.colliders)
      link_.push_back(collider.link.empty() ? -1 : model.link_index(collider.link));
    for (int t = 0; t < trees.count(); ++t) pose_[trees.root_link[t]] = trees.roots[t].pose;
    for (const int j : trees.joints_depth_first) {
      const Isometry3d origin(model.joints[static_cast<std::size_t>(j)].origin);
      pose_[trees.joint_child[j]] = pose_[trees.joint_parent[j]] * origin * motion_of(model, j);
    }
  }

  // Leaves the loads of trees that have no weight or no colliders.
  void share(int tree, std::vector<double>& loads) const {
    const auto [weight, center] = weight_of(tree);
    const std::vector<StandingPoint> points = points_below(tree);
    if (!(weight > 0.0) || points.empty()) return;
    const std::vector<double> shares = shares_of(center, points);
    std::vector<double> sum(loads.size()), count(loads.size());
    double all = 0.0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      sum[points[i].collider] += weight * shares[i];
      count[points[i].collider] += points[i].weight;
      all += points[i].weight;
    }
    for (std::size_t c = 0; c < loads.size(); ++c)
      if (is_on(tree, c)) loads[c] = count[c] > 0.0 ? sum[c] / count[c] : weight / all;
  }

 private:
  bool is_on(int tree, std::size_t collider) const {
    return link_[collider] >= 0 && trees_.tree_of[link_[collider]] == tree;
  }

  std::pair<double, Vector3d> weight_of(int tree) const {
    double weight = 0.0;
    Vector3d moment = Vector3d::Zero();
    for (std::size_t l = 0; l < model_.links.size(); ++l) {
      if (trees_.tree_of[l] != tree) continue;
      const Link& link = model_.links[l];
      const double own = link.inertia.mass * link.gravity * model_.gravity.norm();
      weight += own;
      moment += own * (pose_[l] * link.inertia.center);
    }
    return {weight, moment / weight};
  }

  std::vector<StandingPoint> points_below(int tree) const {
    std::vector<StandingPoint> points;
    double lowest = -infinity, highest = infinity;
    for (std::size_t c = 0; c < model_.colliders.size(); ++c) {
      if (!is_on(tree, c)) continue;
      const Collider& collider = model_.colliders[c];
      const Isometry3d pose = pose_[link_[c]] * collider.pose;
      const Vector3d down = pose.linear().transpose() * down_;
      for (const Vector3d& point : lowest_points(collider.shape, down)) {
        points.push_back({c, pose * point, down_.dot(pose * point)});
        lowest = std::max(lowest, points.back().depth);
      }
      for (const Vector3d& point : lowest_points(collider.shape, -down))
        highest = std::min(highest, down_.dot(pose * point));
    }
    std::erase_if(points, [&](const StandingPoint& p) { return p.depth < lowest - level * (lowest - highest); });
    std::vector<int> count(model_.colliders.size(), 0);
    for (const StandingPoint& point : points) ++count[point.collider];
    for (StandingPoint& point : points)
      point.weight = std::min(1.0, points_of_collider / static_cast<double>(count[point.collider]));
    return points;
  }

  // (M166), or equal ones where springs would have to pull.
  std::vector<double> shares_of(const Vector3d& center, const std::vector<StandingPoint>& points) const {
    double all = 0.0;
    Vector3d middle = Vector3d::Zero();
    for (const StandingPoint& point : points) all += point.weight, middle += point.weight * point.place;
    middle /= all;
    const auto level_arm = [&](const Vector3d& place) {
      return Vector3d(place - middle - down_ * down_.dot(place - middle));
    };
    Matrix3d spread = Matrix3d::Zero();
    for (const StandingPoint& point : points)
      spread += point.weight * level_arm(point.place) * level_arm(point.place).transpose();
    const Vector3d lean = spread.ldlt().solve(level_arm(center));
    std::vector<double> shares;
    for (const StandingPoint& point : points)
      shares.push_back(point.weight * (1.0 / all + lean.dot(level_arm(point.place))));
    if (*std::min_element(shares.begin(), shares.end()) <= 0.0)
      for (std::size_t i = 0; i < points.size(); ++i) shares[i] = points[i].weight / all;
    return shares;
  }

  const Model& model_;
  const Trees& trees_;
  const Vector3d down_;
  std::vector<int> link_;         // by collider, -1 in the world
  std::vector<Isometry3d> pose_;  // by link
};

}  // namespace

std::vector<double> loads_at_rest(const Model& model, const Trees& trees) {
  std::vector<double> loads(model.colliders.size(), infinity);
  if (model.gravity.isZero(0.0)) return loads;
  const Stand stand(model, trees);
  for (int tree = 0; tree < trees.count(); ++tree)
    if (trees.roots[tree].floating) stand.share(tree, loads);
  return loads;
}

}  // namespace lockstep::importer::mjcf
