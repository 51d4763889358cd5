// Joints that move no inertia. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "trees.h"

namespace lockstep {

/// Why the mass matrix is not positive definite.
enum class Unmoved {
  nothing,  ///< the joint moves no mass, no inertia and no armature
  axis,     ///< the joint moves a body along or about an axis for which it has no inertia
  shared,   ///< what the joint moves, the joints behind it move just so
  root,     ///< a floating root, for which one of these holds
};

struct UnmovedLink {
  int link;
  Unmoved why;
};

/// The links whose joints keep the mass matrix from being positive definite at the model's start
/// (docs/mathematics.md, section 4), in the order of Model::links. `bodies` are rigid_bodies(). Empty if and only if
/// the matrix is positive definite, up to rounding.
std::vector<UnmovedLink> unmoved_links(const Model& model, const Trees& trees, const std::vector<Inertia>& bodies);

}  // namespace lockstep
