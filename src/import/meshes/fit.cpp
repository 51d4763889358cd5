// SPDX-License-Identifier: Apache-2.0
#include "fit.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "model/shapes.h"
#include "reduce.h"

namespace lockstep::importer {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;

Fitted as_hull(const Hull& whole, int most_corners) {
  const Hull hull = reduced(whole, most_corners);
  const Vector3d center = solid_of(hull).center;
  Fitted fitted{.shape = Shape::hull(hull.corners.colwise() - center)};
  fitted.pose.translation() = center;
  fitted.corners = static_cast<int>(hull.corners.cols());
  if (hull.corners.cols() < whole.corners.cols())
    for (const auto& corner : whole.corners.colwise())
      fitted.inside = std::max(fitted.inside, distance_outside(hull, corner));
  return fitted;
}

// Axes of the frame, along which the corners are told.
struct Frame {
  Matrix3d axes;
  Matrix3Xd corners;
  Vector3d middle;  // of the extents

  Frame(const Hull& hull, const Matrix3d& along) : axes(along), corners(along.transpose() * hull.corners) {
    middle = 0.5 * (corners.rowwise().minCoeff() + corners.rowwise().maxCoeff());
    corners.colwise() -= middle;
  }
  Fitted with(const Shape& shape) const {
    Fitted fitted{.shape = shape};
    fitted.pose.linear() = axes;
    fitted.pose.translation() = axes * middle;
    return fitted;
  }
};

Fitted as_box(const Frame& frame) {
  return frame.with(Shape::box(2.0 * frame.corners.cwiseAbs().rowwise().maxCoeff()));
}

// Around the z axis of the frame.
Fitted as_capsule(const Frame& frame) {
  const Eigen::RowVectorXd out = frame.corners.topRows(2).colwise().norm();
  const double radius = out.maxCoeff();
  const Eigen::RowVectorXd cap = (radius * radius - out.array().square()).max(0.0).sqrt();
  const double half = (frame.corners.row(2).cwiseAbs() - cap).maxCoeff();
  return frame.with(half > 0.0 ? Shape::capsule(radius, 2.0 * half) : Shape::sphere(radius));
}

}  // namespace

Fitted fitted(const Hull& hull, Fit fit, int most_corners) {
  if (fit == Fit::hull) return as_hull(hull, most_corners);
  Matrix3d axes = Eigen::SelfAdjointEigenSolver<Matrix3d>(solid_of(hull).about_center).eigenvectors();
  if (axes.determinant() < 0.0) axes.col(0) = -axes.col(0);
  if (fit == Fit::box) return as_box(Frame(hull, axes));
  std::vector<Fitted> capsules;
  for (int i = 0; i < 3; ++i) {
    Matrix3d turned;
    turned << axes.col((i + 1) % 3), axes.col((i + 2) % 3), axes.col(i);
    capsules.push_back(as_capsule(Frame(hull, turned)));
  }
  return *std::min_element(capsules.begin(), capsules.end(), [](const Fitted& a, const Fitted& b) {
    return solid_of(a.shape).mass < solid_of(b.shape).mass;
  });
}

}  // namespace lockstep::importer
