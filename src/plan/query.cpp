// SPDX-License-Identifier: Apache-2.0
#include "query.h"

#include <cmath>

#include "lockstep/error.h"

namespace lockstep {

const char* to_string(Quantity quantity) noexcept {
  static const char* const names[] = {"position",
                                      "velocity",
                                      "position_target",
                                      "velocity_target",
                                      "effort",
                                      "link_pose",
                                      "link_velocity",
                                      "site_pose",
                                      "site_position",
                                      "site_velocity",
                                      "coupling_error",
                                      "loop_error",
                                      "loop_force",
                                      "root_pose",
                                      "root_velocity",
                                      "kinetic_energy",
                                      "potential_energy",
                                      "contact_force",
                                      "contact_normal_force",
                                      "contact_gap",
                                      "contact_slip",
                                      "contact_point",
                                      "unfinished_contacts",
                                      "solve_counts",
                                      "link_twist",
                                      "site_twist",
                                      "link_gravity",
                                      "site_gravity",
                                      "link_contact_force",
                                      "link_contacts",
                                      "drive_effort",
                                      "drive_effort_peak",
                                      "drive_effort_mean",
                                      "contact_peak_force",
                                      "contact_mean_force",
                                      "contact_time",
                                      "contact_air_time",
                                      "contact_last_time",
                                      "contact_last_air_time",
                                      "contact_first_touch",
                                      "joint_acceleration",
                                      "link_acceleration",
                                      "site_acceleration",
                                      "joint_wrench",
                                      "height_scan"};
  const auto index = static_cast<unsigned>(quantity);
  return index < std::size(names) ? names[index] : "unknown";
}

QueryShape shape_of(const Program& program, Quantity quantity) {
  const Tables<double>& t = program.f64;
  const int sites = static_cast<int>(program.model.sites.size());
  switch (quantity) {
    case Quantity::position:
    case Quantity::velocity: return {t.joints, 1};
    case Quantity::position_target:
    case Quantity::velocity_target:
    case Quantity::effort: return {t.joints * t.input_times, 1};
    case Quantity::link_pose: return {t.links, 7};
    case Quantity::link_velocity: return {t.links, 6};
    case Quantity::site_pose: return {sites, 7};
    case Quantity::site_position: return {sites, 3};
    case Quantity::site_velocity: return {sites, 6};
    case Quantity::coupling_error: return {t.couplings, 1};
    case Quantity::loop_error: return {t.loops.loops.count, 2};
    case Quantity::loop_force: return {t.loops.loops.count, 6};
    case Quantity::root_pose: return {t.roots.count, 7};
    case Quantity::root_velocity: return {t.roots.count, 6};
    case Quantity::kinetic_energy:
    case Quantity::potential_energy:
    case Quantity::unfinished_contacts: return {1, 1};
    case Quantity::contact_force: return {t.contacts.contacts.count, 3};
    case Quantity::contact_normal_force:
    case Quantity::contact_gap:
    case Quantity::contact_slip: return {t.contacts.contacts.count, 1};
    case Quantity::solve_counts: return {t.counts_solves() ? 1 : 0, solve_count_rows};
    case Quantity::contact_point: return {t.contacts.slots, 11};
    case Quantity::link_twist: return {t.links, 6};
    case Quantity::site_twist: return {sites, 6};
    case Quantity::link_gravity:
    case Quantity::link_contact_force: return {t.links, 3};
    case Quantity::site_gravity: return {sites, 3};
    case Quantity::link_contacts: return {t.links, 1};
    case Quantity::drive_effort:
    case Quantity::drive_effort_peak:
    case Quantity::drive_effort_mean: return {t.joints, 1};
    case Quantity::contact_peak_force:
    case Quantity::contact_time:
    case Quantity::contact_air_time:
    case Quantity::contact_last_time:
    case Quantity::contact_last_air_time:
    case Quantity::contact_first_touch: return {t.contacts.contacts.count, 1};
    case Quantity::contact_mean_force: return {t.contacts.contacts.count, 3};
    case Quantity::joint_acceleration: return {t.joints, 1};
    case Quantity::link_acceleration: return {t.links, 6};
    case Quantity::site_acceleration: return {sites, 6};
    case Quantity::joint_wrench: return {t.joints, 6};
    case Quantity::height_scan: return {t.links, 0};  // by points
  }
  throw UsageError("quantity " + std::to_string(static_cast<int>(quantity)), "is none of the enumerators",
                   "give one of Quantity");
}

namespace {

void require_recorded(const Tables<double>& t, Quantity quantity) {
  const auto require = [&](bool recorded, Quantity first, Quantity last, const char* setting) {
    if (!recorded && quantity >= first && quantity <= last)
      throw UsageError(std::string("query ") + to_string(quantity), "is not kept by this plan",
                       std::string("set StepSettings::") + setting);
  };
  require(t.record_efforts, Quantity::drive_effort, Quantity::drive_effort_mean, "record_efforts");
  require(t.record_contacts, Quantity::contact_peak_force, Quantity::contact_first_touch, "record_contacts");
  require(t.record_accelerations, Quantity::joint_acceleration, Quantity::joint_wrench, "record_accelerations");
}

void require_points(const Program& program, const Query& query) {
  const bool scans = query.quantity == Quantity::height_scan;
  const auto refuse = [&](const std::string& rule, const char* remedy) {
    throw UsageError(std::string("query ") + to_string(query.quantity), rule, remedy);
  };
  if (!scans && !query.points.empty()) refuse("has points, which it does not take", "leave them out");
  if (!scans) return;
  if (query.points.empty()) refuse("has no points", "give x and y of each in Query::points");
  for (const auto& [x, y] : query.points)
    if (!std::isfinite(x) || !std::isfinite(y)) refuse("has a point that is not finite", "give x and y in m");
  const ContactTables<double>& contacts = program.f64.contacts;
  if (!contacts.used()) refuse("needs a plan with contacts", "let something touch the ground");
  const auto leans = [](const ColliderPlace<double>& own) {
    return own.rotation[8] < 1.0 - 1e-9 || (own.in_link && own.link_rotation[8] < 1.0 - 1e-9);
  };
  for (int c = 0; c < contacts.colliders.count; ++c)
    if (contacts.colliders[c].kind == ShapeKind::height_field && leans(contacts.colliders[c]))
      refuse("cannot see height field '" + program.model.colliders[static_cast<std::size_t>(c)].name + "', which leans",
             "put the slope into its heights");
}

}  // namespace

int Plan::query_rows(const Query& query) const {
  const QueryShape shape = shape_of(*program_, query.quantity);
  require_recorded(program_->f64, query.quantity);
  require_points(*program_, query);
  for (const int element : query.elements)
    if (element < 0 || element >= shape.elements)
      throw UsageError("element " + std::to_string(element) + " of query " + to_string(query.quantity),
                       "is not part of the plan", "give 0 to " + std::to_string(shape.elements - 1));
  if (!std::isfinite(query.scale))
    throw UsageError(std::string("scale of query ") + to_string(query.quantity), "is " + std::to_string(query.scale),
                     "give a finite number");
  const int rows = query.points.empty() ? shape.rows : static_cast<int>(query.points.size());
  return rows * (query.elements.empty() ? shape.elements : static_cast<int>(query.elements.size()));
}

}  // namespace lockstep
