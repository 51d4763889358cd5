// The content of a <robot>, before its root link is known. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "element.h"
#include "lockstep/import.h"
#include "mimics.h"
#include "shapes.h"

namespace lockstep::urdf {

/// A joint that frees its child completely. Below the root link it makes a tree of its own: Root::floating.
struct FloatingJoint {
  Joint joint;
  std::string place;
};

/// What a link has beside its name and its inertia.
struct LinkExtras {
  bool lacks_mass = false, lacks_tensor = false;  ///< its <inertial> has only the other
  Shapes shapes;                                  ///< read only if ImportOptions::density asks for them
};

struct Robot {
  Model model;  ///< links and joints in the file's order, no couplings
  std::vector<Mimic> mimics;
  std::vector<FloatingJoint> floating;
  std::unordered_map<std::string, LinkExtras> extras;   ///< by link
  std::unordered_map<std::string, std::string> places;  ///< Element::place() by "link 'a'", "joint 'j'", "coupling 'j'"
};

/// Whether the set holds the joint, which follows another or not.
bool holds(const JointSet& set, const std::string& joint, bool follows);

/// Reads all links and joints. Bounds that are ignored are kept where they are possible. Throws ImportError if an
/// element is not URDF. Does not check the names that they refer to.
Robot read_robot(Element element, const ImportOptions& options);

}  // namespace lockstep::urdf
