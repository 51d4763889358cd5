// What links look like: visual meshes, colliders, or a solid of the same inertia. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "lockstep/import.h"
#include "lockstep/plan.h"

namespace lockstep::view {

/// A solid to draw, in a link's frame or in the world's.
struct Solid {
  Shape shape;
  Pose pose;
  bool from_inertia = false;
};

/// The solid of uniform density whose mass and inertia these are: a cylinder where two principal moments agree to a
/// thousandth and the third does not, else a box. A point mass is a ball of the density of water. Edges thinner than a
/// hundredth of the longest are drawn that thick. Empty without mass.
std::optional<Solid> solid_of(const Inertia& inertia);

/// No longer than twice the edge of a cube of water of this mass: inertias of robot files are often those of solids
/// that would hide the robot.
Solid made_small(Solid solid, double mass);

/// What moves a link, for its colour.
enum class Role { base, driver, follower, free };

/// The enumerator's name. The string lives forever.
const char* to_string(Role role) noexcept;

struct DrawnLink {
  int link;  ///< in Model::links
  Role role;
  std::vector<VisualMesh> meshes;  ///< where there are some, it has no solids
  std::vector<Solid> solids;       ///< else its colliders, else that of its inertia, made small; then never empty
};

/// The links that have something to draw, in the model's order. Meshes of links that the plan does not have are left
/// out.
std::vector<DrawnLink> drawn_links(const Plan& plan, const std::vector<VisualMesh>& meshes = {});

/// Colliders that stand in the world.
std::vector<Solid> world_solids(const Model& model);

}  // namespace lockstep::view
