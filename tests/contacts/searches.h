// How far shapes are apart, by searches and samples. SPDX-License-Identifier: Apache-2.0
//
// The kernels have formulas for this. What is right must not come from formulas like them.
#pragma once

#include "patches.h"

namespace lockstep::contacts_test {

/// Where a convex function is least.
template <class Function>
double least_at(double low, double high, const Function& f) {
  for (int round = 0; round < 90; ++round) {
    const double third = (high - low) / 3.0;
    if (f(low + third) < f(high - third))
      high -= third;
    else
      low += third;
  }
  return 0.5 * (low + high);
}

/// Distance of a point from the centre of a sphere, the axis of a capsule, or a box; 0 inside a box.
inline double distance_from_core(const Shape& shape, const Vector3d& p) {
  if (shape.form == Form::sphere) return (p - shape.center).norm();
  const auto at = [&](const Vector3d& coordinates) { return (p - shape.world(coordinates)).norm(); };
  Vector3d nearest = Vector3d::Zero();
  for (int k = 0; k < 3; ++k) {  // its coordinates are at right angles, so each can be searched by itself
    const double reach = shape.form == Form::box ? shape.size[k] : k == 2 ? shape.size[1] : 0.0;
    if (reach == 0.0) continue;
    nearest[k] = least_at(-reach, reach, [&](double x) {
      Vector3d there = nearest;
      there[k] = x;
      return at(there);
    });
  }
  return at(nearest);
}

inline std::vector<Vector3d> corners(const Shape& box) {
  std::vector<Vector3d> found;
  for (int c = 0; c < 8; ++c)
    found.push_back(box.world(Vector3d(c & 1 ? 1 : -1, c & 2 ? 1 : -1, c & 4 ? 1 : -1).cwiseProduct(box.size)));
  return found;
}

/// How far two shapes are apart. Not for two boxes.
inline double separation(const Shape& first, const Shape& second) {
  std::vector<Vector3d> points{second.center};
  if (second.form == Form::box) points = corners(second);
  if (second.form == Form::capsule) {
    const auto on_axis = [&](double t) { return Vector3d(second.center + t * second.axis(2)); };
    points = {on_axis(-second.size[1]), on_axis(second.size[1])};
    if (first.form != Form::half_space)
      points = {on_axis(
          least_at(-second.size[1], second.size[1], [&](double t) { return distance_from_core(first, on_axis(t)); }))};
  }
  double least = INFINITY;
  for (const Vector3d& p : points)
    least = std::min(least, first.form == Form::half_space ? first.local(p).z() : distance_from_core(first, p));
  return least - first.radius() - second.radius();
}

/// The first and the last t within [-reach, reach] for which it is true, as Vector2d.
template <class Condition>
Vector2d part_where(double reach, const Condition& is_true) {
  constexpr int samples = 1000;
  Vector2d ends(INFINITY, -INFINITY);
  for (int n = 0; n <= samples; ++n) {
    const double t = reach * (2.0 * n / samples - 1.0);
    if (is_true(t)) ends = {std::min(ends[0], t), std::max(ends[1], t)};
  }
  for (int end = 0; end < 2; ++end) {  // between the last sample that is true and the next one
    double inside = ends[end], outside = ends[end] + (end == 0 ? -2.0 : 2.0) * reach / samples;
    if (std::abs(outside) > reach) outside = end == 0 ? -reach : reach;
    for (int round = 0; round < 50; ++round) {
      const double middle = 0.5 * (inside + outside);
      (is_true(middle) ? inside : outside) = middle;
    }
    ends[end] = inside;
  }
  return ends;
}

}  // namespace lockstep::contacts_test
