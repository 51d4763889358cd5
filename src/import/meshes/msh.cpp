// MSH, MuJoCo's table of vertices and triangles. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cstdint>
#include <cstring>

#include "formats.h"

namespace lockstep::importer {

Mesh read_msh(std::string_view content, const FailAt& fail) {
  if (content.starts_with("$MeshFormat"))
    fail("byte 0", "is a file of Gmsh, which is not MuJoCo's MSH", "save the mesh as STL or OBJ");
  constexpr std::size_t header = 16;
  std::int32_t counts[4] = {};  // of vertices, normals, texture coordinates, triangles
  if (content.size() < header) fail("byte 0", "is shorter than the header of 16 bytes", "save the mesh anew");
  std::memcpy(counts, content.data(), header);
  const auto [vertices, normals, textures, triangles] = counts;
  for (const std::int32_t count : counts)
    if (count < 0 || count > 3 * most_triangles)
      fail("byte 0", fmt::format("has the count {}", count), "save the mesh anew");
  const std::size_t size = header + 12 * static_cast<std::size_t>(vertices) + 12 * static_cast<std::size_t>(normals) +
                           8 * static_cast<std::size_t>(textures) + 12 * static_cast<std::size_t>(triangles);
  if (content.size() != size)
    fail("byte 0", fmt::format("has {} bytes, but counts {}", content.size(), size), "save the mesh anew");
  if (triangles > most_triangles)
    fail("byte 12", fmt::format("has {} triangles, more than {}", triangles, most_triangles), "simplify the mesh");
  Eigen::Matrix3Xf table(3, vertices);
  if (vertices > 0) std::memcpy(table.data(), content.data() + header, 12 * static_cast<std::size_t>(vertices));
  Eigen::Matrix3Xi corners(3, triangles);
  const std::size_t begin = size - 12 * static_cast<std::size_t>(triangles);
  if (triangles > 0) std::memcpy(corners.data(), content.data() + begin, 12 * static_cast<std::size_t>(triangles));
  const Eigen::Matrix3Xd places = table.cast<double>();
  require_near(places, fail, [](Eigen::Index vertex) {
    return fmt::format("byte {}", header + 12 * static_cast<std::size_t>(vertex));
  });
  for (Eigen::Index i = 0; i < corners.cols(); ++i)
    if (corners.col(i).minCoeff() < 0 || corners.col(i).maxCoeff() >= vertices)
      fail(fmt::format("byte {}", begin + 12 * static_cast<std::size_t>(i)),
           fmt::format("has a triangle with an index of none of its {} vertices", vertices), "save the mesh anew");
  return merged(places, corners);
}

}  // namespace lockstep::importer
