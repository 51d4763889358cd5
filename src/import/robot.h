// What stands in a <robot>, before it is known which link is the root. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "element.h"
#include "lockstep/model.h"
#include "mimics.h"

namespace lockstep::urdf {

/// A joint that frees its child completely. Only one below the root has a place in a Model: Root::floating.
struct FloatingJoint {
  Joint joint;
  std::string place;
};

struct Robot {
  Model model;  ///< links and joints in the file's order, no couplings
  std::vector<Mimic> mimics;
  std::optional<FloatingJoint> floating;
  std::unordered_map<std::string, std::string> joint_places;  ///< by name: Element::place(), for errors
};

/// Reads all links and joints. Throws ImportError where an element is no URDF; what they refer to is not looked at.
Robot read_robot(Element element);

}  // namespace lockstep::urdf
