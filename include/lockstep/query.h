// Query: what Batch::read() writes. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "lockstep/export.h"

namespace lockstep {

/// Elements are dofs, links, sites, couplings or floating roots, in the order of the Plan.
enum class Quantity {
  position,          ///< by dof, rad or m
  velocity,          ///< by dof, rad/s or m/s
  position_target,   ///< by row of Batch::position_targets()
  velocity_target,   ///< by row of Batch::velocity_targets()
  effort,            ///< by row of Batch::efforts(), N m or N
  link_pose,         ///< 7 rows by link: x, y, z (m), unit quaternion w, x, y, z, in the world
  link_velocity,     ///< 6 rows by link: angular velocity, then that of the link frame's origin, world axes
  site_pose,         ///< 7 rows by site, as link_pose
  site_position,     ///< 3 rows by site, m
  site_velocity,     ///< 6 rows by site, as link_velocity, of the site's origin
  coupling_error,    ///< by coupling, rad or m
  root_pose,         ///< 7 rows by floating root, as Batch::root_poses()
  root_velocity,     ///< 6 rows by floating root, as Batch::root_velocities()
  kinetic_energy,    ///< one row, J
  potential_energy,  ///< one row, J
};

/// The enumerator's name: "link_pose" ... The string lives forever.
LOCKSTEP_API const char* to_string(Quantity quantity) noexcept;

/// One quantity, of all elements or of those listed, in that order.
struct Query {
  Quantity quantity;
  std::vector<int> elements = {};  ///< empty: all
  double scale = 1.0;              ///< finite; all numbers are multiplied by it
};

}  // namespace lockstep
