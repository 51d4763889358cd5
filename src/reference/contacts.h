// One step with contacts, by the dual of the convex problem. SPDX-License-Identifier: Apache-2.0
//
// The kernels minimise over velocities by Newton's method. This looks for the impulses instead: in the product of
// friction cones K they minimise 1/2 L^T (J A^-1 J^T + R) L + L^T (J v* + b'), by an accelerated projected gradient. It
// has its own shapes, its own Jacobians, each body's at the point of its own surface, and no reduced velocities.
// Contacts are new: there is no memory. Where a pair resists turning, the cone has six dimensions: moments over the
// lengths at which they are worth a force.
#pragma once

#include "step.h"

namespace lockstep::reference {

struct ContactPoint {
  Eigen::Matrix3d frame;     ///< rows: normal from the first collider to the second, two tangents
  Eigen::MatrixXd jacobian;  ///< [3][velocities], along the frame; [6] with rotations times their lengths behind
  double gap, friction, compliance;
  double along_surface;  ///< compliance of all rows but the normal
  double target;         ///< b, without the slip term
  double restored;       ///< share of the impulse that stops it that comes back; 0 also where it does not bounce
  double landing;        ///< share of a leapfrog step before it, above 1 where it does not bounce in the step
  bool bounces, soft;
};

struct ContactStep {
  Eigen::VectorXd velocity;  ///< that moves the positions, along the axes of the start
  Eigen::VectorXd stays;     ///< that the next step starts from, along the same axes
  std::vector<ContactPoint> points;
  std::vector<Eigen::VectorXd> impulses;  ///< of the positions' solve, along the rows of the Jacobian
  std::vector<Eigen::VectorXd> last;      ///< of the last solve
};

/// The first step from a state in which hard couplings hold. Bounds, soft couplings, force limits and limited servos
/// take part; with any of these `stays` is the velocity that moves the positions. Normals allow for the slip of the
/// start. Pairs: half-spaces with boxes, capsules and spheres, spheres with spheres and boxes. Half-spaces stand still.
/// Throws std::logic_error for others, and for two hard couplings of one first joint.
ContactStep contact_step(const Mechanism& mechanism, const StepSettings& settings, const State& state,
                         const Inputs& inputs);

struct MiddleStep {
  State middle;  ///< of the step, where contacts are found
  ContactStep contacts;
  State end = {};
  bool presses = false;  ///< some contact has an impulse; otherwise the step is that without contacts
};

/// One leapfrog step with contacts, from a state in which hard couplings hold. There may be no bounds, soft couplings
/// and limited servos. Pairs are those of contact_step().
MiddleStep middle_step(const Mechanism& mechanism, const StepSettings& settings, const State& start,
                       const Inputs& inputs);

}  // namespace lockstep::reference
