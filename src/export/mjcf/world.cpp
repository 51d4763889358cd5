// <worldbody>: bodies, joints, sites and geoms. SPDX-License-Identifier: Apache-2.0
#include "model/joint_motion.h"
#include "sections.h"

namespace lockstep::exporter::mjcf {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

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
    write_parts("");
    for (std::size_t i = 0; i < writing_.layout.is_world.size(); ++i)
      if (writing_.layout.is_world[i]) write_parts(model_.links[i].name);
    for (const int body : writing_.layout.in_world) write_body(body, 3);
    xml_.close();
    report_gravity();
  }

 private:
  void report_gravity() {
    const std::vector<Body>& bodies = writing_.layout.bodies;
    if (std::any_of(bodies.begin(), bodies.end(), [](const Body& body) { return body.inertial.gravity < 1.0; })) return;
    for (const Body& body : bodies)
      if (body.inertial.gravity > 1.0)
        report_.warn("shares of gravity above 1, which MuJoCo takes only beside one below 1", body.name);
  }

  // `depth` is that of the element, whose own elements are one deeper.
  void write_body(int index, int depth) {
    const Body& body = writing_.layout.bodies[static_cast<std::size_t>(index)];
    if (depth + 1 == TINYXML2_MAX_ELEMENT_DEPTH)
      report_.warn("bodies nested so deep that readers by tinyxml2 do not follow", body.name);
    xml_.open("body").set("name", body.name);
    place(xml_, body.pose);
    xml_.set_unless(0.0, "gravcomp", 1.0 - body.inertial.gravity);
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
    if (joint.kind == JointKind::ball) return write_ball(where);
    const bool slides = joint.kind == JointKind::prismatic;
    xml_.open("joint").set("name", joint.name).set("type", slides ? "slide" : "hinge");
    if (!slides && !where.pose.translation().isZero(0.0)) xml_.set("pos", numbers(where.pose.translation()));
    xml_.set("axis", numbers(Vector3d(where.pose.linear() * joint.axis.normalized())));
    write_resistance(joint, 0.0, xml_, report_);
    xml_.close();
  }

  // MuJoCo's balls have the same numbers along all axes.
  void write_ball(const JointPlace& where) {
    const Joint* const parts = &model_.joints[static_cast<std::size_t>(where.joint)];
    if (is_inner_part(*parts)) return;
    xml_.open("joint").set("name", ball_name(*parts)).set("type", "ball");
    if (!where.pose.translation().isZero(0.0)) xml_.set("pos", numbers(where.pose.translation()));
    const auto differs = [&](double Joint::*number) {
      return parts[0].*number != parts[1].*number || parts[0].*number != parts[2].*number;
    };
    for (double Joint::*number : {&Joint::damping, &Joint::armature, &Joint::friction, &Joint::stiffness})
      if (differs(number)) report_.warn("resistance of balls that differs by axis, written as along x", parts->name);
    write_resistance(*parts, 0.0, xml_, report_);
    for (int k = 1; k < 3; ++k)
      if (parts[k].velocity_limit < infinity) report_.warn("velocity limits, left out", parts[k].name);
    xml_.close();
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
      case ShapeKind::height_field: xml_.set("type", "hfield").set("hfield", collider.name); break;
      case ShapeKind::box: xml_.set("type", "box").set("size", numbers(Vector3d(0.5 * size))); break;
      case ShapeKind::hull:
        xml_.set("type", "mesh").set("mesh", collider.name);
        if (size[0] > 0.0) report_.warn("radius of a hull", collider.name);
        break;
      case ShapeKind::cylinder: xml_.set("type", "cylinder").set("size", numbers({size[0], 0.5 * size[1]})); break;
      case ShapeKind::ellipsoid: xml_.set("type", "ellipsoid").set("size", numbers(size)); break;
      case ShapeKind::capsule: xml_.set("type", "capsule").set("size", numbers({size[0], 0.5 * size[1]})); break;
      case ShapeKind::sphere: xml_.set("type", "sphere").set("size", numbers(size[0])); break;
    }
    // The lowest height of an <hfield> is that of its geom.
    Pose pose = collider.pose;
    if (collider.shape.kind == ShapeKind::height_field)
      pose = pose * Eigen::Translation3d(0.0, 0.0, collider.shape.heights.minCoeff());
    place(xml_, pose);
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
