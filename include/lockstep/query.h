// Query: what Batch::read() writes. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "lockstep/export.h"

namespace lockstep {

/// Elements are dofs, links, sites, couplings, loops, floating roots or contacts, in the order of the Plan.
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
  loop_error,        ///< 2 rows by loop: distance of the frames that it holds (m), angle between their directions (rad)
  loop_force,        ///< 6 rows by loop: force (N) and torque (N m) of the last step on its second link, or on what
                     ///< carries that, about the second frame's origin, world axes; 0 in environments with a fault
  root_pose,         ///< 7 rows by floating root, as Batch::root_poses()
  root_velocity,     ///< 6 rows by floating root, as Batch::root_velocities()
  kinetic_energy,    ///< one row, J
  potential_energy,  ///< one row, J
  // Of contacts, by pair of Plan::contacts() or by its slots. Forces are those of the last step, whatever was written
  // since, and 0 after a reset; of a step that a leapfrog takes in parts, those of the last part (records of a call
  // have the whole step). The rest is that of the present state. A gap is infinite where the colliders are not near.
  contact_force,         ///< 3 rows by pair: on its second collider, N, world axes
  contact_normal_force,  ///< by pair, the sum over its points, N, >= 0
  contact_gap,           ///< by pair, the least one, m; negative where the colliders overlap
  contact_slip,          ///< by pair, the largest speed along the surface of its points that bear a force, m/s
  contact_point,  ///< 11 rows by slot: point (m), normal from first to second, force on the second (N), all in the
                  ///< world, gap (m), speed along the surface (m/s)
  unfinished_contacts,  ///< one row: solves of contacts since the last reset that ended at their cap of rounds
  solve_counts,  ///< 11 rows: what the last call of step() has spent on contacts and rows over several velocities,
                 ///< summed over its steps. Steps with contacts to look for; pairs near; contact points that could act,
                 ///< and those that pressed; solves, passes, rounds and search trials of the environment; points,
                 ///< rounds and trials of its tile. No rows in a plan without contacts and such rows
  link_twist,    ///< 6 rows by link: as link_velocity, but in the link's axes
  site_twist,    ///< 6 rows by site: as site_velocity, but in the site's axes
  link_gravity,  ///< 3 rows by link: the unit vector along gravity in the link's axes; 0 where the world has no gravity
  site_gravity,  ///< 3 rows by site: the same in the site's axes
  link_contact_force,  ///< 3 rows by link: the sum of contact_force on it over its colliders' pairs, N, world axes
  link_contacts,       ///< by link: how many of these pairs bear a force
  // With StepSettings::record_efforts: what drives have really applied, servo and feed-forward effort together, at most
  // the effort limit; without friction, springs and damping. 0 after a reset and in environments with a fault.
  drive_effort,       ///< by dof, mean over the last step, N m or N
  drive_effort_peak,  ///< by dof, the largest size in a step of the last call of step(), >= 0
  drive_effort_mean,  ///< by dof, mean over the last call of step()
  // With StepSettings::record_contacts, by pair of Plan::contacts(). A pair touches in a step in which it presses.
  // Times are those of whole steps, run on over calls of step(), and begin at 0 with a reset; a written state leaves
  // them.
  contact_peak_force,     ///< the largest size of contact_force in a step of the last call, N
  contact_mean_force,     ///< 3 rows: mean of contact_force over the last call, N, world axes
  contact_time,           ///< s that the pair has touched until now, 0 in the air
  contact_air_time,       ///< s that it has been in the air until now, 0 while it touches
  contact_last_time,      ///< s that the contact before the last flight took, 0 if there was none
  contact_last_air_time,  ///< s that the flight before the last touch took, 0 if there was none
  contact_first_touch,    ///< 1 if a flight has ended in the last call, else 0
  // With StepSettings::record_accelerations: means over the last step, also where it has an impact, at the velocities
  // of the present state. After a reset and in environments with a fault velocities count as constant and contacts as
  // gone.
  joint_acceleration,  ///< by dof, rad/s^2 or m/s^2
  link_acceleration,  ///< 6 rows by link, in its axes: angular acceleration (rad/s^2), and what an accelerometer at its
                      ///< origin measures (m/s^2), which is its acceleration minus gravity
  site_acceleration,  ///< 6 rows by site, in its axes: the same at its origin
  joint_wrench,       ///< 6 rows by dof: force (N) and torque (N m) through the joint on its child link, about the
                      ///< link's origin and in its axes. What drives, limits, couplings and friction of the joint do
                      ///< is part of it, and so is the pull of spatial tendons, as if it went through the joint;
                      ///< loops hold apart from it. 0 of tendons
  height_scan  ///< by link, a row for each of Query::points: how high the link's origin is above the ground there, m.
               ///< The ground is what stands in the world: half-spaces, upright height fields, boxes. Infinite where
               ///< there is none. For plans with contacts
};

/// The enumerator's name: "link_pose" ... The string lives forever.
LOCKSTEP_API const char* to_string(Quantity quantity) noexcept;

/// One quantity, of all elements or of those listed, in that order.
struct Query {
  Quantity quantity;
  std::vector<int> elements = {};  ///< empty: all
  double scale = 1.0;              ///< finite; all numbers are multiplied by it
  /// Of height_scan: x and y from the link's origin, m, along where its x axis looks seen from above, and to the left.
  std::vector<std::array<double, 2>> points = {};
};

}  // namespace lockstep
