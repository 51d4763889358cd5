// What a file says, before it becomes a Model. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "bodies.h"
#include "limited.h"
#include "lockstep/import.h"
#include "meshes.h"
#include "references.h"

namespace lockstep::importer::mjcf {

/// A sum of joint positions, each times its coefficient, and a constant. Joints are numbers of Scene::joints.
struct Form {
  std::vector<std::pair<int, double>> terms;
  double constant = 0.0;

  void add(int joint, double coefficient);  ///< terms of one joint are added up
};

/// A straight part of a spatial tendon between two sites.
struct Strand {
  std::string first, second;
  double share;  ///< of its length in the tendon's
};

struct Tendon {
  std::string name, place;
  bool is_spatial = false;
  bool is_whole = true;         ///< all of its joints are read
  Form length;                  ///< of a fixed tendon
  std::vector<Strand> strands;  ///< of a spatial one
  std::string wrapped;          ///< a geom that it wraps around, in words; empty if it wraps around none
  std::optional<Range> range;
  double stiffness = 0.0, damping = 0.0, friction = 0.0, armature = 0.0, effort_limit = infinity;
  double shortest = -1.0, longest = -1.0;  ///< between these the spring has no force; -1: at the joints' springref

  bool has_slack() const { return stiffness != 0.0 && shortest != longest; }
};

/// A linear relation: form = 0.
struct Equality {
  std::string place, name;
  Form form;
  Yielding yielding;
};

/// A joint whose position is a polynomial of another's.
struct Curve {
  std::string place;
  int follower, leader;
  Polynomial polynomial;
  Yielding yielding;
};

/// F = gain u + bias[0] + bias[1] length + bias[2] rate, along a joint or tendon times the gear.
struct Actuator {
  std::string name;
  int joint = -1, tendon = -1;  ///< one of these, or else `lost` says why it is left out
  std::string lost;
  bool integrates = false;        ///< its control, which is left out
  double lag = 0.0, delay = 0.0;  ///< of its control, s
  double samples = infinity;      ///< that the delay has memory for
  double gear = 1.0, gain = 1.0, bias[3] = {0.0, 0.0, 0.0};
  bool has_damping_ratio = false;  ///< in place of bias[2]
  double damping_ratio = 0.0;
  std::optional<Range> force, control;
};

struct Scene {
  Document& document;
  const Settings& settings;
  const Classes& classes;
  const ImportOptions& options;
  Meshes& meshes;
  Bodies bodies;
  std::vector<JointId> joints = {};  ///< in MuJoCo's order
  std::unordered_map<std::string, int> joint_of = {}, body_of = {}, tendon_of = {};
  Known known = {};  ///< names of bodies, joints, geoms, sites, tendons, actuators, cameras and assets
  std::map<std::string, std::vector<const Element::Xml*>, std::less<>> sections = {};  ///< that were resolved
  std::vector<bool> is_read = {};  ///< by body: options.body or what it carries; all without that option
  std::vector<Tendon> tendons = {};
  std::vector<Equality> equalities = {};
  std::vector<Curve> curves = {};
  std::vector<Element> closures = {};  ///< <connect> and <weld>
  std::vector<Actuator> actuators = {};

  Report& report() const { return document.report(); }
  const JointPart& joint(int index) const {
    const JointId id = joints[static_cast<std::size_t>(index)];
    return bodies.all[static_cast<std::size_t>(id.body)].joints[static_cast<std::size_t>(id.joint)];
  }
  /// The elements of the sections of that tag, which name nothing that does not exist.
  const std::vector<const Element::Xml*>& section(std::string_view tag) const { return sections.find(tag)->second; }
  [[noreturn]] void fail_to_find(const Element& element, std::string_view kind, const std::string& name) const;
  /// The tendon of that name. Throws ImportError at the element if there is none.
  const Tendon& tendon(const std::string& name, const Element& element) const;
  /// The hinge or slide of that name; -1 for one that options.body leaves out. Throws ImportError at the element if
  /// there is none.
  int scalar_joint(const std::string& name, const Element& element) const;
  bool is_joint_read(int index) const {
    return is_read[static_cast<std::size_t>(joints[static_cast<std::size_t>(index)].body)];
  }
};

/// Reads the whole file. Throws ImportError where it is no MJCF or cannot be a Model, SettingsError where options.body
/// is no body.
Scene read_scene(Document& document, const Settings& settings, const Classes& classes, const ImportOptions& options,
                 Meshes& meshes);

// Parts of it, in this order.
/// Fills Scene::known and sections. Throws ImportError for names that nothing has or that two have. Of a model of which
/// one body is attached, elements that name others are left out.
void resolve(Scene& scene);
void read_tendons(Scene& scene);
void read_equalities(Scene& scene);
void read_actuators(Scene& scene);

}  // namespace lockstep::importer::mjcf
