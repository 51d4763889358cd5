// <collision>, shape by shape. SPDX-License-Identifier: Apache-2.0
#include "collisions.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "import/repair.h"
#include "model/shapes.h"
#include "model/trees.h"
#include "origin.h"

namespace lockstep::importer::urdf {
namespace {

double length(Element& shape, const char* attribute) {
  const double value = shape.number(attribute);
  if (value < 0.0) shape.fail(std::string(attribute) + " is below 0", "give its size in metres");
  return value;
}

Fail fail_at(const Element& element) {
  return [&element](const std::string& rule, const std::string& remedy) { element.fail(rule, remedy); };
}

// Of density 1, in the frame of the mesh.
Inertia weighed(const Solid& solid, const Element& mesh, const std::string& link) {
  const bool is_closed = solid.is_closed();
  if (!is_closed) mesh.report().warn("collision meshes that are not closed, whose hulls give inertia", link);
  try {
    return solid.inertia(is_closed ? MeshRule::exact : MeshRule::convex);
  } catch (const std::invalid_argument& error) {
    mesh.fail(error.what(), "correct the mesh, or give the link an <inertial>");
  }
}

// Reads the <collision> elements of one link.
class Reader {
 public:
  Reader(const std::string& link, const ImportOptions& options, bool weighs, MeshFiles& meshes)
      : link_(link), options_(options), weighs_(weighs), meshes_(meshes) {}

  void read(Element collision) {
    ++shapes.collisions;
    const Eigen::Isometry3d pose = read_origin(collision);
    std::optional<Element> geometry = collision.child("geometry");
    if (!geometry) return;
    geometry->each_child("mesh", [&](Element mesh) { read_mesh(mesh, pose); });
    geometry->each_child("box", [&](Element box) {
      const Eigen::Vector3d size = box.triple("size");
      if (size.minCoeff() < 0.0) box.fail("size is below 0", "give it in metres");
      if (has_volume(box, size.minCoeff())) add(Shape::box(size), pose);
    });
    geometry->each_child("sphere", [&](Element sphere) {
      const double radius = length(sphere, "radius");
      if (has_volume(sphere, radius)) add(Shape::sphere(radius), pose);
    });
    geometry->each_child("cylinder", [&](Element shape) {
      const double radius = length(shape, "radius"), height = length(shape, "length");
      if (has_volume(shape, std::min(radius, height))) add(Shape::cylinder(radius, height), pose);
    });
    geometry->each_child("capsule", [&](Element shape) {
      const double radius = length(shape, "radius"), height = length(shape, "length");
      if (has_volume(shape, radius)) add(height > 0.0 ? Shape::capsule(radius, height) : Shape::sphere(radius), pose);
    });
    geometry->tally_rest();
  }

  Shapes shapes = {};

 private:
  bool has_volume(const Element& shape, double least_length) const {
    if (!(least_length > 0.0))
      shape.report().warn("collision shapes of size 0, left out", fmt::format("{} of {}", shape.title(), link_));
    return least_length > 0.0;
  }

  std::string next_name() const {
    const std::size_t number = shapes.colliders.size() + 1;
    return number == 1 ? link_ : link_ + "#" + std::to_string(number);
  }

  void collide(const Shape& shape, const Eigen::Isometry3d& pose) {
    shapes.colliders.push_back({.name = next_name(), .link = link_, .shape = shape, .pose = pose, .group = "robot"});
  }

  void add(const Shape& shape, const Eigen::Isometry3d& pose) {
    shapes.solid = shapes.solid + transformed(solid_of(shape), pose);
    collide(shape, pose);
  }

  void read_mesh(Element& mesh, const Eigen::Isometry3d& pose) {
    if (options_.leave_out_meshes) return leave_out(mesh, "collision meshes, left out on request", link_);
    if (!mesh.report().attempt([&] { open_mesh(mesh, pose); })) ++shapes.meshes;
  }

  void open_mesh(Element& mesh, const Eigen::Isometry3d& pose) {
    const bool touches = options_.colliders && meshes_.fit_of(link_) != Fit::none;
    if (options_.colliders && !touches) mesh.report().remark("collision meshes that touch nothing: of fit none", link_);
    if (!touches && !weighs_) return;
    const std::string name = mesh.name("filename");
    if (const std::string reason = MeshFiles::unreadable(name); !reason.empty())
      return leave_out(mesh, left_out_meshes, fmt::format("that of {} {}", link_, reason));
    mesh.rename(mesh.title() + " of link '" + link_ + "'");
    // When inertia is asked for, the mesh may turn out not to be needed.
    const auto solid = [&meshes = meshes_, mesh, name,
                        scale = mesh.triple("scale", Eigen::Vector3d::Ones())]() -> const Solid& {
      return meshes.solid(name, "", Eigen::Affine3d(Eigen::Scaling(scale)), fail_at(mesh));
    };
    if (weighs_)
      shapes.mesh_solids.push_back(
          [solid, mesh, pose, link = link_] { return transformed(weighed(solid(), mesh, link), pose); });
    if (!touches) return;
    const Fitted& fitted = meshes_.shape_of(solid(), link_, next_name(), most_hull_corners, fail_at(mesh));
    collide(fitted.shape, pose * fitted.pose);
  }

  void leave_out(const Element& mesh, const char* what, const std::string& item) {
    ++shapes.meshes;
    mesh.report().warn(what, item);
  }

  const std::string& link_;
  const ImportOptions& options_;
  const bool weighs_;
  MeshFiles& meshes_;
};

}  // namespace

Shapes read_shapes(Element& link, const std::string& name, const ImportOptions& options, bool weighs,
                   MeshFiles& meshes) {
  Reader reader(name, options, weighs, meshes);
  link.each_child("collision", [&](Element collision) {
    collision.rename("collision of " + link.title());
    reader.read(std::move(collision));
  });
  return std::move(reader.shapes);
}

}  // namespace lockstep::importer::urdf
