// <compiler> and <option>. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "element.h"
#include "import/meshes/inertia.h"
#include "limited.h"

namespace lockstep::importer::mjcf {

enum class FromGeoms { never, always, where_missing };

/// What holds for a whole file. Sections that stand there several times are one: the last attribute counts. What is
/// attached has a <compiler> of its own, and the <option> of the main file.
/// What <option> has in place of the numbers of all contacts, where its flag `override` is on.
struct ContactNumbers {
  double friction[5] = {1.0, 1.0, 0.005, 0.0001, 0.0001};
  Yielding yielding = {};
  double margin = 0.0;
};

struct Settings {
  bool degrees = true, angle_is_given = false;
  std::string euler = "xyz";
  bool autolimits = true;
  FromGeoms inertia_from_geoms = FromGeoms::where_missing;
  int first_group = 0, last_group = 5;  ///< geoms that count for inertia
  double least_mass = 0.0, least_inertia = 0.0, total_mass = -1.0;
  bool balances = false;
  std::string mesh_folder = {};  ///< below the main file's, or absolute
  bool strips_paths = false;     ///< of the names of mesh files
  MeshRule mesh_rule = MeshRule::legacy;
  bool fuses_static = false;  ///< bodies that stand still have no mass of their own
  bool fits_extents = false;  ///< primitives around meshes: by the extents of these in place of their moments
  bool aligns_free = false;   ///< free joints that do not say so themselves move principal axes

  Eigen::Vector3d gravity{0.0, 0.0, -9.81};
  double time_step = 0.0;  ///< s; 0 if the file has none
  bool has_equalities = true, has_limits = true, has_friction = true, has_actuation = true, has_contacts = true;
  bool has_springs = true, has_damping = true, clamps_controls = true, filters_parents = true;

  std::optional<ContactNumbers> all_contacts = {};  ///< in place of their own numbers
  std::uint32_t disabled_groups = 0;                ///< of actuators, a bit for each
  std::vector<Settings> attached;                   ///< of what is attached, by part, from part 1

  const Settings& of(std::size_t part) const { return part == 0 ? *this : attached[part - 1]; }
  const Settings& of(const Element& element) const { return of(element.document().part_of(element.xml())); }

  double radians(double angle) const { return degrees ? angle * (3.14159265358979323846 / 180.0) : angle; }
};

Settings read_settings(Document& document);

/// What tells how soft MuJoCo's contacts are.
struct SolverSettings {
  bool is_elliptic = false;     ///< friction cones, else pyramids
  double friction_ratio = 1.0;  ///< impratio
  bool is_safe = true;          ///< time constants are at least two steps
  double time_step = 0.002;     ///< s
};
SolverSettings read_solver(Document& document, const Settings& settings);

}  // namespace lockstep::importer::mjcf
