// What a distribution of mass can be. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Eigenvalues>

#include "lockstep/model.h"

namespace lockstep {

/// Real files round their tensors: how far, relative to the largest moment, an inertia may miss the rules.
constexpr double inertia_slack = 1e-6;

/// Ascending, kg m^2.
inline Eigen::Vector3d principal_moments(const Inertia& inertia) {
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(inertia.about_center, Eigen::EigenvaluesOnly).eigenvalues();
}

/// What every body's are: none is negative, and none exceeds the sum of the others.
inline bool are_not_negative(const Eigen::Vector3d& moments) {
  return moments[0] >= -inertia_slack * moments.cwiseAbs().maxCoeff();
}
inline bool keep_triangle_rule(const Eigen::Vector3d& moments) {
  return moments[0] + moments[1] >= moments[2] * (1.0 - inertia_slack);
}

}  // namespace lockstep
