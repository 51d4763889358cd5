// <collision>, shape by shape. SPDX-License-Identifier: Apache-2.0
#include "collisions.h"

#include "model/shapes.h"
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
    const auto add = [&](const Shape& shape) {
      shapes.solid = shapes.solid + transformed(solid_of(shape), pose);
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
      add(Shape::box(size));
    });
    geometry->each_child("sphere", [&](Element sphere) { add(Shape::sphere(length(sphere, "radius"))); });
    geometry->each_child("cylinder", [&](Element shape) {
      const double radius = length(shape, "radius");
      add(Shape::cylinder(radius, length(shape, "length")));
    });
    geometry->each_child("capsule", [&](Element shape) {
      const double radius = length(shape, "radius");
      const double height = length(shape, "length", true);
      add(height > 0.0 ? Shape::capsule(radius, height) : Shape::sphere(radius));
    });
    geometry->tally_rest();
  });
  return shapes;
}

}  // namespace lockstep::importer::urdf
