// Height fields of a file. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>

#include "assets.h"
#include "import/meshes/files.h"

namespace lockstep::importer::mjcf {

/// The <hfield> elements of a file. Each is read when a geom first asks for it. Failures are ImportErrors.
class HeightFields {
 public:
  HeightFields(Document& document, const Settings& settings, const Classes& classes, MeshFiles& files)
      : settings_(settings), assets_(document, classes, "hfield", "height field"), files_(files) {}

  /// In the geom's frame. Nothing for a field without numbers, which a program would fill in.
  std::optional<Shape> shape_of(const GeomPart& geom);

 private:
  std::optional<Shape> read(const Element& element) const;
  Eigen::MatrixXd numbers_of(const Element& element) const;

  const Settings& settings_;
  Assets assets_;
  MeshFiles& files_;
  std::map<std::string, std::optional<Shape>> shapes_;  // by name
  long heights_ = 0;                                    // of all geoms
};

}  // namespace lockstep::importer::mjcf
