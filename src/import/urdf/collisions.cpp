// <collision>, shape by shape. SPDX-License-Identifier: Apache-2.0
#include "collisions.h"

#include "import/solids.h"
#include "model/trees.h"
#include "origin.h"

namespace lockstep::importer::urdf {
namespace {

double length(Element& shape, const char* attribute, bool may_be_zero = false) {
  const double value = shape.number(attribute);
  if (value < 0.0 || (value == 0.0 && !may_be_zero))
    shape.fail(std::string(attribute) + " is not above 0, so the shape has no volume", "give its size in metres");
  return value;
}

}  // namespace

Shapes read_shapes(Element& link, const std::string& name) {
  Shapes shapes;
  link.each_child("collision", [&](Element collision) {
    collision.rename("collision of " + link.title());
    ++shapes.collisions;
    const Eigen::Isometry3d pose = read_origin(collision);
    const auto add = [&](const Inertia& solid) { shapes.solid = shapes.solid + transformed(solid, pose); };
    const auto collide = [&](const Shape& shape) {
      const std::size_t number = shapes.colliders.size() + 1;
      shapes.colliders.push_back({.name = number == 1 ? name : name + "#" + std::to_string(number),
                                  .link = name,
                                  .shape = shape,
                                  .pose = pose,
                                  .group = "robot"});
    };
    std::optional<Element> geometry = collision.child("geometry");
    if (!geometry) return;
    geometry->each_child("mesh", [&](const Element&) { ++shapes.meshes; });
    geometry->each_child("box", [&](Element box) {
      const Eigen::Vector3d size = box.triple("size");
      if (!(size.minCoeff() > 0.0)) box.fail("size is not above 0, so the shape has no volume", "give it in metres");
      add(Inertia::box(size.prod(), size, Eigen::Vector3d::Zero()));
      collide(Shape::box(size));
    });
    geometry->each_child("sphere", [&](Element sphere) {
      const double radius = length(sphere, "radius");
      add(solid_capsule(radius, 0.0));
      collide(Shape::sphere(radius));
    });
    geometry->each_child("cylinder", [&](Element shape) {
      const double radius = length(shape, "radius");
      add(solid_cylinder(radius, length(shape, "length")));
      ++shapes.cylinders;
    });
    geometry->each_child("capsule", [&](Element shape) {
      const double radius = length(shape, "radius");
      const double height = length(shape, "length", true);
      add(solid_capsule(radius, height));
      collide(height > 0.0 ? Shape::capsule(radius, height) : Shape::sphere(radius));
    });
    geometry->tally_rest();
  });
  return shapes;
}

}  // namespace lockstep::importer::urdf
