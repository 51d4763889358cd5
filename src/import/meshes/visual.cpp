// SPDX-License-Identifier: Apache-2.0
#include "visual.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <vector>

namespace lockstep::importer {
namespace {

constexpr Eigen::Index most_drawn = 20'000;  // triangles
constexpr double first_cells = 256.0;        // along the longest side of a mesh
constexpr double growth = 1.3;               // of cells, from try to try
constexpr double least_size = 1e-9;          // m, of what has no extent

// All vertices within a cell of a grid become their mean. Triangles of fewer than three cells vanish.
Mesh clustered(const Mesh& mesh, double cell) {
  std::map<std::array<int, 3>, int> number_of;
  std::vector<int> cluster_of, members;
  const Eigen::Vector3d corner = mesh.vertices.rowwise().minCoeff();
  Mesh result;
  result.vertices = Eigen::Matrix3Xd::Zero(3, mesh.vertices.cols());
  for (const auto& vertex : mesh.vertices.colwise()) {
    const Eigen::Vector3i at = ((vertex - corner) / cell).array().floor().cast<int>();
    const int next = static_cast<int>(members.size());
    const auto [found, is_new] = number_of.try_emplace({at[0], at[1], at[2]}, next);
    if (is_new) members.push_back(0);
    const int cluster = found->second;
    cluster_of.push_back(cluster);
    result.vertices.col(cluster) += vertex;
    ++members[static_cast<std::size_t>(cluster)];
  }
  result.vertices.conservativeResize(3, static_cast<Eigen::Index>(members.size()));
  for (Eigen::Index i = 0; i < result.vertices.cols(); ++i)
    result.vertices.col(i) /= members[static_cast<std::size_t>(i)];
  result.triangles = mesh.triangles.unaryExpr([&](int v) { return cluster_of[static_cast<std::size_t>(v)]; });
  return merged(result.vertices, result.triangles);
}

}  // namespace

VisualMesh visual_of(const Solid& solid, const std::string& link, const Eigen::Isometry3d& pose, Report& report) {
  const Mesh whole = solid.surface();
  Mesh shown = whole;
  for (double cell = std::max(solid.size(), least_size) / first_cells; shown.triangles.cols() > most_drawn;
       cell *= growth)
    shown = clustered(whole, cell);
  report.remark("visual meshes, for pages alone", link);
  if (shown.triangles.cols() < whole.triangles.cols())
    report.remark("visual meshes that are simplified",
                  fmt::format("{}: {} of {} triangles", link, shown.triangles.cols(), whole.triangles.cols()));
  return {link, (pose * shown.vertices).cast<float>(), shown.triangles};
}

}  // namespace lockstep::importer
