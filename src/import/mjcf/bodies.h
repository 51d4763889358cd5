// <worldbody>: bodies, joints, geoms and sites. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "classes.h"
#include "lockstep/model.h"
#include "settings.h"

namespace lockstep::importer::mjcf {

enum class JointType { hinge, slide, ball, free };

/// Angles in rad; positions and axes in the body's frame, where its joints are at `ref`. A ball joint is three of them,
/// whose axes are those of the body.
struct JointPart {
  JointType type = JointType::hinge;
  std::string name, place;
  std::string ball = {};  ///< name of the ball joint that it is a part of
  Eigen::Vector3d anchor = Eigen::Vector3d::Zero(), axis = Eigen::Vector3d::UnitZ();
  double ref = 0.0, lower = -infinity, upper = infinity;
  double stiffness = 0.0, rest = 0.0, damping = 0.0, armature = 0.0, friction = 0.0, effort_limit = infinity;
  double time_constant = 0.0, damping_ratio = 0.0;  ///< springdamper: both above 0 in place of stiffness and damping
  bool is_aligned = false;  ///< a free joint whose coordinates are those of the body's principal axes

  int part() const { return axis.y() != 0.0 ? 1 : axis.z() != 0.0 ? 2 : 0; }  ///< of a ball
};

enum class GeomType { plane, hfield, sphere, capsule, ellipsoid, cylinder, box, mesh, sdf };

struct GeomPart {
  GeomType type = GeomType::sphere;
  std::string name = {}, place = {};
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  Eigen::Vector3d size = Eigen::Vector3d::Zero();  ///< as in the file, with the half length of a fromto
  std::string mesh = {};                           ///< its name; a primitive that has one lies around it
  std::string height_field = {};                   ///< its name
  Element element;                                 ///< for what only colliders need
};

/// Its mass is that of its mesh.
inline bool has_mesh(const GeomPart& geom) { return geom.type == GeomType::mesh || geom.type == GeomType::sdf; }

/// By the geom's own size. Nothing for the types that lockstep has no shape of.
std::optional<Shape> primitive_of(const GeomPart& geom);

struct SitePart {
  std::string name, place;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
};

struct Body {
  std::string name, place;
  std::size_t part = 0;                                        ///< of the document
  int parent = -1;                                             ///< -1: the world is body 0
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();      ///< in the parent's frame, where joints are at `ref`
  Eigen::Isometry3d in_world = Eigen::Isometry3d::Identity();  ///< likewise
  Eigen::Vector3d position = Eigen::Vector3d::Zero();          ///< as the element has it, without frames around it
  bool is_mocap = false;
  double gravity = 1.0;                ///< 1 - gravcomp, which MuJoCo takes for a passive force
  std::vector<JointPart> joints = {};  ///< the outermost first
  std::vector<GeomPart> geoms = {};
  std::vector<SitePart> sites = {};
  Inertia inertia = {};
  bool has_inertial = false;
  std::vector<std::string> mesh_masses = {};  ///< places of geoms whose meshes would give it inertia and are not opened

  bool floats() const { return !joints.empty() && joints[0].type == JointType::free; }
};

struct JointId {
  int body, joint;
};

/// Bodies in MuJoCo's order, parents first; the world is the first.
struct Bodies {
  std::vector<Body> all;
  std::vector<bool> moves;  ///< by body: it or one that carries it has joints

  /// Whether a body is the other one, or carries it.
  bool is_above(int body, int other) const {
    while (other > body) other = all[static_cast<std::size_t>(other)].parent;
    return other == body;
  }
};

/// Reads all bodies, with inertias where the file states them: weigh() does the others. Throws ImportError for what is
/// no MJCF, and for elements that make bodies by themselves.
Bodies read_bodies(Document& document, const Settings& settings, const Classes& classes);

}  // namespace lockstep::importer::mjcf
