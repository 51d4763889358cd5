// Inertia and colliders of collision shapes. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "element.h"
#include "import/draft.h"

namespace lockstep::importer::urdf {

/// Reads all <collision> elements of a link. Throws ImportError where a shape has no volume.
Shapes read_shapes(Element& link, const std::string& name);

}  // namespace lockstep::importer::urdf
