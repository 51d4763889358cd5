// The importer's report. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "lockstep/model.h"

namespace lockstep::importer {

/// Collects remarks while a file is read. Each kind of remark becomes one line.
class Report {
 public:
  /// "what (2): item, item". Lines are in the order of their first remarks.
  void remark(const std::string& what, const std::string& item) { remark(what, item, 0.0); }
  /// The largest items first.
  void remark(const std::string& what, const std::string& item, double size);
  /// The same, of what the owner of the file should look at.
  void warn(const std::string& what, const std::string& item);
  void show_all(const std::string& what) { whole_.insert(what); }  ///< this line is not shortened
  /// "what: 3 of kindA, 1 of kindB". Lines stand with the remarks.
  void tally(const std::string& what, const std::string& kind);
  void kept(const std::string& kind) { ++kept_[kind]; }  ///< of a joint: a bound that a step enforces
  void not_used(const std::string& kind, int times = 1) { not_used_[kind] += times; }  ///< part of URDF, not of a step
  void unknown(const std::string& kind) { ++unknown_[kind]; }  ///< not part of URDF: perhaps a misspelling

  /// The line of one kind of remark; empty if there is none.
  std::string line(const std::string& what) const;
  /// The remarks, then one line each for what was kept, not used and unknown.
  std::vector<std::string> lines() const;
  /// Those of the lines that are warnings: what warn() and unknown() were told.
  std::vector<std::string> warnings() const;

 private:
  std::vector<std::string> order_;
  std::map<std::string, std::vector<std::pair<double, std::string>>> remarks_;  // items after their sizes
  std::map<std::string, std::map<std::string, int>> tallies_;
  std::set<std::string> warned_, whole_;  // of order_
  std::map<std::string, int> kept_, not_used_, unknown_;
};

/// The items with `between` them. Of a long list the middle is left out and counted.
std::string listed(const std::vector<std::string>& items, const char* between = ", ", std::size_t longest = 8);

/// "1 link", "2 links".
std::string counted(std::size_t number, const char* noun);

/// "2 links, 1 moving joint, 0 couplings". Tendons and their couplings are counted apart, where there are
/// some, and so are loops.
std::string contents_of(const Model& model);

}  // namespace lockstep::importer
