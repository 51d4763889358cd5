// The content of a <robot>, before its root link is known. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "element.h"
#include "lockstep/model.h"
#include "mimics.h"

namespace lockstep::urdf {

/// A joint that frees its child completely. A Model can only have one below the root: Root::floating.
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

/// Reads all links and joints. Throws ImportError if an element is not URDF. Does not check the names that they refer
/// to.
Robot read_robot(Element element);

}  // namespace lockstep::urdf
