// What the rules for a Model have in common. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <set>
#include <string>

#include "lockstep/error.h"
#include "lockstep/model.h"
#include "softness_numbers.h"

namespace lockstep {

std::string quoted(const char* kind, const std::string& name);

// Each throws ModelError for the element if the rule is broken.
void require(bool holds, const std::string& element, const std::string& rule, const std::string& remedy);
void finite(double value, const std::string& element, const std::string& what);
void finite(const Eigen::Ref<const Eigen::MatrixXd>& values, const std::string& element, const std::string& what);
void not_negative(double value, const std::string& element, const std::string& what);
void rigid(const Eigen::Isometry3d& pose, const std::string& element, const std::string& what);
/// `what` has the softness: a coupling, a limit, a kinematic drive, a contact.
void proper_softness(const Softness& softness, const std::string& element, const std::string& what);

template <class Elements>
void unique_names(const Elements& elements, const char* kind) {
  std::set<std::string> seen;
  for (const auto& element : elements) {
    require(!element.name.empty(), std::string("a ") + kind, "has no name", "name it");
    require(seen.insert(element.name).second, quoted(kind, element.name), "appears twice", "give each its own name");
  }
}

}  // namespace lockstep
