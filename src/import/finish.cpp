// What both readers do with what they have read. SPDX-License-Identifier: Apache-2.0
#include "finish.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <unordered_set>

#include "lockstep/error.h"
#include "model/by_name.h"
#include "model/contact_pairs.h"
#include "model/judge.h"
#include "model/tendons.h"
#include "model/trees.h"
#include "ranges.h"
#include "repair.h"
#include "text.h"
#include "units.h"

namespace lockstep::importer {
namespace {

constexpr std::size_t many_pairs = 50;  // a step looks at each

// The model as a step takes it: without the bounds that are ignored.
Model judged(Model model, const Ignored& ignore) {
  std::unordered_set<std::string> followers;
  for (const Coupling& coupling : model.couplings) followers.insert(coupling.joint);
  for (Joint& joint : model.joints) {
    const bool follows = joint.kind != JointKind::tendon && followers.count(joint.name) > 0;
    if (holds(ignore.position_limits, joint.name, follows) && !has_slack_spring(joint))
      joint.lower = -infinity, joint.upper = infinity;
    if (holds(ignore.velocity_limits, joint.name, follows)) joint.velocity_limit = infinity;
    if (holds(ignore.effort_limits, joint.name, follows)) joint.effort_limit = infinity;
    if (holds(ignore.friction, joint.name, follows)) joint.friction = 0.0;
  }
  return model;
}

void report_joints(const Model& model, Report& report) {
  for (const Joint& joint : model.joints) {
    if (!joint.moves()) {
      report.remark("fixed joints, merged when compiling", joint.name);
      continue;
    }
    if (!has_slack_spring(joint) && (joint.position < joint.lower || joint.position > joint.upper))
      report.warn(
          "joints that start outside of their limits",
          fmt::format("{} at {:.4g}, not {:.4g} to {:.4g}", joint.name, joint.position, joint.lower, joint.upper));
    if (joint.lower == joint.upper) report.warn("joints that cannot move, lower = upper", joint.name);
    if (!has_slack_spring(joint) && (joint.lower > -infinity || joint.upper < infinity)) report.kept("position limits");
    if (joint.velocity_limit < infinity) report.kept("velocity limits");
    if (joint.effort_limit < infinity) report.kept("effort limits");
    if (joint.friction > 0.0) report.kept("dry friction");
  }
}

void report_colliders(const Model& model, const ImportOptions& options, Report& report) {
  if (options.colliders && model.colliders.empty())
    report.warn("the file has no shape that could be a collider", model.name);
  const std::vector<std::string> ends = model.end_colliders();
  if (ends.size() < model.colliders.size())
    for (const std::string& name : ends)
      report.remark("colliders at the ends of chains, which Model::end_colliders() lists", name);

  const Trees trees(model);
  const std::vector<ColliderPair> pairs = contact_pairs(model, trees).pairs;
  if (pairs.empty())
    for (const Collider& collider : model.colliders)
      report.warn("colliders that touch nothing, as Model::contacts declares no pair", collider.name);
  if (pairs.size() <= many_pairs || ends.empty()) return;
  const std::unordered_set<std::string> at_ends(ends.begin(), ends.end());
  const ByName links(model.links);
  std::vector<bool> is_amid_a_chain;  // by collider
  for (const Collider& collider : model.colliders)
    is_amid_a_chain.push_back(!collider.link.empty() && !trees.is_bolted(links.find(collider.link)) &&
                              !at_ends.contains(collider.name));
  if (std::none_of(pairs.begin(), pairs.end(), [&](const ColliderPair& pair) {
        return is_amid_a_chain[pair.first] || is_amid_a_chain[pair.second];
      }))
    return;
  for (const ColliderPair& pair : pairs)
    report.warn(
        "pairs of colliders that may touch; those of feet, fingertips and objects alone are cheaper, see "
        "Model::end_colliders()",
        pair_name(model, pair));
}

// A misspelt name would say nothing.
void check_names(const ImportOptions& options, const Draft& draft) {
  const Model& model = draft.model;
  const auto refuse = [](const char* option, const std::string& name, const char* what,
                         const std::vector<std::string>& known) {
    throw SettingsError(option, "names '" + shortened(name) + "', which is no " + what,
                        "correct the name" + exists(nearest(name, known)));
  };
  std::vector<std::string> links, joints;
  for (const Link& link : model.links) links.push_back(link.name);
  for (const Joint& joint : model.joints)
    if (joint.moves()) joints.push_back(joint.name);
  for (const auto& [name, fit] : options.fit_of_links)
    if (!draft.places.contains("link '" + name + "'"))  // a link that stands for the world is no longer in the model
      refuse("ImportOptions::fit_of_links", name, "link", links);
  const Ignored& ignore = options.ignore;
  for (const JointSet* set :
       {&ignore.position_limits, &ignore.velocity_limits, &ignore.effort_limits, &ignore.friction})
    for (const std::string& name : set->names)
      if (std::find(joints.begin(), joints.end(), name) == joints.end())
        refuse("ImportOptions::ignore", name, "moving joint", joints);
}

// Where it is in the file, and what of the file's could have helped.
ModelError placed(const ModelError& error, const Draft& draft, const Report& report, const std::string& source) {
  const auto place = draft.places.find(error.element());
  std::string rule = error.rule(), remedy = error.remedy();
  for (const char* what : {unused_meshes, left_out_meshes})
    if (const std::string line = report.line(what); error.element().starts_with("link") && !line.empty())
      rule += "; " + line;
  if (draft.format == Format::urdf && remedy.find("ImportOptions::least_inertia") != std::string::npos)
    remedy += ", ImportOptions::density takes collision shapes";
  return {place != draft.places.end() ? place->second : source + ": " + error.element(), rule, remedy};
}

// What is left of a refused file need not have what the caller counts on.
void change(const ImportOptions& options, const Report& report, Model& model) {
  try {
    options.change(model);
  } catch (...) {
    report.stop_if_refused();
    throw;
  }
}

}  // namespace

bool holds(const JointSet& set, const std::string& joint, bool follows) {
  return set.all || (set.followers && follows) ||
         std::find(set.names.begin(), set.names.end(), joint) != set.names.end();
}

Import finished(Draft& draft, const ImportOptions& options, Report& report, const std::string& source,
                const std::function<void()>& assemble) {
  Model& model = draft.model;
  const Attempt attempt = [&](const std::function<void()>& part) {
    return report.attempt([&] {
      try {
        part();
      } catch (const ModelError& error) {
        if (report.is_full()) throw;
        throw placed(error, draft, report, source);
      }
    });
  };
  try {
    bool is_weighed = true;
    const bool is_whole = attempt([&] {
      assemble();
      check_names(options, draft);
      if (options.change) change(options, report, model);
      is_weighed = repair_inertias(options, draft, report);
    });
    if (is_whole && is_weighed) judge(model, attempt);
  } catch (...) {  // a name of the options
    report.stop_if_refused();
    throw;
  }
  report.stop_if_refused();
  const Model as_stepped = judged(model, options.ignore);
  report_followers_ranges(as_stepped, report);
  report_joints(as_stepped, report);
  report_units(as_stepped, report);
  report_colliders(model, options, report);
  Import result{std::move(model), report.lines(), report.warnings(), std::move(draft.visual_meshes), report.files()};
  result.report.insert(result.report.begin(), "read " + contents_of(result.model));
  return result;
}

}  // namespace lockstep::importer
