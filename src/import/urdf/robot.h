// The content of a <robot>, before its root link is known. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "element.h"
#include "import/draft.h"
#include "import/meshes/files.h"
#include "lockstep/import.h"
#include "mimics.h"

namespace lockstep::importer::urdf {

/// A joint that frees its child completely. Below the root link it makes a tree of its own: Root::floating.
struct FloatingJoint {
  Joint joint;
  std::string place;
};

/// Links, joints and loops are in the file's order; there are no couplings yet.
struct Robot : Draft {
  std::vector<Mimic> mimics;
  std::vector<FloatingJoint> floating;
};

/// Reads all links, joints and loops. Bounds that are ignored are kept where they are possible. Throws ImportError if
/// an element is not URDF. Does not check the names that they refer to.
Robot read_robot(Element element, const ImportOptions& options, MeshFiles& meshes);

}  // namespace lockstep::importer::urdf
