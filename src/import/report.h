// What the importer tells beside the Model. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <vector>

namespace lockstep::urdf {

/// Gathers remarks while a file is read, one line for each kind of remark however often it is made.
class Report {
 public:
  /// "what (2): item, item". Lines come in the order in which they were first remarked.
  void remark(const std::string& what, const std::string& item);
  void kept(const std::string& kind) { ++kept_[kind]; }          ///< of a joint: a bound that a step enforces
  void not_used(const std::string& kind) { ++not_used_[kind]; }  ///< URDF has it, lockstep has no use for it
  void unknown(const std::string& kind) { ++unknown_[kind]; }    ///< URDF has it not: perhaps a misspelling

  /// The remarks, then one line each of what was kept, not used and unknown.
  std::vector<std::string> lines() const;

 private:
  std::vector<std::string> order_;
  std::map<std::string, std::vector<std::string>> remarks_;
  std::map<std::string, int> kept_, not_used_, unknown_;
};

/// The items with `between` them, the middle of a long list left out and counted.
std::string listed(const std::vector<std::string>& items, const char* between = ", ", std::size_t longest = 8);

/// "1 link", "2 links".
std::string counted(std::size_t number, const char* noun);

}  // namespace lockstep::urdf
