// Formats of mesh files. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "mesh.h"

namespace lockstep::importer {

constexpr Eigen::Index most_triangles = 2'000'000;

/// Each reads the whole content of a file, and fails where it is not what the format says: a number that is not
/// finite, an index of no vertex, no triangle, too many of them. MSH alone may have vertices without triangles.
Mesh read_stl(std::string_view content, const FailAt& fail);  ///< binary or text
Mesh read_obj(std::string_view content, const FailAt& fail);  ///< vertices and faces; a polygon is taken for convex
Mesh read_msh(std::string_view content, const FailAt& fail);  ///< MuJoCo's own binary format

/// Fails at the first vertex that is not finite or farther than 1e6 m out along an axis. `place_of` names it.
template <class PlaceOf>
void require_near(const Eigen::Matrix3Xd& vertices, const FailAt& fail, PlaceOf place_of) {
  for (Eigen::Index i = 0; i < vertices.cols(); ++i)
    if (!(vertices.col(i).cwiseAbs().maxCoeff() <= 1e6))  // also not a number
      fail(place_of(i), "has a coordinate that is not finite, or beyond a million metres", "save the mesh anew");
}

}  // namespace lockstep::importer
