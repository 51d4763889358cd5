// The report's lines. SPDX-License-Identifier: Apache-2.0
#include "report.h"

#include <fmt/format.h>

namespace lockstep::urdf {
namespace {

// Real files have few kinds of things.
constexpr std::size_t most_kinds = 40;

std::string tallied(const std::map<std::string, int>& tally) {
  std::vector<std::string> items;
  for (const auto& [kind, number] : tally) items.push_back(fmt::format("{} {}", number, kind));
  return listed(items, ", ", most_kinds);
}

}  // namespace

void Report::remark(const std::string& what, const std::string& item) {
  std::vector<std::string>& items = remarks_[what];
  if (items.empty()) order_.push_back(what);
  items.push_back(item);
}

std::vector<std::string> Report::lines() const {
  std::vector<std::string> lines;
  for (const std::string& what : order_) {
    const std::vector<std::string>& items = remarks_.at(what);
    lines.push_back(fmt::format("{} ({}): {}", what, items.size(), listed(items)));
  }
  std::vector<std::string> kept;
  for (const auto& [kind, number] : kept_)
    kept.push_back(fmt::format("{} of {}", kind, counted(static_cast<std::size_t>(number), "joint")));
  if (!kept.empty()) lines.push_back("kept and enforced by a step: " + listed(kept));
  if (!not_used_.empty()) lines.push_back("not used: " + tallied(not_used_));
  if (!unknown_.empty()) lines.push_back("unknown, not used (check the spelling): " + tallied(unknown_));
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

}  // namespace lockstep::urdf
