// Masses of meshes. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "mesh.h"
#include "model/hull.h"

namespace lockstep::importer {

/// What of a mesh has mass. MuJoCo's words.
enum class MeshRule {
  legacy,  ///< tetrahedra between each triangle and a point inside, each counted as above 0: too much where concave
  convex,  ///< the hull
  exact,   ///< what a closed surface encloses
  shell,   ///< the triangles, of one mass an area
};

/// Each edge of a triangle lies once each way, so that the surface encloses a volume.
bool is_closed(const Mesh& mesh);

/// Below 0 where a closed mesh is inside out. Of a mesh with holes it means little.
double signed_volume(const Mesh& mesh);

/// Of density 1 a volume, or an area for a shell. The rule is not convex: that is solid_of(Hull).
Inertia inertia_of(const Mesh& mesh, MeshRule rule);

}  // namespace lockstep::importer
