// The report's lines. SPDX-License-Identifier: Apache-2.0
#include "report.h"

#include <fmt/format.h>

#include <algorithm>

namespace lockstep::importer {
namespace {

// Real files have few kinds of things.
constexpr std::size_t most_kinds = 40;
constexpr int most_refused = 20;  // what is refused may have taken long

std::string tallied(const std::map<std::string, int>& tally) {
  std::vector<std::string> items;
  for (const auto& [kind, number] : tally) items.push_back(fmt::format("{} {}", number, kind));
  return listed(items, ", ", most_kinds);
}

std::string of_joints(const std::map<std::string, int>& tally) {
  std::vector<std::string> items;
  for (const auto& [kind, number] : tally)
    items.push_back(fmt::format("{} of {}", kind, counted(static_cast<std::size_t>(number), "joint")));
  return listed(items);
}

std::string line_of_unknown(const std::map<std::string, int>& unknown) {
  return "unknown, not used (check the spelling): " + tallied(unknown);
}

}  // namespace

void Report::remark(const std::string& what, const std::string& item, double size) {
  auto& items = remarks_[what];
  if (items.empty()) order_.push_back(what);
  items.emplace_back(size, item);
}

void Report::warn(const std::string& what, const std::string& item) {
  remark(what, item);
  warned_.insert(what);
}

void Report::tally(const std::string& what, const std::string& kind) {
  if (!tallies_.contains(what)) order_.push_back(what);
  ++tallies_[what][kind];
}

void Report::refuse(const Error& error, bool is_of_model) {
  if (refusals_.empty()) is_model_refused_ = is_of_model;
  for (const Reason& reason : error.reasons()) {
    const bool is_known = std::any_of(refusals_.begin(), refusals_.end(), [&](const Reason& known) {
      return known.element == reason.element && known.rule == reason.rule;
    });
    if (!is_known) refusals_.push_back(reason);
  }
  is_full_ = ++refused_ == most_refused;
  if (is_full_) stop_if_refused();
}

void Report::stop_if_refused() const {
  if (refusals_.empty()) return;
  std::vector<Reason> reasons = refusals_;
  if (is_full_) reasons.push_back({"the file", "may be refused for more reasons", "correct those before first"});
  if (is_model_refused_) throw ModelError(reasons);
  throw ImportError(reasons);
}

std::string Report::line(const std::string& what) const {
  if (const auto tally = tallies_.find(what); tally != tallies_.end())
    return fmt::format("{}: {}", what, tallied(tally->second));
  const auto found = remarks_.find(what);
  if (found == remarks_.end()) return "";
  auto sorted = found->second;
  std::stable_sort(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<std::string> items;
  for (const auto& [size, item] : sorted) items.push_back(item);
  return fmt::format("{} ({}): {}", what, items.size(), listed(items, ", ", whole_.contains(what) ? items.size() : 8));
}

std::vector<std::string> Report::lines() const {
  std::vector<std::string> lines;
  for (const std::string& what : order_) lines.push_back(line(what));
  if (!kept_.empty()) lines.push_back("kept and enforced by a step: " + of_joints(kept_));
  if (!not_used_.empty()) lines.push_back("not used: " + tallied(not_used_));
  if (!unknown_.empty()) lines.push_back(line_of_unknown(unknown_));
  return lines;
}

std::vector<std::string> Report::warnings() const {
  std::vector<std::string> lines;
  for (const std::string& what : order_)
    if (warned_.count(what)) lines.push_back(line(what));
  if (!unknown_.empty()) lines.push_back(line_of_unknown(unknown_));
  return lines;
}

std::string listed(const std::vector<std::string>& items, const char* between, std::size_t longest) {
  if (items.size() <= longest) return fmt::format("{}", fmt::join(items, between));
  std::vector<std::string> shown(items.begin(), items.begin() + static_cast<std::ptrdiff_t>(longest - 1));
  shown.push_back(fmt::format("... {} more ...", items.size() - longest));
  shown.push_back(items.back());
  return fmt::format("{}", fmt::join(shown, between));
}

std::string counted(std::size_t number, const char* noun) {
  return fmt::format("{} {}{}", number, noun, number == 1 ? "" : "s");
}

std::string contents_of(const Model& model) {
  std::size_t moving = 0, tendons = 0, coupled = 0;  // tendons with a coupling
  for (const Joint& joint : model.joints) {
    joint.kind == JointKind::tendon ? ++tendons : moving += joint.moves();
    coupled += joint.kind == JointKind::tendon && joint.path.empty();
  }
  std::string text = fmt::format("{}, {}, ", counted(model.links.size(), "link"), counted(moving, "moving joint"));
  if (tendons > 0) text += counted(tendons, "tendon") + ", ";
  text += counted(model.couplings.size() - coupled, "coupling");
  return model.loops.empty() ? text : text + ", " + counted(model.loops.size(), "loop");
}

}  // namespace lockstep::importer
