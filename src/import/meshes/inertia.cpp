// SPDX-License-Identifier: Apache-2.0
#include "inertia.h"

#include <Eigen/Dense>
#include <algorithm>
#include <utility>
#include <vector>

namespace lockstep::importer {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Matrix3d corners_of(const Mesh& mesh, Eigen::Index triangle) {
  return mesh.vertices(Eigen::all, mesh.triangles.col(triangle));
}

TetrahedronSum summed(const Mesh& mesh, const Vector3d& apex, bool is_absolute) {
  TetrahedronSum sum(apex);
  for (Eigen::Index i = 0; i < mesh.triangles.cols(); ++i) sum.add(corners_of(mesh, i), is_absolute);
  return sum;
}

// Of one mass an area (M159).
Inertia shell_of(const Mesh& mesh) {
  double area = 0.0;
  Vector3d first = Vector3d::Zero();
  Matrix3d second = Matrix3d::Zero();
  for (Eigen::Index i = 0; i < mesh.triangles.cols(); ++i) {
    const Matrix3d corners = corners_of(mesh, i);
    const Vector3d sum = corners.rowwise().sum();
    const double own = 0.5 * (corners.col(1) - corners.col(0)).cross(corners.col(2) - corners.col(0)).norm();
    area += own;
    first += own / 3.0 * sum;
    second += own / 12.0 * (corners * corners.transpose() + sum * sum.transpose());
  }
  const Vector3d center = first / area;
  second -= area * center * center.transpose();
  return {area, center, second.trace() * Matrix3d::Identity() - second};
}

}  // namespace

bool is_closed(const Mesh& mesh) {
  std::vector<std::pair<int, int>> edges, reversed;
  for (const auto& triangle : mesh.triangles.colwise())
    for (int i = 0; i < 3; ++i) {
      edges.emplace_back(triangle[i], triangle[(i + 1) % 3]);
      reversed.emplace_back(edges.back().second, edges.back().first);
    }
  std::sort(edges.begin(), edges.end());
  std::sort(reversed.begin(), reversed.end());
  return edges == reversed && std::adjacent_find(edges.begin(), edges.end()) == edges.end();
}

double signed_volume(const Mesh& mesh) { return summed(mesh, mesh.vertices.rowwise().mean(), false).volume(); }

// By (M158), which says how MuJoCo's legacy rule takes it twice.
Inertia inertia_of(const Mesh& mesh, MeshRule rule) {
  const Inertia shell = shell_of(mesh);
  if (rule == MeshRule::shell) return shell;
  const bool is_absolute = rule == MeshRule::legacy;
  const Inertia solid = summed(mesh, shell.center, is_absolute).inertia();
  if (!is_absolute) return solid;
  TetrahedronSum about_center = summed(mesh, solid.center, true);
  return {solid.mass, solid.center, about_center.about_apex()};
}

}  // namespace lockstep::importer
