// SPDX-License-Identifier: Apache-2.0
#include "describe_contacts.h"

#include <cstddef>

#include "plan/layout.h"
#include "targets/reduced_matrix.h"
#include "targets/start_gaps.h"
#include "words.h"

namespace lockstep {
namespace {

// Pairs that overlap where the model starts, the deepest first.
std::string overlap_line(const Program& program) {
  constexpr float least = 1e-3f;  // m
  const Tables<float>& t = program.f32;
  if (!t.contacts.used()) return "";
  std::vector<float> q(static_cast<std::size_t>(t.joints)), poses,
      gaps(static_cast<std::size_t>(t.contacts.contacts.count));
  for (std::size_t j = 0; j < program.model.joints.size(); ++j)
    if (const int i = program.solver_joint[j]; i >= 0) q[i] = static_cast<float>(program.model.joints[j].position);
  for (const Root& root : program.model.roots) {
    if (!root.floating) continue;
    const Eigen::Quaterniond turn(root.pose.linear());
    for (const double number : {root.pose.translation().x(), root.pose.translation().y(), root.pose.translation().z(),
                                turn.w(), turn.x(), turn.y(), turn.z()})
      poses.push_back(static_cast<float>(number));
  }
  std::vector<std::max_align_t> scratch(reduced_matrix_bytes(t) / sizeof(std::max_align_t) + 1);
  start_gaps(t, q.data(), poses.data(), gaps.data(), scratch.data());
  std::vector<std::pair<float, std::string>> overlaps;
  for (std::size_t p = 0; p < gaps.size(); ++p)
    if (gaps[p] < -least)
      overlaps.emplace_back(gaps[p], fmt::format("{} by {:.3g} mm", program.plan_contacts[p].name, -1e3f * gaps[p]));
  if (overlaps.empty()) return "";
  std::stable_sort(overlaps.begin(), overlaps.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<std::string> items;
  for (const auto& [gap, item] : overlaps) items.push_back(item);
  return fmt::format(
      "  Overlap at the model's start, and push until they are apart: {}. Leave out pairs that cannot part.\n",
      joined(items));
}

// Height fields, and what is too wide to be touched between its points.
std::string ground_lines(const Program& program) {
  std::string text;
  const auto& colliders = program.f64.contacts.colliders;
  for (int c = 0; c < colliders.count; ++c) {
    if (colliders[c].kind != ShapeKind::height_field) continue;
    const Collider& own = program.model.colliders[static_cast<std::size_t>(c)];
    text += fmt::format(
        "  Height field '{}' of {} x {} heights is touched by points; what is narrower than these are apart "
        "is missed.",
        own.name, own.shape.heights.rows(), own.shape.heights.cols());
    const double cell = 1.0 / std::max(colliders[c].size[0], colliders[c].size[1]);
    std::vector<std::string> wide;
    for (const ColliderPair& pair : program.contacts.pairs)
      if (pair.first == c && colliders[pair.second].reach > 2.0 * cell)
        wide.push_back(program.model.colliders[static_cast<std::size_t>(pair.second)].name);
    text += wide.empty() ? "\n" : fmt::format(" Wider than four cells: {}.\n", joined(wide));
  }
  return text;
}

}  // namespace

std::string contact_lines(const Program& program) {
  const ContactPairs& contacts = program.contacts;
  if (contacts.pairs.empty() && contacts.left_out.empty()) return "";
  const Tables<double>& t = program.f64;
  std::vector<std::string> names;
  for (const PlanContact& contact : program.plan_contacts) names.push_back(contact.name);
  std::string text = fmt::format("Contacts: {}, {}: {}.\n", count_of(static_cast<int>(names.size()), "pair", "pairs"),
                                 count_of(t.contacts.slots, "slot", "slots"), joined(names));
  if (!names.empty() && program.method == Method::pgs)
    text += fmt::format(
        "  Found in each step; where one acts, {} sweeps visit contacts, bounds and couplings, and {} more for the "
        "velocity that stays. What they leave is left.\n",
        program.settings.iterations, program.settings.velocity_iterations);
  else if (!names.empty())
    text += fmt::format(
        "  Found in each step; where one acts, solved by Newton on the reduced velocities together with the bounds: at "
        "most {} passes of {} rounds, tolerance {:g}.\n",
        t.contacts.passes, t.contacts.rounds, program.settings.contacts.tolerance);
  text += overlap_line(program) + ground_lines(program);
  if (!contacts.left_out.empty())
    text += fmt::format("  Left out of groups: {}.\n", fmt::join(contacts.left_out, "; "));
  return text;
}

}  // namespace lockstep
