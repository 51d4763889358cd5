// Elements of a Model by their names. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <unordered_map>

namespace lockstep {

/// The number of each element, for many look-ups. The elements must keep their places. Of one name the first counts.
class ByName {
 public:
  template <class Elements>
  explicit ByName(const Elements& elements) {
    int number = 0;
    for (const auto& element : elements) numbers_.emplace(element.name, number++);
  }
  /// -1 if there is none.
  int find(const std::string& name) const {
    const auto found = numbers_.find(name);
    return found == numbers_.end() ? -1 : found->second;
  }

 private:
  std::unordered_map<std::string, int> numbers_;
};

/// What coupling_names() calls the count-th coupling of a joint.
inline std::string coupling_name(const std::string& joint, int count) {
  return count == 1 ? joint : joint + "#" + std::to_string(count);
}

}  // namespace lockstep
