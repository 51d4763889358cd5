// SPDX-License-Identifier: Apache-2.0
#include "meshes.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string_view>

#include "lockstep/error.h"
#include "model/shapes.h"
#include "model/trees.h"

namespace lockstep::importer::mjcf {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Fail fail_at(const Element& element) {
  return [&element](const std::string& rule, const std::string& remedy) { element.fail(rule, remedy); };
}

// The vertices v of a file stand at S R^T (v - p). That MuJoCo scales last is measured.
Eigen::Affine3d placed_by(const Element& element) {
  const Vector3d scale = element.triple("scale", Vector3d::Ones());
  const Vector3d position = element.triple("refpos", Vector3d::Zero());
  double quat[] = {1.0, 0.0, 0.0, 0.0};
  element.numbers("refquat", quat, 4, 4);
  const Eigen::Quaterniond turn(quat[0], quat[1], quat[2], quat[3]);
  if (!(turn.norm() > 1e-10)) element.fail("has a refquat without length", "give a quaternion, w first");
  Eigen::Affine3d placed;
  placed.linear() = scale.asDiagonal() * turn.normalized().toRotationMatrix().transpose();
  placed.translation() = -placed.linear() * position;
  return placed;
}

std::vector<double> numbers_of(const Element& element, const char* attribute) {
  const char* text = element.xml().Attribute(attribute);
  return element.all_numbers(attribute, text ? std::string_view(text).size() / 2 + 1 : 0);
}

// The frame of a mesh's centre and principal axes, and half the edges of the box with its moments (M160), the longest
// last.
struct InertiaBox {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  Vector3d half_edges;

  explicit InertiaBox(const Inertia& inertia) {
    const Eigen::SelfAdjointEigenSolver<Matrix3d> principal(inertia.about_center);
    Matrix3d axes = principal.eigenvectors().rowwise().reverse();
    if (axes.determinant() < 0.0) axes.col(0) = -axes.col(0);
    pose.linear() = axes;
    pose.translation() = inertia.center;
    const Vector3d moments = principal.eigenvalues().reverse();
    for (int i = 0; i < 3; ++i)
      half_edges[i] = std::sqrt(std::max(0.0, 1.5 * (moments.sum() - 2.0 * moments[i]) / inertia.mass));
  }
};

Vector3d sizes_of_box(GeomType type, const Vector3d& half_edges) {
  const double radius = 0.5 * (half_edges[0] + half_edges[1]);
  switch (type) {
    case GeomType::sphere: return {half_edges.mean(), 0.0, 0.0};
    case GeomType::capsule: return {radius, std::max(0.0, half_edges[2] - 0.5 * radius), 0.0};
    case GeomType::cylinder: return {radius, half_edges[2], 0.0};
    default: return half_edges;
  }
}

// From half the extents of a mesh: MuJoCo 3.14 encloses its middle, not its corners.
Vector3d sizes_of_extents(GeomType type, const Vector3d& half) {
  const double radius = std::max(half[0], half[1]);
  switch (type) {
    case GeomType::sphere: return {half.maxCoeff(), 0.0, 0.0};
    case GeomType::capsule: return {radius, std::max(0.0, half[2] - radius), 0.0};
    case GeomType::cylinder: return {radius, half[2], 0.0};
    default: return half;
  }
}

}  // namespace

Meshes::Asset& Meshes::asset_of(const GeomPart& geom) {
  if (const auto known = assets_.find(geom.mesh); known != assets_.end()) return known->second;
  Element element = elements_.find(geom, geom.mesh);
  const MeshRule rule = static_cast<MeshRule>(element.word("inertia", {"legacy", "convex", "exact", "shell"},
                                                           static_cast<int>(settings_.of(element).mesh_rule)));
  const int most = element.whole("maxhullvert", -1);
  std::string file = element.name("file", "");
  if (settings_.of(element).strips_paths) file = file.substr(file.find_last_of("/\\") + 1);
  if (most < 4 && most != -1) element.fail("has a maxhullvert below 4", "give -1, or 4 and more");
  std::string unreadable;
  if (element.has("builtin") || element.has("plugin"))
    unreadable = "is one that MuJoCo makes: let MuJoCo save the model, and read that";
  else if (!file.empty())
    unreadable = MeshFiles::unreadable(file);
  else if (!element.has("vertex"))
    element.fail("has neither a file nor vertices", "give one of them");
  return assets_
      .emplace(geom.mesh, Asset{element, file, unreadable, rule, most == -1 ? most_hull_corners : most, nullptr})
      .first->second;
}

std::string Meshes::unreadable(const GeomPart& geom) { return asset_of(geom).unreadable; }

const Solid& Meshes::read(Asset& asset) {
  if (asset.solid) return *asset.solid;
  const Eigen::Affine3d placed = placed_by(asset.element);
  if (!asset.file.empty() && asset.element.has("vertex"))
    asset.element.fail("has a file and vertices", "keep one of them");
  asset.solid =
      asset.file.empty()
          ? &solids_.emplace(asset.element.title(), from_vertices(asset.element, placed)).first->second
          : &files_.solid(asset.file, settings_.of(asset.element).mesh_folder, placed, fail_at(asset.element));
  return *asset.solid;
}

Solid Meshes::from_vertices(const Element& element, const Eigen::Affine3d& placed) const {
  const std::vector<double> coordinates = numbers_of(element, "vertex"), indices = numbers_of(element, "face");
  if (coordinates.size() % 3 != 0 || indices.size() % 3 != 0)
    element.fail("has vertices or faces that are not threes of numbers", "give three for each");
  const auto vertices = static_cast<Eigen::Index>(coordinates.size() / 3);
  for (const double index : indices)
    if (!(index >= 0.0 && index < static_cast<double>(vertices)) || index != std::floor(index))
      element.fail(fmt::format("has a face with {}, which is none of its {} vertices", index, vertices),
                   "count vertices from 0");
  Eigen::Matrix3Xi faces =
      Eigen::Map<const Eigen::Matrix3Xd>(indices.data(), 3, static_cast<Eigen::Index>(indices.size() / 3)).cast<int>();
  if (placed.linear().determinant() < 0.0) faces.row(1).swap(faces.row(2));
  return Solid(
      merged(placed * Eigen::Matrix3Xd(Eigen::Map<const Eigen::Matrix3Xd>(coordinates.data(), 3, vertices)), faces));
}

Inertia Meshes::inertia_of(const GeomPart& geom, Asset& asset) {
  if (!asset.unreadable.empty())
    geom.element.fail(fmt::format("has mesh '{}', which {}", geom.mesh, asset.unreadable),
                      "or add an <inertial> to the body, or leave such meshes out: ImportOptions::leave_out_meshes");
  try {
    return read(asset).inertia(asset.rule);
  } catch (const std::invalid_argument& error) {
    asset.element.fail(error.what(),
                       "correct the mesh, choose another inertia for it, or add an <inertial> to the body");
  }
}

void Meshes::tell_excess(const GeomPart& geom, Asset& asset) {
  if (asset.rule != MeshRule::legacy || !asset.solid->is_closed() || asset.is_told) return;
  asset.is_told = true;
  const double exact = asset.solid->volume(), legacy = asset.solid->inertia(MeshRule::legacy).mass;
  if (legacy > 1.01 * exact && exact > 0.0)
    document_.report().remark("masses of concave meshes, too high as in MuJoCo: inertia=\"exact\" would mend them",
                              fmt::format("{} {:.3g} times", geom.mesh, legacy / exact));
}

PlacedShape Meshes::around_mesh(const GeomPart& geom) {
  Asset& asset = asset_of(geom);
  const InertiaBox box(inertia_of(geom, asset));
  const double scale = geom.element.number("fitscale", 1.0);
  if (!(scale > 0.0)) geom.element.fail("has a fitscale that is not above 0", "give a factor such as 1");
  PlacedShape placed{{}, geom.pose * box.pose};
  Vector3d sizes = sizes_of_box(geom.type, box.half_edges);
  if (settings_.fits_extents) {
    const Eigen::Matrix3Xd points = box.pose.inverse() * asset.solid->vertices();
    const Vector3d lowest = points.rowwise().minCoeff(), highest = points.rowwise().maxCoeff();
    placed.pose = placed.pose * Eigen::Translation3d(0.5 * (lowest + highest));
    sizes = sizes_of_extents(geom.type, 0.5 * (highest - lowest));
  }
  for (int i = 0; i < 3; ++i)
    if (!(sizes[i] > 0.0) && (i == 0 || geom.type == GeomType::box || geom.type == GeomType::ellipsoid))
      geom.element.fail("lies around a mesh that is flat", "give the geom a size in place of the mesh");
  GeomPart around = geom;
  around.size = scale * sizes;
  if (around.type == GeomType::capsule && !(around.size[1] > 0.0)) around.type = GeomType::sphere;
  const std::optional<Shape> shape = primitive_of(around);
  if (!shape || shape->kind == ShapeKind::half_space)
    geom.element.fail("is of a type that cannot lie around a mesh",
                      "make it a box, capsule, cylinder, ellipsoid or sphere");
  placed.shape = *shape;
  return placed;
}

std::optional<PlacedShape> Meshes::shape_of(const GeomPart& geom, const std::string& link, const std::string& item) {
  if (!geom.mesh.empty() && files_.fit_of(link) == Fit::none) return std::nullopt;
  if (geom.type == GeomType::mesh) {
    Asset& asset = asset_of(geom);
    const Fitted& fitted =
        files_.shape_of(read(asset), link, item, std::max(4, asset.most_corners), fail_at(asset.element));
    return PlacedShape{fitted.shape, geom.pose * fitted.pose};
  }
  if (geom.type == GeomType::hfield) {
    const std::optional<Shape> field = height_fields_.shape_of(geom);
    return field ? std::optional(PlacedShape{*field, geom.pose}) : std::nullopt;
  }
  if (geom.type != GeomType::sdf && !geom.mesh.empty()) return around_mesh(geom);
  const std::optional<Shape> shape = primitive_of(geom);
  return shape ? std::optional(PlacedShape{*shape, geom.pose}) : std::nullopt;
}

Inertia Meshes::inertia_of(const GeomPart& geom) {
  if (has_mesh(geom)) {
    Asset& asset = asset_of(geom);
    const Inertia inertia = inertia_of(geom, asset);
    if (!geom.element.has("mass")) tell_excess(geom, asset);
    return transformed(inertia, geom.pose);
  }
  if (!geom.mesh.empty()) {
    const PlacedShape placed = around_mesh(geom);
    return transformed(solid_of(placed.shape), placed.pose);
  }
  const std::optional<Shape> shape = primitive_of(geom);
  return shape ? transformed(solid_of(*shape), geom.pose) : Inertia();
}

}  // namespace lockstep::importer::mjcf
