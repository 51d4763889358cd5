// Names that are taken. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <unordered_set>

namespace lockstep::exporter {

class Names {
 public:
  /// The name, with "#2", "#3" ... behind it if it is taken. It is taken afterwards.
  std::string take(const std::string& wanted) {
    std::string name = wanted;
    for (int n = 2; !taken_.insert(name).second; ++n) name = wanted + "#" + std::to_string(n);
    return name;
  }

 private:
  std::unordered_set<std::string> taken_;
};

}  // namespace lockstep::exporter
