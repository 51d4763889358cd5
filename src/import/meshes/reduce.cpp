// SPDX-License-Identifier: Apache-2.0
#include "reduce.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

namespace lockstep::importer {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

Vector3d corner(const Hull& hull, int number) { return hull.corners.col(number); }

// The farthest of the points from all planes of faces that it lies outside of.
Eigen::Index farthest_outside(const Hull& hull, const Matrix3Xd& points, double& distance) {
  Eigen::RowVectorXd highest = Eigen::RowVectorXd::Constant(points.cols(), -std::numeric_limits<double>::infinity());
  for (const HullFace& face : hull.faces) {
    const double plane = face.normal.dot(corner(hull, face.corners[0]));
    highest = highest.cwiseMax((face.normal.transpose() * points).array().matrix() -
                               Eigen::RowVectorXd::Constant(points.cols(), plane));
  }
  Eigen::Index farthest = 0;
  distance = highest.maxCoeff(&farthest);
  return farthest;
}

double distance_to_segment(const Vector3d& a, const Vector3d& b, const Vector3d& point) {
  const Vector3d along = b - a;
  const double share = std::clamp(along.dot(point - a) / along.squaredNorm(), 0.0, 1.0);
  return (point - a - share * along).norm();
}

// The point lies `height` above the face's plane.
double distance_to_face(const Hull& hull, const HullFace& face, double height, const Vector3d& point) {
  bool is_above = true;
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < face.corners.size(); ++i) {
    const Vector3d a = corner(hull, face.corners[i]), b = corner(hull, face.corners[(i + 1) % face.corners.size()]);
    is_above = is_above && face.normal.cross(b - a).dot(point - a) >= 0.0;
    nearest = std::min(nearest, distance_to_segment(a, b, point));
  }
  return is_above ? height : nearest;
}

}  // namespace

Hull reduced(const Hull& whole, int most_corners) {
  if (whole.corners.cols() <= most_corners) return whole;
  const auto apart = points_apart(whole.corners);
  std::vector<Eigen::Index> kept(apart.begin(), apart.end());
  for (;;) {
    Hull hull = hull_of(whole.corners(Eigen::all, kept));
    double distance = 0.0;
    const Eigen::Index next = farthest_outside(hull, whole.corners, distance);
    if (static_cast<int>(kept.size()) == most_corners || !(distance > 0.0) ||
        std::find(kept.begin(), kept.end(), next) != kept.end())
      return hull;
    kept.push_back(next);
  }
}

double distance_outside(const Hull& hull, const Vector3d& point) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const HullFace& face : hull.faces) {
    const double height = face.normal.dot(point - corner(hull, face.corners[0]));
    if (height > 0.0) nearest = std::min(nearest, distance_to_face(hull, face, height, point));
  }
  return std::isfinite(nearest) ? nearest : 0.0;
}

}  // namespace lockstep::importer
