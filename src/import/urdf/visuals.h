// <visual>: what links look like. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "element.h"
#include "import/meshes/files.h"

namespace lockstep::importer::urdf {

/// The meshes among the <visual> elements of a link.
std::vector<VisualMesh> read_visuals(Element& link, const std::string& name, const ImportOptions& options,
                                     MeshFiles& meshes);

}  // namespace lockstep::importer::urdf
