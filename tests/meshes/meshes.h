// Meshes of known shape, and files of them. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "import/meshes/mesh.h"

namespace lockstep::meshes {

using importer::Mesh;

inline Mesh mesh_of(const std::vector<Eigen::Vector3d>& vertices, const std::vector<std::array<int, 3>>& triangles) {
  Mesh mesh{Eigen::Matrix3Xd(3, vertices.size()), Eigen::Matrix3Xi(3, triangles.size())};
  for (std::size_t i = 0; i < vertices.size(); ++i) mesh.vertices.col(static_cast<Eigen::Index>(i)) = vertices[i];
  for (std::size_t i = 0; i < triangles.size(); ++i)
    mesh.triangles.col(static_cast<Eigen::Index>(i)) << triangles[i][0], triangles[i][1], triangles[i][2];
  return mesh;
}

/// A polygon to the left in the x-z plane, cut into triangles, and moved along y.
inline Mesh prism(const std::vector<std::array<double, 2>>& polygon, const std::vector<std::array<int, 3>>& cut,
                  double depth) {
  const int n = static_cast<int>(polygon.size());
  std::vector<Eigen::Vector3d> vertices;
  for (const double y : {0.0, depth})
    for (const auto& [x, z] : polygon) vertices.emplace_back(x, y, z);
  std::vector<std::array<int, 3>> triangles;
  for (const auto& [a, b, c] : cut) {
    triangles.push_back({a, b, c});
    triangles.push_back({a + n, c + n, b + n});
  }
  for (int i = 0; i < n; ++i) {
    const int j = (i + 1) % n;
    triangles.push_back({i, i + n, j});
    triangles.push_back({j, i + n, j + n});
  }
  return mesh_of(vertices, triangles);
}

/// 0.3 x 0.15 x 0.2 m with a slot from above: 7.5 of the 9 litres of its hull.
inline Mesh u_mount() {
  return prism({{0, 0}, {.3, 0}, {.3, .2}, {.2, .2}, {.2, .1}, {.1, .1}, {.1, .2}, {0, .2}},
               {{{0, 1, 4}}, {{0, 4, 5}}, {{1, 2, 3}}, {{1, 3, 4}}, {{0, 5, 6}}, {{0, 6, 7}}}, 0.15);
}

/// A box from the origin.
inline Mesh block(double x, double y, double z) {
  return prism({{0, 0}, {x, 0}, {x, z}, {0, z}}, {{{0, 1, 2}}, {{0, 2, 3}}}, y);
}

/// About z, cut into `around` by `across` squares.
inline Mesh torus(double large, double small, int around, int across) {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<std::array<int, 3>> triangles;
  const double turn = 2.0 * std::acos(-1.0);
  const auto at = [&](int i, int j) { return (i % around) * across + j % across; };
  for (int i = 0; i < around; ++i)
    for (int j = 0; j < across; ++j) {
      const double u = turn * i / around, v = turn * j / across, r = large + small * std::cos(v);
      vertices.emplace_back(r * std::cos(u), r * std::sin(u), small * std::sin(v));
      triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return mesh_of(vertices, triangles);
}

template <class Number>
void append(std::string& bytes, Number number) {
  char raw[sizeof(Number)];
  std::memcpy(raw, &number, sizeof(Number));
  bytes.append(raw, sizeof(Number));
}

inline std::string as_binary_stl(const Mesh& mesh, const std::string& header = "made by a test") {
  std::string bytes = header;
  bytes.resize(80, ' ');
  append(bytes, static_cast<std::uint32_t>(mesh.triangles.cols()));
  for (const auto& triangle : mesh.triangles.colwise()) {
    for (int i = 0; i < 3; ++i) append(bytes, 0.0f);
    for (const int corner : triangle)
      for (const double x : mesh.vertices.col(corner)) append(bytes, static_cast<float>(x));
    append(bytes, std::uint16_t{0});
  }
  return bytes;
}

inline std::string words(const Eigen::Vector3d& point) {
  char text[100];
  std::snprintf(text, sizeof(text), "%.17g %.17g %.17g", point.x(), point.y(), point.z());
  return text;
}

inline std::string as_text_stl(const Mesh& mesh) {
  std::string text = "solid of vertex 1\n";
  for (const auto& triangle : mesh.triangles.colwise()) {
    text += "  facet normal 0 0 0\n    outer loop\n";
    for (const int corner : triangle) text += "      vertex " + words(mesh.vertices.col(corner)) + "\n";
    text += "    endloop\n  endfacet\n";
  }
  return text + "endsolid\n";
}

inline std::string as_obj(const Mesh& mesh) {
  std::string text = "# a comment\nmtllib none.mtl\no one\n";
  for (const auto& vertex : mesh.vertices.colwise()) text += "v " + words(vertex) + "\n";
  text += "vn 0 0 1\nvt 0 0\n";
  const int last = static_cast<int>(mesh.vertices.cols());
  int way = 0;  // how a face names its vertices
  for (const auto& triangle : mesh.triangles.colwise()) {
    text += "f";
    for (const int corner : triangle) {
      const int index = way % 2 == 0 ? corner + 1 : corner - last;
      text += " " + std::to_string(index) + (way % 3 == 0 ? "" : way % 3 == 1 ? "/1/1" : "//1");
    }
    text += way++ % 2 == 0 ? "\r\n" : "\n";
  }
  return text;
}

inline std::string as_msh(const Mesh& mesh, bool has_triangles = true) {
  std::string bytes;
  const auto triangles = static_cast<std::int32_t>(has_triangles ? mesh.triangles.cols() : 0);
  for (const std::int32_t count : {static_cast<std::int32_t>(mesh.vertices.cols()), 0, 0, triangles})
    append(bytes, count);
  for (const double x : mesh.vertices.reshaped()) append(bytes, static_cast<float>(x));
  if (has_triangles)
    for (const int corner : mesh.triangles.reshaped()) append(bytes, static_cast<std::int32_t>(corner));
  return bytes;
}

/// A folder for one test, gone with it.
class Folder {
 public:
  Folder() : path_(std::filesystem::temp_directory_path() / ("lockstep_meshes_" + std::to_string(getpid()))) {
    std::filesystem::remove_all(path_);
    std::filesystem::create_directories(path_);
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  /// Writes a file and the folders above it; its path.
  std::string write(const std::string& name, const std::string& content) const {
    const std::filesystem::path file = path_ / name;
    std::filesystem::create_directories(file.parent_path());
    std::ofstream(file, std::ios::binary) << content;
    return file.string();
  }
  std::string operator/(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

}  // namespace lockstep::meshes
