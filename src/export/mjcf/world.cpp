// <worldbody>: bodies, joints, sites and geoms. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "model/softness_numbers.h"
#include "sections.h"

namespace lockstep::exporter::mjcf {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

// MuJoCo wants two ends of a range, the lower one first, and takes no denormal numbers.
constexpr double open_end = 1e10, least_width = 1e-300;

void place(Xml& xml, const Vector3d& position, Eigen::Quaterniond turn) {
  if (!position.isZero(0.0)) xml.set("pos", numbers(position));
  turn.normalize();
  if (turn.w() < 0.0) turn.coeffs() = -turn.coeffs();
  if (turn.w() != 1.0) xml.set("quat", numbers({turn.w(), turn.x(), turn.y(), turn.z()}));
}

void place(Xml& xml, const Isometry3d& pose) { place(xml, pose.translation(), Eigen::Quaterniond(pose.linear())); }

class World {
 public:
  explicit World(const Writing& writing)
      : writing_(writing), model_(writing.model), report_(writing.report), xml_(writing.xml) {}

  void write() {
    xml_.open("worldbody");
    for (const Collider& collider : model_.colliders)
      if (collider.link.empty()) write_geom(collider);
    for (std::size_t i = 0; i < writing_.layout.is_world.size(); ++i)
      if (writing_.layout.is_world[i]) write_parts(model_.links[i].name);
    for (const int body : writing_.layout.in_world) write_body(body, 3);
    xml_.close();
  }

 private:
  // `depth` is that of the element, whose own elements are one deeper.
  void write_body(int index, int depth) {
    const Body& body = writing_.layout.bodies[static_cast<std::size_t>(index)];
    if (depth + 1 == TINYXML2_MAX_ELEMENT_DEPTH)
      report_.warn("bodies nested so deep that readers by tinyxml2 do not follow", body.name);
    xml_.open("body").set("name", body.name);
    place(xml_, body.pose);
    if (body.floats) xml_.open("freejoint").close();
    for (const JointPlace& joint : body.joints) write_joint(joint);
    if (!body.inertial.is_none()) {
      xml_.open("inertial").set("pos", numbers(body.inertial.center)).set("mass", numbers(body.inertial.mass));
      place(xml_, Vector3d::Zero(), body.inertial.axes);
      xml_.set("diaginertia", numbers(body.inertial.moments)).close();
    }
    write_parts(model_.links[static_cast<std::size_t>(body.link)].name);
    for (const int child : body.children) write_body(child, depth + 1);
    xml_.close();
  }

  void write_joint(const JointPlace& where) {
    const Joint& joint = model_.joints[static_cast<std::size_t>(where.joint)];
    const bool slides = joint.kind == JointKind::prismatic;
    xml_.open("joint").set("name", joint.name).set("type", slides ? "slide" : "hinge");
    if (!slides && !where.pose.translation().isZero(0.0)) xml_.set("pos", numbers(where.pose.translation()));
    xml_.set("axis", numbers(Vector3d(where.pose.linear() * joint.axis.normalized())));
    write_range(joint);
    xml_.set_unless(0.0, "damping", joint.damping)
        .set_unless(0.0, "armature", joint.armature)
        .set_unless(0.0, "frictionloss", joint.friction);
    if (joint.stiffness > 0.0) xml_.set("stiffness", numbers(joint.stiffness)).set_unless(0.0, "springref", joint.rest);
    if (joint.effort_limit < infinity) {
      const double limit = std::max(joint.effort_limit, least_width);
      xml_.set("actuatorfrclimited", "true").set("actuatorfrcrange", numbers({-limit, limit}));
    }
    xml_.close();
    report_losses(joint);
  }

  void write_range(const Joint& joint) {
    const bool has_lower = joint.lower > -infinity, has_upper = joint.upper < infinity;
    if (!has_lower && !has_upper) {
      if (joint.kind == JointKind::revolute)
        report_.remark("revolute joints without a range, which are continuous in MJCF", joint.name);
      return;
    }
    double lower = std::max(joint.lower, -open_end), upper = std::min(joint.upper, open_end);
    if (!has_lower || !has_upper)
      report_.remark(fmt::format("ranges with an open end, written as {:g}", open_end), joint.name);
    if (lower == upper) upper = std::max(std::nextafter(upper, infinity), upper + least_width);
    xml_.set("limited", "true").set("range", numbers({lower, upper}));
    report_.remark("position limits, soft in MuJoCo", joint.name);
  }

  void report_losses(const Joint& joint) {
    const bool has_range = joint.lower > -infinity || joint.upper < infinity;
    if (joint.friction > 0.0) report_.remark("dry friction, soft in MuJoCo", joint.name);
    if (joint.velocity_limit < infinity) report_.warn("velocity limits, left out", joint.name);
    if (!has_range) return;
    if (!is_hard(joint.limit_softness))
      report_.warn("softness of position limits, left out: they are MuJoCo's", joint.name);
    else if (erp_of(joint.limit_softness) != Hard().erp)
      report_.remark("shares of an error that a step corrects (erp), left out", joint.name);
    if (joint.restitution > 0.0) report_.warn("restitution of position limits, left out", joint.name);
  }

  // Sites and geoms of a link.
  void write_parts(const std::string& link) {
    for (const Site& site : model_.sites) {
      if (site.link != link) continue;
      xml_.open("site").set("name", site.name);
      place(xml_, site.pose);
      xml_.close();
    }
    for (const Collider& collider : model_.colliders)
      if (collider.link == link) write_geom(collider);
  }

  // Only pairs touch, so the geom's own masks are 0.
  void write_geom(const Collider& collider) {
    const Vector3d& size = collider.shape.size;
    xml_.open("geom").set("name", collider.name);
    switch (collider.shape.kind) {
      case ShapeKind::half_space: xml_.set("type", "plane").set("size", "0 0 1"); break;
      case ShapeKind::box: xml_.set("type", "box").set("size", numbers(Vector3d(0.5 * size))); break;
      case ShapeKind::capsule: xml_.set("type", "capsule").set("size", numbers({size[0], 0.5 * size[1]})); break;
      case ShapeKind::sphere: xml_.set("type", "sphere").set("size", numbers(size[0])); break;
    }
    place(xml_, collider.pose);
    xml_.set("friction", numbers({collider.friction, 0.005, 0.0001}));
    xml_.set("group", "3").set("contype", "0").set("conaffinity", "0").close();
  }

  const Writing& writing_;
  const Model& model_;
  Report& report_;
  Xml& xml_;
};

}  // namespace

void write_world(const Writing& writing) { World(writing).write(); }

}  // namespace lockstep::exporter::mjcf
