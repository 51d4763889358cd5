// What a reader has read, before it is judged. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <unordered_map>
#include <vector>

#include "lockstep/import.h"
#include "options.h"

namespace lockstep::importer {

/// What the <collision> elements of one link come to.
struct Shapes {
  Inertia solid;  ///< of all but meshes, of density 1 kg/m^3; its mass is their volume
  std::vector<std::function<Inertia()>> mesh_solids;  ///< likewise, each opens its mesh
  int collisions = 0;                                 ///< elements, of which
  int meshes = 0;                                     ///< have a mesh that is left out
  std::vector<Collider> colliders;
};

/// What a link has beside its name and its inertia.
struct LinkExtras {
  bool lacks_mass = false, lacks_tensor = false;  ///< its <inertial> has only the other
  Shapes shapes;                                  ///< read only if ImportOptions::density asks for them
};

struct Draft {
  Format format = Format::urdf;
  Model model;
  std::vector<VisualMesh> visual_meshes;
  std::unordered_map<std::string, LinkExtras> extras;  ///< by link
  std::unordered_map<std::string, std::string>
      places;  ///< "file:line: element" by "link 'a'", "joint 'j'", "coupling 'j'"
};

}  // namespace lockstep::importer
