// Which inertias are possible. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Eigenvalues>

#include "lockstep/model.h"

namespace lockstep {

/// How far an inertia may miss the rules, relative to its largest moment: files round their tensors.
constexpr double inertia_slack = 1e-6;

/// Ascending, kg m^2.
inline Eigen::Vector3d principal_moments(const Inertia& inertia) {
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(inertia.about_center, Eigen::EigenvaluesOnly).eigenvalues();
}

/// The rules for principal moments: none is negative, and none exceeds the sum of the others.
inline bool are_not_negative(const Eigen::Vector3d& moments) {
  return moments[0] >= -inertia_slack * moments.cwiseAbs().maxCoeff();
}
inline bool keep_triangle_rule(const Eigen::Vector3d& moments) {
  return moments[0] + moments[1] >= moments[2] * (1.0 - inertia_slack);
}

}  // namespace lockstep
