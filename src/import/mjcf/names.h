// Names for what has none. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <unordered_map>
#include <unordered_set>

namespace lockstep::importer::mjcf {

class Names {
 public:
  /// False if the name is taken already.
  bool take(const std::string& name) { return taken_.insert(name).second; }
  /// Takes the name, or it with "#2", "#3", ... behind it.
  std::string unused(const std::string& base) {
    if (take(base)) return base;
    int& last = last_.try_emplace(base, 1).first->second;
    std::string name;
    do name = base + "#" + std::to_string(++last);
    while (!take(name));
    return name;
  }

 private:
  std::unordered_set<std::string> taken_;
  std::unordered_map<std::string, int> last_;  // the last number behind a name
};

}  // namespace lockstep::importer::mjcf
