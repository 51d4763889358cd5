// SPDX-License-Identifier: Apache-2.0
#include "mesh.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <vector>

namespace lockstep::importer {

Mesh merged(const Eigen::Matrix3Xd& vertices, const Eigen::Matrix3Xi& triangles) {
  std::vector<Eigen::Index> order(static_cast<std::size_t>(vertices.cols())), firsts;
  std::iota(order.begin(), order.end(), Eigen::Index{0});
  const auto place = [&](Eigen::Index i) { return std::array{vertices(0, i), vertices(1, i), vertices(2, i)}; };
  std::stable_sort(order.begin(), order.end(), [&](Eigen::Index a, Eigen::Index b) { return place(a) < place(b); });
  std::vector<int> number_of(order.size());  // by the vertex as given
  for (const Eigen::Index vertex : order) {
    if (firsts.empty() || place(firsts.back()) != place(vertex)) firsts.push_back(vertex);
    number_of[static_cast<std::size_t>(vertex)] = static_cast<int>(firsts.size()) - 1;
  }
  Mesh mesh;
  mesh.vertices = vertices(Eigen::all, firsts);
  mesh.triangles.resize(3, triangles.cols());
  Eigen::Index kept = 0;
  for (const auto& triangle : triangles.colwise()) {
    const Eigen::Vector3i corners =
        triangle.unaryExpr([&](int corner) { return number_of[static_cast<std::size_t>(corner)]; });
    if (corners[0] != corners[1] && corners[1] != corners[2] && corners[2] != corners[0])
      mesh.triangles.col(kept++) = corners;
  }
  mesh.triangles.conservativeResize(3, kept);
  return mesh;
}

}  // namespace lockstep::importer
