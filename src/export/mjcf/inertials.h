// Inertias that MuJoCo takes. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "export/export.h"
#include "model/trees.h"

namespace lockstep::exporter::mjcf {

/// As <inertial> has it: moments about principal axes, whose turn is that of a right-handed frame.
struct Inertial {
  double mass = 0.0;
  Eigen::Vector3d center = Eigen::Vector3d::Zero(), moments = Eigen::Vector3d::Zero();
  Eigen::Quaterniond axes = Eigen::Quaterniond::Identity();
  double gravity = 1.0;  ///< share of the model's

  bool is_none() const { return mass == 0.0 && moments.isZero(0.0); }
};

/// By link. MuJoCo judges each body alone and wants moving ones to have mass and inertia, so a link may stand for those
/// that are fixed to it. Links that are `folded` have none.
std::vector<Inertial> inertials(const Model& model, const Trees& trees, const std::vector<bool>& folded,
                                Report& report);

}  // namespace lockstep::exporter::mjcf
