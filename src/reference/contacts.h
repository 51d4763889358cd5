// One step with contacts, by the dual of the convex problem. SPDX-License-Identifier: Apache-2.0
//
// The kernels minimise over velocities by Newton's method. This looks for the impulses instead: in the product of
// friction cones K they minimise 1/2 L^T (J A^-1 J^T + R) L + L^T (J v* + b'), by an accelerated projected gradient. It
// has its own shapes, its own Jacobians and no reduced velocities. Contacts are new: there is no memory.
#pragma once

#include "step.h"

namespace lockstep::reference {

struct ContactPoint {
  Eigen::Matrix3d frame;     ///< rows: normal from the first collider to the second, two tangents
  Eigen::MatrixXd jacobian;  ///< [3][velocities], along the frame
  double gap, friction, compliance;
  double target;  ///< b, without the slip term
};

struct ContactStep {
  Eigen::VectorXd velocity;  ///< along the axes of the start
  std::vector<ContactPoint> points;
  std::vector<Eigen::Vector3d> impulses;  ///< along the frames
};

/// The velocity that moves the positions in the first step from a state, with hard couplings that hold in it, no
/// bounds, and `passes` solves. Pairs: half-spaces with boxes, capsules and spheres, spheres with spheres and boxes.
/// Throws std::logic_error for others.
ContactStep contact_step(const Mechanism& mechanism, const StepSettings& settings, const State& state,
                         const Inputs& inputs, int passes);

}  // namespace lockstep::reference
