// Triangles of a mesh. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>

namespace lockstep::importer {

struct Mesh {
  Eigen::Matrix3Xd vertices;   ///< m, no two at one place
  Eigen::Matrix3Xi triangles;  ///< numbers of three different vertices, to the left as seen from outside
};

/// Makes vertices at one place one vertex, and drops triangles that have one of them twice.
Mesh merged(const Eigen::Matrix3Xd& vertices, const Eigen::Matrix3Xi& triangles);

/// Throws an error about a place in a file: "line 3", "byte 84".
using FailAt = std::function<void(const std::string& place, const std::string& rule, const std::string& remedy)>;

}  // namespace lockstep::importer
