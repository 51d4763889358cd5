// Inertia and colliders of collision shapes. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "element.h"
#include "lockstep/model.h"

namespace lockstep::urdf {

/// What the <collision> elements of one link come to.
struct Shapes {
  Inertia solid;       ///< of all boxes, spheres, cylinders and capsules, of density 1 kg/m^3; its mass is their volume
  int collisions = 0;  ///< elements, of which
  int meshes = 0;      ///< have a mesh, which is never opened
  int cylinders = 0;   ///< have a cylinder, which is no collider
  std::vector<Collider> colliders;
};

/// Reads all <collision> elements of a link. Throws ImportError where a shape has no volume.
Shapes read_shapes(Element& link, const std::string& name);

}  // namespace lockstep::urdf
