// Model to URDF text: export_urdf is the main path. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>

#include "export/names.h"
#include "export/xml.h"
#include "losses.h"
#include "mimics.h"
#include "model/moved_inertia.h"
#include "model/tendons.h"
#include "model/trees.h"
#include "rpy.h"

namespace lockstep {
namespace exporter::urdf {
namespace {

using Eigen::Vector3d;

constexpr double no_bound = 1e10;  // as URDF wants numbers

// Readers find no armatures, and start at 0: there, too, something must have inertia.
void require_inertia(Model model, const Trees& trees, const Mimics& mimics) {
  for (Joint& joint : model.joints) {
    joint.armature = 0.0;
    if (joint.moves()) joint.position = start_of(joint.name, mimics);
  }
  const std::vector<UnmovedLink> unmoved = unmoved_links(model, trees, rigid_bodies(model, trees));
  if (unmoved.empty()) return;
  throw ModelError("link '" + model.links[static_cast<std::size_t>(unmoved.front().link)].name + "'",
                   "has no inertia to move without its joint's armature or in another start, which URDF does not have",
                   "write MJCF, or give the link an inertia");
}

class Writer {
 public:
  Writer(const Model& model, Report& report)
      : model_(model), report_(report), trees_(model), mimics_(mimics_of(model, report)) {
    require_inertia(model, trees_, mimics_);
    for (const Link& link : model.links) links_.take(link.name);
    for (const Joint& joint : model.joints) joints_.take(joint.name);
  }

  std::string write() {
    xml_.open("robot").set("name", model_.name);
    write_roots();
    for (const Link& link : model_.links) write_link(link);
    for (const Joint& joint : model_.joints) write_joint(joint);
    for (const Site& site : model_.sites) write_site(site);
    for (const Loop& loop : model_.loops) write_loop(loop);
    xml_.close();
    return xml_.text();
  }

 private:
  void write_origin(const Pose& pose) {
    const Vector3d turn = rpy_of(pose.linear());
    if (pose.matrix().isIdentity(0.0)) return;
    xml_.open("origin").set("xyz", numbers(Vector3d(pose.translation())));
    if (!turn.isZero(0.0)) xml_.set("rpy", numbers(turn));
    xml_.close();
  }

  void open_joint(const std::string& name, const char* type, const Pose& origin, const std::string& parent,
                  const std::string& child) {
    xml_.open("joint").set("name", name).set("type", type);
    write_origin(origin);
    xml_.open("parent").set("link", parent).close();
    xml_.open("child").set("link", child).close();
  }

  // URDF has one root, at the world's origin. Others hang on it.
  void write_roots() {
    const Root& first = trees_.roots.front();
    if (trees_.count() == 1 && !first.floating && first.pose.matrix().isIdentity(0.0)) return void(world_ = first.link);
    world_ = links_.take("world");
    xml_.open("link").set("name", world_).close();
    for (const Root& root : trees_.roots) {
      const std::string name = joints_.take(root.link + "_root");
      open_joint(name, root.floating ? "floating" : "fixed", root.pose, world_, root.link);
      xml_.close();
      report_.remark("roots that float or stand apart, on joints of a link for the world", root.link);
    }
  }

  void write_link(const Link& link) {
    xml_.open("link").set("name", link.name);
    const Inertia& inertia = link.inertia;
    // The tensor is in the link's axes: some readers ignore an rpy here.
    if (inertia.mass != 0.0 || !inertia.about_center.isZero(0.0)) {
      const Eigen::Matrix3d tensor = 0.5 * (inertia.about_center + inertia.about_center.transpose());
      xml_.open("inertial").open("origin").set("xyz", numbers(inertia.center)).close();
      xml_.open("mass").set("value", numbers(inertia.mass)).close();
      xml_.open("inertia").set("ixx", numbers(tensor(0, 0))).set("ixy", numbers(tensor(0, 1)));
      xml_.set("ixz", numbers(tensor(0, 2))).set("iyy", numbers(tensor(1, 1))).set("iyz", numbers(tensor(1, 2)));
      xml_.set("izz", numbers(tensor(2, 2))).close().close();
    }
    for (const Collider& collider : model_.colliders)
      if (collider.link == link.name) write_collision(collider);
    xml_.close();
  }

  void write_collision(const Collider& collider) {
    const Vector3d& size = collider.shape.size;
    const ShapeKind kind = collider.shape.kind;
    if (!is_written(kind)) return;
    xml_.open("collision").set("name", collider.name);
    write_origin(collider.pose);
    xml_.open("geometry");
    switch (kind) {
      case ShapeKind::half_space:
      case ShapeKind::height_field:
      case ShapeKind::hull:
      case ShapeKind::ellipsoid: break;
      case ShapeKind::box: xml_.open("box").set("size", numbers(size)); break;
      case ShapeKind::cylinder:
        xml_.open("cylinder").set("radius", numbers(size[0])).set("length", numbers(size[1]));
        break;
      case ShapeKind::sphere: xml_.open("sphere").set("radius", numbers(size[0])); break;
      case ShapeKind::capsule:
        xml_.open("capsule").set("radius", numbers(size[0])).set("length", numbers(size[1]));
        report_.remark("capsules, which some readers of URDF lack", collider.name);
        break;
    }
    xml_.close().close().close();
  }

  void write_joint(const Joint& joint) {
    if (joint.kind == JointKind::ball)
      throw ModelError("joint '" + joint.name + "'", "is a part of a ball joint, which URDF does not have",
                       "write MJCF, or build it from three revolute joints");
    const bool has_range = joint.lower > -infinity || joint.upper < infinity;
    const char* type = !joint.moves()                        ? "fixed"
                       : joint.kind == JointKind::prismatic  ? "prismatic"
                       : joint.kind == JointKind::continuous ? "continuous"
                       : has_range                           ? "revolute"
                                                             : "continuous";
    if (joint.kind == JointKind::revolute && !has_range)
      report_.remark("revolute joints without a range, which are continuous in URDF", joint.name);
    open_joint(joint.name, type, joint.origin, joint.parent, joint.child);
    if (joint.moves()) {
      xml_.open("axis").set("xyz", numbers(Vector3d(joint.axis.normalized()))).close();
      write_limit(joint, has_range || joint.kind == JointKind::prismatic);
      if (joint.damping > 0.0 || joint.friction > 0.0)
        xml_.open("dynamics").set("damping", numbers(joint.damping)).set("friction", numbers(joint.friction)).close();
      write_mimic(joint);
      report_losses(joint, start_of(joint.name, mimics_), report_);
    }
    xml_.close();
  }

  // URDF wants all four numbers, but for joints without a range.
  void write_limit(const Joint& joint, bool has_range) {
    const bool has_bounds = joint.effort_limit < infinity || joint.velocity_limit < infinity;
    if (!has_range && !has_bounds) return;
    const auto bounded = [&](double bound) {
      if (std::abs(bound) == infinity)
        report_.remark(fmt::format("limits without an end, written as {:g}", no_bound), joint.name);
      return numbers(std::clamp(bound, -no_bound, no_bound));
    };
    xml_.open("limit");
    if (has_range) xml_.set("lower", bounded(joint.lower)).set("upper", bounded(joint.upper));
    xml_.set("effort", bounded(joint.effort_limit)).set("velocity", bounded(joint.velocity_limit)).close();
  }

  // q = multiplier * leader + offset
  void write_mimic(const Joint& joint) {
    const auto mimic = mimics_.find(joint.name);
    if (mimic == mimics_.end()) return;
    const CouplingTerm& term = mimic->second->terms.front();
    xml_.open("mimic").set("joint", term.joint).set("multiplier", numbers(-term.ratio));
    xml_.set_unless(0.0, "offset", -mimic->second->offset).close();
  }

  void write_site(const Site& site) {
    const std::string link = links_.take(site.name);
    xml_.open("link").set("name", link).close();
    open_joint(joints_.take(site.name + "_site"), "fixed", site.pose, site.link, link);
    xml_.close();
    report_.remark("sites, written as links", link);
  }

  static const char* type_of(LoopKind kind) {
    switch (kind) {
      case LoopKind::point: return "spherical";
      case LoopKind::hinge: return "continuous";
      case LoopKind::slider: return "prismatic";
      case LoopKind::weld: break;
    }
    return "fixed";
  }

  void write_loop(const Loop& loop) {
    xml_.open("loop_joint").set("name", loop.name).set("type", type_of(loop.kind));
    const auto write_end = [&](const char* tag, const std::string& link, const Pose& pose) {
      xml_.open(tag).set("link", link.empty() ? world_ : link);
      xml_.set("xyz", numbers(Vector3d(pose.translation()))).set("rpy", numbers(rpy_of(pose.linear()))).close();
    };
    write_end("link1", loop.first, loop.first_pose);
    write_end("link2", loop.second, loop.second_pose);
    if (loop.kind == LoopKind::hinge || loop.kind == LoopKind::slider)
      xml_.open("axis").set("xyz", numbers(Vector3d(loop.axis.normalized()))).close();
    xml_.close();
    report_losses(loop, report_);
  }

  const Model& model_;
  Report& report_;
  const Trees trees_;
  const Mimics mimics_;
  Names links_, joints_;
  std::string world_;  // the link whose frame is the world's
  Xml xml_;
};

Model without_tendons(Model model, Report& report) {
  std::erase_if(model.couplings, [&](const Coupling& coupling) { return tendon_of(coupling, model); });
  std::erase_if(model.joints, [&](const Joint& joint) {
    const bool is_tendon = joint.kind == JointKind::tendon;
    if (is_tendon) report.warn("tendons, left out", joint.name);
    return is_tendon;
  });
  return model;
}

}  // namespace
}  // namespace exporter::urdf

Export export_urdf(const Model& original) {
  original.validate();
  exporter::Report report;
  const Model model = exporter::urdf::without_tendons(original, report);
  exporter::urdf::report_losses(model, report);
  std::string text = exporter::urdf::Writer(model, report).write();
  return exporter::finished(std::move(text), model, report);
}

}  // namespace lockstep
