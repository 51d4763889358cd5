// Geoms with meshes. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>

#include "assets.h"
#include "bodies.h"
#include "height_fields.h"
#include "import/meshes/files.h"

namespace lockstep::importer::mjcf {

/// A shape in the frame of a geom's body.
struct PlacedShape {
  Shape shape;
  Eigen::Isometry3d pose;
};

/// The <mesh> elements of a file. Each is read when a geom first asks for it. Failures are ImportErrors.
class Meshes {
 public:
  Meshes(Document& document, const Settings& settings, const Classes& classes, MeshFiles& files)
      : document_(document),
        settings_(settings),
        files_(files),
        elements_(document, classes, "mesh", "mesh"),
        height_fields_(document, settings, classes, files) {}

  /// Why the geom's mesh cannot be read, a rule that it breaks; empty where it can.
  std::string unreadable(const GeomPart& geom);
  /// What the geom touches with: its primitive, that around its mesh, or what the fit of `link` makes of its mesh.
  /// Nothing for types that lockstep has no shape of, and for meshes of fit none. `item` names the geom in the report.
  std::optional<PlacedShape> shape_of(const GeomPart& geom, const std::string& link, const std::string& item);
  /// The mesh of a geom, in the geom's frame.
  const Solid& mesh_of(const GeomPart& geom) { return read(asset_of(geom)); }
  /// Of density 1, in the body's frame. Without mass where the type has no volume.
  Inertia inertia_of(const GeomPart& geom);

 private:
  struct Asset {
    Element element;
    std::string file;        // empty: its vertices stand in the element
    std::string unreadable;  // why
    MeshRule rule;
    int most_corners;
    const Solid* solid = nullptr;  // once it is read
    bool is_told = false;          // that it weighs too much
  };

  Asset& asset_of(const GeomPart& geom);
  const Solid& read(Asset& asset);
  Solid from_vertices(const Element& element, const Eigen::Affine3d& placed) const;
  Inertia inertia_of(const GeomPart& geom, Asset& asset);
  void tell_excess(const GeomPart& geom, Asset& asset);
  PlacedShape around_mesh(const GeomPart& geom);

  Document& document_;
  const Settings& settings_;
  MeshFiles& files_;
  Assets elements_;
  HeightFields height_fields_;
  std::map<std::string, Asset> assets_;
  std::map<std::string, Solid> solids_;  // of vertices that stand in elements
};

}  // namespace lockstep::importer::mjcf
