// Which inertias are possible. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "lockstep/model.h"

namespace lockstep {

// How far an inertia may miss the rules, as a share of inertia_scale(). A negative moment could make the mass matrix
// indefinite, so only noise passes. A moment that exceeds the sum of the others does no harm, so what passes is the
// rounding of a file that prints four digits.
constexpr double inertia_noise = 1e-9;
constexpr double inertia_rounding = 1e-3;

/// Ascending, kg m^2.
inline Eigen::Vector3d principal_moments(const Inertia& inertia) {
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(inertia.about_center, Eigen::EigenvaluesOnly).eigenvalues();
}

/// m l^2, kg m^2, the measure of what is small in an inertia: l is the radius of gyration, and at least that of a ball
/// of the densest matter. It does not depend on the link's frame, and is above 0 for a point mass, too.
inline double inertia_scale(double mass, const Eigen::Vector3d& moments) {
  constexpr double densest = 2.3e4, pi = 3.14159265358979323846;  // kg/m^3, osmium
  const double radius = std::cbrt(0.75 * mass / (pi * densest));
  return 0.5 * moments.cwiseAbs().sum() + 0.6 * mass * radius * radius;
}

/// By how much the largest moment exceeds the sum of the others, kg m^2; below 0 if it does not.
inline double triangle_excess(const Eigen::Vector3d& moments) { return moments[2] - moments[1] - moments[0]; }

/// The nearest triple for which none exceeds the sum of the others, so that none is negative. `moments` ascend.
inline Eigen::Vector3d nearest_possible(const Eigen::Vector3d& moments) {
  const double third = triangle_excess(moments) / 3.0;
  if (third <= 0.0) return moments;
  Eigen::Vector3d in_plane = moments + Eigen::Vector3d(third, third, -third);
  if (in_plane[0] >= 0.0) return in_plane;
  const double others = std::max(0.0, 0.5 * (moments[1] + moments[2]));
  return {0.0, others, others};
}

enum class InertiaFault { none, asymmetric, negative, triangle };

/// The first rule that the inertia breaks.
inline InertiaFault fault_of(const Inertia& inertia) {
  const Eigen::Vector3d moments = principal_moments(inertia);
  const double scale = inertia_scale(inertia.mass, moments);
  const Eigen::Matrix3d& tensor = inertia.about_center;
  if ((tensor - tensor.transpose()).cwiseAbs().maxCoeff() > inertia_rounding * scale) return InertiaFault::asymmetric;
  if (moments[0] < -inertia_noise * scale) return InertiaFault::negative;
  if (triangle_excess(moments) > inertia_rounding * scale) return InertiaFault::triangle;
  return InertiaFault::none;
}

}  // namespace lockstep
