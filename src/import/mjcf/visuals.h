// What bodies look like. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "trees.h"

namespace lockstep::importer::mjcf {

/// Fills the draft's visual meshes with those of geoms whose masks let them touch nothing; of a body that has none of
/// these with all of its meshes.
void look(const Scene& scene, const std::vector<Place>& places, Draft& draft);

}  // namespace lockstep::importer::mjcf
