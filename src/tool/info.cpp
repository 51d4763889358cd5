// lockstep info: what a model file holds and what a step does. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <set>

#include "fix.h"
#include "lockstep/plan.h"
#include "options.h"
#include "ranges.h"
#include "tool.h"
#include "view/unit.h"

namespace lockstep::tool {
namespace {

struct InfoOptions {
  ModelOptions model;
  StepOptions step;
  bool fixes = false;
};

const char* name_of(JointKind kind) {
  switch (kind) {
    case JointKind::revolute: return "revolute";
    case JointKind::continuous: return "continuous";
    case JointKind::prismatic: return "prismatic";
    case JointKind::ball: return "ball";
    case JointKind::tendon: return "tendon";
    case JointKind::fixed: break;
  }
  return "fixed";
}

std::string words_of(double lower, double upper, const std::string& unit) {
  return fmt::format("{:.6g} to {:.6g} {}", lower, upper, unit);
}

// "-2 knuckle + 0.1"
std::string words_of(const Following& follows, const Plan& plan) {
  std::string text;
  for (const Following::Leader& leader : follows.leaders)
    text += fmt::format("{}{:.6g} {}", text.empty() ? "" : " + ", leader.ratio, plan.dof_names()[leader.dof]);
  return follows.offset == 0.0 ? text : fmt::format("{} + {:.6g}", text, follows.offset);
}

// A joint: its bounds and drive, what it follows, and what its followers leave of its range.
std::string line_of(const Joint& joint, int dof, const Plan& plan, const Range& held, const Range& usable) {
  const std::string unit = view::unit_of(plan.model(), joint);
  std::string line = fmt::format("  {}: {}", joint.name, name_of(joint.kind));
  if (joint.lower > -infinity || joint.upper < infinity) {
    const auto* slack = joint.kind == JointKind::tendon ? std::get_if<Spring>(&joint.limit_softness) : nullptr;
    line += slack ? fmt::format(", spring {:.6g} beyond ", slack->kp) : ", ";
    line += words_of(joint.lower, joint.upper, unit);
    if (held == Range() && !slack) line += " (ignored)";
  }
  if (joint.velocity_limit < infinity) line += fmt::format(", {:.6g} {}/s", joint.velocity_limit, unit);
  if (joint.effort_limit < infinity) line += fmt::format(", {:.6g} {}", joint.effort_limit, unit == "m" ? "N" : "N m");
  if (joint.damping > 0.0) line += fmt::format(", damping {:.6g}", joint.damping);
  if (joint.stiffness > 0.0) line += fmt::format(", spring {:.6g} at rest at {:.6g}", joint.stiffness, joint.rest);
  if (joint.armature > 0.0) line += fmt::format(", armature {:.6g}", joint.armature);
  if (joint.friction > 0.0) line += fmt::format(", friction {:.6g}", joint.friction);
  if (joint.drive.kinematic) line += ", kinematic drive";
  if (joint.drive.kp > 0.0 || joint.drive.kd > 0.0)
    line += fmt::format(", servo kp {:.6g} kd {:.6g}", joint.drive.kp, joint.drive.kd);
  const Following& follows = plan.following(dof);
  if (!follows.leaders.empty()) line += "; follows " + words_of(follows, plan);
  if (usable == held) return line;
  line += usable.lower < usable.upper    ? "; followers leave " + words_of(usable.lower, usable.upper, unit)
          : usable.lower == usable.upper ? fmt::format("; followers leave {:.6g} {} alone", usable.lower, unit)
                                         : "; followers leave nothing";
  std::set<std::string> who;
  for (const std::string& by : {usable.lower_by, usable.upper_by})
    if (!by.empty()) who.insert(by);
  return line + fmt::format(" ({})", fmt::join(who, ", "));
}

std::string joint_lines(const Plan& plan) {
  const std::vector<Range> held = held_ranges(plan), usable = usable_ranges(plan);
  std::string text = "Joints:\n";
  int dof = 0;  // dofs are the joints that move
  for (const Joint& joint : plan.model().joints)
    if (joint.moves()) {
      text += line_of(joint, dof, plan, held[dof], usable[dof]) + '\n';
      ++dof;
    }
  for (const Site& site : plan.model().sites) text += fmt::format("  site {} on {}\n", site.name, site.link);
  return text;
}

// Takes the options that read the file where it is refused, and says which and why.
void fix(InfoOptions& options) {
  Ignored& ignore = options.step.settings.ignore;
  try {
    options.model.read(ignore);
    fmt::print("Nothing to fix\n\n");
  } catch (const Error& error) {
    const Arguments assumed = fixing_arguments(options.model, ignore, error);
    if (assumed.empty()) throw;
    fmt::print("Refused as it is:\n");
    for (const Reason& reason : error.reasons()) fmt::print("  {}: {}\n", reason.element, reason.rule);
    fmt::print("Assumed by --fix: {}\n\n", shell_words(assumed));
    take(assumed, options.model, ignore);
  }
}

void run(InfoOptions options) {
  if (options.fixes) fix(options);
  const Import import = options.model.load(options.step.settings.ignore);
  const Plan plan = compile(import.model, options.step.settings);
  fmt::print("{}\n", options.model.file);
  for (const std::string& line : import.report) fmt::print("  {}\n", line);
  std::string description = plan.describe();
  while (description.ends_with('\n')) description.pop_back();
  fmt::print("\n{}\n{}\n", joint_lines(plan), description);
}

}  // namespace

void add_info(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("info", "Says what a model file holds and what a step does");
  const auto options = std::make_shared<InfoOptions>();
  options->model.add_to(*command);
  options->step.add_to(*command);
  command->add_flag("--fix", options->fixes,
                    "Takes the fewest options that read a file which is refused, and says which");
  command->callback([options, &exit_code] {
    run(*options);
    exit_code = fine;
  });
}

}  // namespace lockstep::tool
