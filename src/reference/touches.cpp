// SPDX-License-Identifier: Apache-2.0
#include "touches.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "model/hull.h"

namespace lockstep::reference {
namespace {

using Eigen::Vector3d;

using Points = std::vector<Vector3d>;

// The lower face along the axis that is nearest to the normal. All in the solid's own frame, here and below.
Points lower_face(const Vector3d& size, const Vector3d& normal) {
  Points points;
  int k = 0;
  normal.cwiseAbs().maxCoeff(&k);
  for (const int i : {-1, 1})
    for (const int j : {-1, 1}) {
      Vector3d corner;
      corner[k] = normal[k] > 0 ? -0.5 : 0.5, corner[(k + 1) % 3] = 0.5 * i, corner[(k + 2) % 3] = 0.5 * j;
      points.push_back(corner.cwiseProduct(size));
    }
  return points;
}

// Four points of the lower rim, the first of them the lowest, or the ends of the lowest line. One that is upright to
// 0.05 keeps its points by a little of its own x.
Points lower_rim(double radius, double length, const Vector3d& normal) {
  const double tilt = std::hypot(normal.x(), normal.y());
  const double angle = std::atan2(-normal.y(), -normal.x() + 1e-3 * std::max(0.0, 1.0 - 20.0 * tilt));
  const auto at = [&](double turn, double z) {
    return Vector3d(radius * std::cos(angle + turn), radius * std::sin(angle + turn), z);
  };
  if (std::abs(normal.z()) <= std::sqrt(0.5)) return {at(0.0, 0.5 * length), at(0.0, -0.5 * length)};
  const double z = normal.z() > 0.0 ? -0.5 * length : 0.5 * length, quarter = std::acos(0.0);
  return {at(0.0, z), at(quarter, z), at(2 * quarter, z), at(3 * quarter, z)};
}

// The lowest corners along four directions that lean by 0.03, each once.
Points lower_corners(const Eigen::Matrix3Xd& points, const Vector3d& normal, const Vector3d& t, const Vector3d& u) {
  Points found;
  for (const double up : {-0.0306, 0.0306})
    for (const double right : {-0.03, 0.03}) {
      Eigen::Index lowest = 0;
      ((normal - right * t - up * u).transpose() * points).minCoeff(&lowest);
      if (std::find(found.begin(), found.end(), points.col(lowest)) == found.end()) found.push_back(points.col(lowest));
    }
  return found;
}

// Centres of balls on a plane through the origin of `frame`, in the body's own frame.
struct Standing {
  Points centers;
  double radius = 0.0;
};

Standing standing_on(const Eigen::Matrix3d& frame, const Solid& body) {
  const Vector3d n = frame.col(2), size = body.collider->shape.size;
  const auto seen = [&](const Vector3d& v) { return Vector3d(body.pose.linear().transpose() * v); };
  Standing standing;
  Points& centers = standing.centers;
  double& radius = standing.radius;
  switch (body.collider->shape.kind) {
    case ShapeKind::sphere: centers = {Vector3d::Zero()}, radius = size[0]; break;
    case ShapeKind::capsule:
      centers = {Vector3d(0, 0, -0.5 * size[1]), Vector3d(0, 0, 0.5 * size[1])}, radius = size[0];
      break;
    case ShapeKind::box: centers = lower_face(size, seen(n)); break;
    case ShapeKind::cylinder: centers = lower_rim(size[0], size[1], seen(n)); break;
    case ShapeKind::ellipsoid: {  // where the gradient of sum (x / s)^2 is along -n
      const Vector3d scaled = size.cwiseProduct(seen(n));
      centers = {-size.cwiseProduct(scaled) / scaled.norm()};
      break;
    }
    case ShapeKind::hull:
      centers = lower_corners(body.collider->shape.points, seen(n), seen(frame.col(0)), seen(frame.col(1)));
      radius = size[0];
      break;
    case ShapeKind::half_space:
    case ShapeKind::height_field: throw std::logic_error("two grounds");
  }
  return standing;
}

// Of the volume, in the shape's frame.
Vector3d middle_of(const Shape& shape) {
  return shape.kind == ShapeKind::hull ? Vector3d(solid_of(hull_of(shape.points)).center) : Vector3d::Zero();
}

// Of a ball about its middle that holds it.
double reach_of(const Shape& shape) {
  const Vector3d& size = shape.size;
  switch (shape.kind) {
    case ShapeKind::box: return 0.5 * size.norm();
    case ShapeKind::ellipsoid: return size.maxCoeff();
    case ShapeKind::cylinder: return std::hypot(size[0], 0.5 * size[1]);
    case ShapeKind::capsule: return size[0] + 0.5 * size[1];
    case ShapeKind::hull: return (shape.points.colwise() - middle_of(shape)).colwise().norm().maxCoeff() + size[0];
    default: return size[0];
  }
}

std::vector<Touch> on_plane(const Solid& plane, const Solid& body) {
  const Vector3d n = plane.pose.linear().col(2);
  const auto [centers, radius] = standing_on(plane.pose.linear(), body);
  std::vector<Touch> touches;
  for (const Vector3d& own : centers) {
    const Vector3d center = body.pose * own;
    const double gap = n.dot(center - plane.pose.translation()) - radius;
    touches.push_back({center - n * (radius + 0.5 * gap), n, gap});
  }
  return touches;
}

// A triangle of a height field, to the left as seen from above.
struct Triangle {
  Vector3d a, b, c;
  Vector3d normal() const { return (b - a).cross(c - a).normalized(); }
};

std::vector<Triangle> triangles_of(const Shape& field) {
  const Eigen::MatrixXd& heights = field.heights;
  const auto at = [&](Eigen::Index row, Eigen::Index column) {
    const auto share = [](Eigen::Index i, Eigen::Index count) { return double(i) / double(count - 1) - 0.5; };
    return Vector3d(field.size[0] * share(column, heights.cols()), field.size[1] * share(row, heights.rows()),
                    heights(row, column));
  };
  std::vector<Triangle> all;
  for (Eigen::Index j = 0; j + 1 < heights.rows(); ++j)
    for (Eigen::Index i = 0; i + 1 < heights.cols(); ++i) {
      all.push_back({at(j, i), at(j, i + 1), at(j + 1, i + 1)});
      all.push_back({at(j, i), at(j + 1, i + 1), at(j + 1, i)});
    }
  return all;
}

// Whether the vertical line through p meets it.
bool is_below(const Triangle& t, const Vector3d& p) {
  Eigen::Matrix3d barycentric;
  barycentric << t.a.head<2>(), t.b.head<2>(), t.c.head<2>(), 1.0, 1.0, 1.0;
  return barycentric.fullPivLu().solve(Vector3d(p.x(), p.y(), 1.0)).minCoeff() >= -1e-12;
}

// Each point by the plane of the triangle below it. A body of one lasting slope touches it so.
std::vector<Touch> on_field(const Solid& ground, const Solid& body) {
  const std::vector<Triangle> triangles = triangles_of(ground.collider->shape);
  const auto below = [&](const Vector3d& p) {
    const auto found =
        std::find_if(triangles.begin(), triangles.end(), [&](const Triangle& t) { return is_below(t, p); });
    if (found == triangles.end()) throw std::logic_error("a point beyond the edges has no reference");
    return *found;
  };
  // The slopes between heights at 0.7 of the reach on all four sides.
  const Vector3d center = ground.pose.inverse() * (body.pose * middle_of(body.collider->shape));
  const auto height = [&](double x, double y) {
    const Vector3d p = center + Vector3d(x, y, 0.0);
    const Triangle triangle = below(p);
    const Vector3d n = triangle.normal();
    return triangle.a.z() - n.head<2>().dot((p - triangle.a).head<2>()) / n.z();
  };
  const double way = 0.7 * reach_of(body.collider->shape);
  const Vector3d along(2 * way, 0, height(way, 0) - height(-way, 0)),
      across(0, 2 * way, height(0, way) - height(0, -way));
  Eigen::Matrix3d frame;
  frame.col(2) = along.cross(across).normalized(), frame.col(0) = along.normalized();
  frame.col(1) = frame.col(2).cross(frame.col(0));
  const auto [centers, radius] = standing_on(ground.pose.linear() * frame, body);
  std::vector<Touch> touches;
  for (const Vector3d& own : centers) {
    const Vector3d p = ground.pose.inverse() * (body.pose * own);
    const Triangle triangle = below(p);
    const Vector3d n = triangle.normal();
    const double gap = n.dot(p - triangle.a) - radius;
    touches.push_back({ground.pose * Vector3d(p - n * (radius + 0.5 * gap)), ground.pose.linear() * n, gap});
  }
  return touches;
}

Vector3d nearest_on_segment(const Vector3d& p, const Vector3d& from, const Vector3d& to) {
  const Vector3d along = to - from;
  return from + std::clamp((p - from).dot(along) / along.squaredNorm(), 0.0, 1.0) * along;
}

// Of the faces' planes where p is over the face, and of their edges.
Vector3d nearest_on_hull(const Vector3d& p, const Eigen::Matrix3Xd& points) {
  const Hull hull = hull_of(points);
  Vector3d best = Vector3d::Constant(std::numeric_limits<double>::infinity());
  const auto consider = [&](const Vector3d& q) {
    if ((q - p).squaredNorm() < (best - p).squaredNorm()) best = q;
  };
  for (const HullFace& face : hull.faces) {
    bool over = true;
    for (std::size_t i = 0; i < face.corners.size(); ++i) {
      const Vector3d from = hull.corners.col(face.corners[i]),
                     to = hull.corners.col(face.corners[(i + 1) % face.corners.size()]);
      over = over && face.normal.cross(to - from).dot(p - from) > 0.0;
      consider(nearest_on_segment(p, from, to));
    }
    if (over) consider(p - face.normal.dot(p - hull.corners.col(face.corners[0])) * face.normal);
  }
  return best;
}

// q = S^2 p / (S^2 + t), t >= 0 where q is on the surface.
Vector3d nearest_on_ellipsoid(const Vector3d& p, const Vector3d& semi_axes) {
  const auto at = [&](double t) {
    const Eigen::Array3d squared = semi_axes.array().square();
    return Vector3d((squared * p.array() / (squared + t)).matrix());
  };
  double low = 0.0, high = semi_axes.maxCoeff() * p.norm();
  for (int i = 0; i < 200; ++i) {
    const double middle = 0.5 * (low + high);
    (at(middle).cwiseQuotient(semi_axes).norm() > 1.0 ? low : high) = middle;
  }
  return at(high);
}

// Of a solid without its radius, from outside.
Vector3d nearest_on(const Shape& shape, const Vector3d& p) {
  const Vector3d& size = shape.size;
  switch (shape.kind) {
    case ShapeKind::sphere: return Vector3d::Zero();
    case ShapeKind::capsule: return {0.0, 0.0, std::clamp(p.z(), -0.5 * size[1], 0.5 * size[1])};
    case ShapeKind::box: return p.cwiseMax(-0.5 * size).cwiseMin(0.5 * size);
    case ShapeKind::cylinder: {
      const double across = std::hypot(p.x(), p.y()), share = across > size[0] ? size[0] / across : 1.0;
      return {share * p.x(), share * p.y(), std::clamp(p.z(), -0.5 * size[1], 0.5 * size[1])};
    }
    case ShapeKind::ellipsoid: return nearest_on_ellipsoid(p, size);
    case ShapeKind::hull: return nearest_on_hull(p, shape.points);
    case ShapeKind::half_space:
    case ShapeKind::height_field: break;
  }
  throw std::logic_error("a half-space has no nearest point here");
}

double radius_of(const Shape& shape) {
  const bool has = shape.kind == ShapeKind::sphere || shape.kind == ShapeKind::capsule || shape.kind == ShapeKind::hull;
  return has ? shape.size[0] : 0.0;
}

}  // namespace

std::vector<Touch> touches_of(const Solid& a, const Solid& b) {
  const Shape &first = a.collider->shape, &second = b.collider->shape;
  if (first.kind == ShapeKind::half_space) return on_plane(a, b);
  if (first.kind == ShapeKind::height_field) return on_field(a, b);
  if (second.kind != ShapeKind::sphere) throw std::logic_error("this pair of shapes has no reference");
  const Vector3d center = b.pose.translation(), nearest = a.pose * nearest_on(first, a.pose.inverse() * center);
  const Vector3d n = (center - nearest).normalized();
  const double radius = radius_of(first), gap = (center - nearest).norm() - radius - second.size[0];
  return {{nearest + n * (radius + 0.5 * gap), n, gap}};
}

}  // namespace lockstep::reference
