// Tendons of a Model. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "configuration.h"
#include "lockstep/model.h"

namespace lockstep {

/// The tendon whose position the coupling says; null if it is no tendon's.
const Joint* tendon_of(const Coupling& coupling, const Model& model);

/// Whether the joint's soft range is a tendon's spring, which has no force within it: no bound that could be ignored.
bool has_slack_spring(const Joint& joint);

inline bool is_spatial(const Joint& joint) { return !joint.path.empty(); }

/// Throws ModelError for the first rule that the path of a spatial tendon breaks.
void proper_path(const Model& model, const Trees& trees, const Joint& tendon);

/// (M178): the length of a spatial tendon, m, with these poses of the links.
double length_of(const Model& model, const Trees& trees, const Configuration& at, const Joint& tendon);

/// (M179): how fast it changes with the joints of the model, and then, by tree, with an angular velocity and a velocity
/// of its root in the world.
Eigen::RowVectorXd length_jacobian(const Model& model, const Trees& trees, const Configuration& at,
                                   const Joint& tendon);

/// Puts the start of each tendon where its joints have it.
void place_tendons(Model& model);

}  // namespace lockstep
