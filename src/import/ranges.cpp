// Ranges of followers beside those of their leaders. SPDX-License-Identifier: Apache-2.0
#include "ranges.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <unordered_map>

namespace lockstep::importer {
namespace {

// A mapped range may miss the limits by this share of their width: files round their limits.
constexpr double limit_slack = 1e-5;

// Reports a follower that leaves its limits while its leader keeps its own.
void report_range(const Joint& follower, const Joint& leader, double multiplier, double offset, Report& report) {
  const double one = multiplier * leader.lower + offset, other = multiplier * leader.upper + offset;
  const double beyond = std::max(follower.lower - std::min(one, other), std::max(one, other) - follower.upper);
  const auto slack_of = [](double width) { return std::isfinite(width) ? limit_slack * width : 0.0; };
  const double slack = slack_of(follower.upper - follower.lower);
  if (beyond == infinity)
    report.remark("limited followers of a leader without limits", follower.name);
  else if (beyond > slack)
    report.remark(
        "followers that leave their limits while their leader keeps its own",
        fmt::format("{} by {:.4g} {}", follower.name, beyond, follower.kind == JointKind::prismatic ? "m" : "rad"));

  // How much of the leader's range the follower's limits leave. Some published grippers have the wrong sign there.
  const double at_lower = (follower.lower - offset) / multiplier;
  const double at_upper = (follower.upper - offset) / multiplier;
  const double left =
      std::min(leader.upper, std::max(at_lower, at_upper)) - std::max(leader.lower, std::min(at_lower, at_upper));
  if (beyond > slack && left <= slack_of(leader.upper - leader.lower))
    report.warn("followers whose limits leave their leader no room to move", follower.name);
}

}  // namespace

void report_followers_ranges(const Model& model, Report& report) {
  std::unordered_map<std::string, const Joint*> joints;
  for (const Joint& joint : model.joints) joints.emplace(joint.name, &joint);
  for (const Coupling& coupling : model.couplings) {
    const Joint& follower = *joints.at(coupling.joint);
    if (coupling.terms.size() != 1 || coupling.function || !is_hard(coupling.softness) ||
        follower.kind == JointKind::tendon)
      continue;
    const CouplingTerm& term = coupling.terms.front();
    report_range(follower, *joints.at(term.joint), -term.ratio, -coupling.offset, report);
  }
}

}  // namespace lockstep::importer
