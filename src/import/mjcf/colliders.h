// Geoms as colliders, and which of them may touch. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "import/draft.h"
#include "scene.h"
#include "trees.h"

namespace lockstep::importer::mjcf {

/// Adds a collider for each geom that may touch another, and a contact for each pair that may: by contype and
/// conaffinity, <exclude>, <pair> and the rules for bodies of one weld and for parent and child. Geoms without a shape
/// in lockstep are warnings.
void collide(const Scene& scene, const std::vector<Place>& places, Draft& draft);

/// Without colliders: counts the pairs and excludes of the file.
void list_contacts(Document& document);

}  // namespace lockstep::importer::mjcf
