// Inertia and colliders of collision shapes. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "element.h"
#include "import/draft.h"
#include "import/meshes/files.h"

namespace lockstep::importer::urdf {

/// Reads all <collision> elements of a link, with inertia or colliders or both. Throws ImportError where a shape has no
/// volume or a mesh cannot be had.
Shapes read_shapes(Element& link, const std::string& name, const ImportOptions& options, bool weighs,
                   MeshFiles& meshes);

}  // namespace lockstep::importer::urdf
