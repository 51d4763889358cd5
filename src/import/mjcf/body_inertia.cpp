// Inertia as the file states it, or of geoms. SPDX-License-Identifier: Apache-2.0
#include "body_inertia.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>

#include "lockstep/error.h"
#include "model/shapes.h"
#include "model/trees.h"
#include "pose.h"

namespace lockstep::importer::mjcf {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// With the geom's mass, or else its density.
Inertia weighed(const GeomPart& geom, Meshes& meshes) {
  const Element& element = geom.element;
  const double density = element.number("density", 1000.0);
  const bool has_mass = element.has("mass");
  const double mass = element.number("mass", 0.0);
  if (mass < 0.0 || density < 0.0) element.fail("has a negative mass or density", "give 0 or more");
  if (mass == 0.0 && (has_mass || density == 0.0)) return {};
  Inertia inertia = meshes.inertia_of(geom);
  if (!(inertia.mass > 0.0)) return {};
  const double factor = has_mass ? mass / inertia.mass : density;
  if (element.truth("shellinertia", false))
    element.fail("has the inertia of a shell, which lockstep has for meshes alone",
                 has_mesh(geom) ? "write inertia=\"shell\" for its <mesh>" : "add an <inertial>, or make it solid");
  inertia.mass *= factor;
  inertia.about_center *= factor;
  return inertia;
}

bool counts(const GeomPart& geom, const Settings& settings) {
  const int group = geom.element.whole("group", 0);
  return group >= settings.first_group && group <= settings.last_group;
}

// `opens`: the meshes of its geoms.
void add_geoms(Body& body, bool opens, const Settings& settings, Meshes& meshes, Report& report) {
  if (settings.inertia_from_geoms == FromGeoms::never ||
      (settings.inertia_from_geoms == FromGeoms::where_missing && body.has_inertial))
    return;
  Inertia sum;
  for (const GeomPart& geom : body.geoms) {
    if (!counts(geom, settings)) continue;
    if (opens || geom.mesh.empty())
      sum = sum + weighed(geom, meshes);
    else if (geom.element.number(geom.element.has("mass") ? "mass" : "density", 1000.0) != 0.0)
      body.mesh_masses.push_back(geom.place);
  }
  if (!(sum.mass > 0.0)) return;
  if (body.has_inertial) report.remark("inertials that geoms override", body.name);
  body.inertia = sum;
}

template <class Change>
void change_moments(Matrix3d& tensor, Change change) {
  const Eigen::SelfAdjointEigenSolver<Matrix3d> principal(tensor);
  const Vector3d changed = change(principal.eigenvalues());
  if (changed == principal.eigenvalues()) return;
  tensor = principal.eigenvectors() * changed.asDiagonal() * principal.eigenvectors().transpose();
}

}  // namespace

Inertia read_inertial(const Element& element, const Settings& settings) {
  if (!element.has("pos")) element.fail("lacks pos", "say where the centre of mass is");
  if (!element.has("diaginertia") && !element.has("fullinertia") && !(settings.least_inertia > 0.0))
    element.report().warn("inertials without an inertia, taken as point masses", element.place());
  const Eigen::Isometry3d pose = read_pose(element, settings);
  Inertia inertia;
  inertia.center = pose.translation();
  inertia.mass = element.number("mass");
  double full[6];
  if (element.numbers("fullinertia", full, 6, 6)) {
    if (element.has("diaginertia")) element.fail("has diaginertia and fullinertia", "keep one of them");
    for (const char* turn : {"quat", "axisangle", "xyaxes", "zaxis", "euler"})
      if (element.has(turn)) element.fail(fmt::format("has fullinertia and {}", turn), "turn the tensor yourself");
    inertia.about_center << full[0], full[3], full[4],  //
        full[3], full[1], full[5],                      //
        full[4], full[5], full[2];
    return inertia;
  }
  const Vector3d moments = element.triple("diaginertia", Vector3d::Zero());
  inertia.about_center = pose.linear() * moments.asDiagonal() * pose.linear().transpose();
  return inertia;
}

void weigh(Bodies& bodies, const std::vector<bool>& is_read, const Settings& settings, bool leaves_out_meshes,
           Meshes& meshes, Report& report) {
  double total = 0.0;
  for (std::size_t i = 1; i < bodies.all.size(); ++i) {
    const bool matters = settings.total_mass > 0.0 || (is_read[i] && bodies.moves[i]);
    const Settings& own = settings.of(bodies.all[i].part);
    report.attempt([&] { add_geoms(bodies.all[i], matters && !leaves_out_meshes, own, meshes, report); });
    Inertia& inertia = bodies.all[i].inertia;
    if (!(inertia.mass > 0.0) && own.least_mass > 0.0 && !bodies.all[i].has_inertial)
      inertia.center = bodies.all[i].position;  // MuJoCo puts it there, in the body's own frame
    inertia.mass = std::max(inertia.mass, own.least_mass);
    if (own.least_inertia > 0.0)
      change_moments(inertia.about_center,
                     [&](const Vector3d& moments) -> Vector3d { return moments.cwiseMax(own.least_inertia); });
    if (own.balances)
      change_moments(inertia.about_center, [](const Vector3d& moments) -> Vector3d {
        return moments[0] + moments[1] < moments[2] ? Vector3d::Constant(moments.mean()) : moments;
      });
    if (bodies.moves[i] || bodies.all[i].is_mocap || !settings.fuses_static) total += inertia.mass;
    if (settings.total_mass > 0.0 && !bodies.all[i].mesh_masses.empty())
      throw ImportError(bodies.all[i].mesh_masses.front(),
                        "would count for settotalmass by the volume of its mesh, which is left out on request",
                        "add an <inertial> to its body, or do not leave meshes out");
  }
  if (!(settings.total_mass > 0.0) || !(total > 0.0)) return;
  report.remark("masses scaled to the file's total mass", fmt::format("{:g} kg", settings.total_mass));
  for (Body& body : bodies.all) {
    body.inertia.mass *= settings.total_mass / total;
    body.inertia.about_center *= settings.total_mass / total;
  }
}

}  // namespace lockstep::importer::mjcf
