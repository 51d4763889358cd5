// Numbers that look as if they were in another unit. SPDX-License-Identifier: Apache-2.0
#include "units.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace lockstep::importer {
namespace {

constexpr double unlikely_radius = 20.0;  // m, of gyration; 20 mm if mm were meant

bool is_whole(double number) { return number == std::round(number); }

// Ranges in rad are seldom whole numbers, and those of several turns are seldom ranges.
bool looks_like_degrees(const Joint& joint) {
  if (joint.kind != JointKind::revolute) return false;
  const double widest = std::max(std::abs(joint.lower), std::abs(joint.upper));
  return widest >= 10.0 && widest <= 720.0 && is_whole(joint.lower) && is_whole(joint.upper);
}

// Of the body's mass about the axis of its largest moment, m.
double radius_of_gyration(const Inertia& inertia) {
  if (!(inertia.mass > 0.0)) return 0.0;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(inertia.about_center, Eigen::EigenvaluesOnly);
  return std::sqrt(principal.eigenvalues()[2] / inertia.mass);
}

}  // namespace

void report_units(const Model& model, Report& report) {
  for (const Joint& joint : model.joints)
    if (looks_like_degrees(joint))
      report.warn("ranges that look like degrees, taken in rad",
                  fmt::format("{} {:g} to {:g}", joint.name, joint.lower, joint.upper));
  for (const Link& link : model.links)
    if (const double radius = radius_of_gyration(link.inertia); radius > unlikely_radius)
      report.warn("inertias that look like kg mm^2, taken in kg m^2",
                  fmt::format("{} has a radius of gyration of {:.4g} m", link.name, radius));
}

}  // namespace lockstep::importer
