// SPDX-License-Identifier: Apache-2.0
#include "shapes.h"

#include <algorithm>
#include <stdexcept>

#include "hull.h"

namespace lockstep {
namespace {

constexpr double pi = 3.14159265358979323846;

// About the centre, of density 1, round about z.
Inertia round(double volume, double about_x, double about_z) {
  return {volume, Eigen::Vector3d::Zero(), Eigen::Vector3d(about_x, about_x, about_z).asDiagonal()};
}

Inertia solid_cylinder(double r, double h) {
  const double m = pi * r * r * h;
  return round(m, m * (3.0 * r * r + h * h) / 12.0, m * r * r / 2.0);
}

// A cylinder of length h between two halves of a ball. A half's centre of mass lies 3/8 r above its flat side.
Inertia solid_capsule(double r, double h) {
  const Inertia middle = solid_cylinder(r, h);
  const double ball = 4.0 / 3.0 * pi * r * r * r, about_z = 0.4 * ball * r * r;
  const double about_x = about_z + ball * (h * h / 4.0 + 3.0 / 8.0 * h * r);
  return round(middle.mass + ball, middle.about_center(0, 0) + about_x, middle.about_center(2, 2) + about_z);
}

Inertia solid_ellipsoid(const Eigen::Vector3d& semi_axes) {
  const double m = 4.0 / 3.0 * pi * semi_axes.prod();
  const Eigen::Vector3d s = semi_axes.cwiseAbs2();
  return {m, Eigen::Vector3d::Zero(),
          (m / 5.0 * Eigen::Vector3d(s.y() + s.z(), s.x() + s.z(), s.x() + s.y())).asDiagonal()};
}

Inertia solid_box(const Eigen::Vector3d& edges) { return Inertia::box(edges.prod(), edges, Eigen::Vector3d::Zero()); }

constexpr ShapeRule rules[] = {
    {ShapeKind::half_space, "half_space", 0, [](const Shape&) { return Inertia(); }},
    {ShapeKind::height_field, "height_field", 2, [](const Shape&) { return Inertia(); }},
    {ShapeKind::box, "box", 3, [](const Shape& s) { return solid_box(s.size); }},
    {ShapeKind::hull, "hull", 1, [](const Shape& s) { return solid_of(hull_of(s.points)); }},
    {ShapeKind::cylinder, "cylinder", 2, [](const Shape& s) { return solid_cylinder(s.size[0], s.size[1]); }},
    {ShapeKind::capsule, "capsule", 2, [](const Shape& s) { return solid_capsule(s.size[0], s.size[1]); }},
    {ShapeKind::ellipsoid, "ellipsoid", 3, [](const Shape& s) { return solid_ellipsoid(s.size); }},
    {ShapeKind::sphere, "sphere", 1, [](const Shape& s) { return solid_capsule(s.size[0], 0.0); }},
};

}  // namespace

const ShapeRule& rule_of(ShapeKind kind) {
  const auto* found =
      std::find_if(std::begin(rules), std::end(rules), [&](const ShapeRule& r) { return r.kind == kind; });
  if (found == std::end(rules)) throw std::out_of_range("no kind of shape");
  return *found;
}

const char* to_string(ShapeKind kind) noexcept {
  for (const ShapeRule& rule : rules)
    if (rule.kind == kind) return rule.name;
  return "unknown";
}

}  // namespace lockstep
