// Bodies as links and joints. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "import/draft.h"
#include "scene.h"
#include "start.h"

namespace lockstep::importer::mjcf {

/// Where a body is in the model.
struct Place {
  std::string link;                                        ///< empty: it stands in the world, which has no link
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();  ///< of the body's frame in the link's, or in the world
};

/// Fills links, joints, roots and sites of the draft's model. A link's frame stands at the anchor of its joint; bodies
/// with several joints get links without mass between these. By body of the scene, unread ones too: its place.
std::vector<Place> grow_trees(const Scene& scene, const Start& start, Draft& draft);

}  // namespace lockstep::importer::mjcf
