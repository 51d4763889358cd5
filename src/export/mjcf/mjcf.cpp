// Model to MJCF text: export_mjcf is the main path. SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <utility>

#include "lockstep/error.h"
#include "sections.h"

namespace lockstep {
namespace exporter::mjcf {
namespace {

void write_settings(const Writing& writing) {
  Xml& xml = writing.xml;
  xml.open("compiler").set("angle", "radian").set("autolimits", "false").set("inertiafromgeom", "false").close();
  // Servos and damping are implicit in this integrator as they are in lockstep.
  xml.open("option")
      .set("timestep", numbers(writing.timestep))
      .set("gravity", numbers(writing.model.gravity))
      .set("integrator", "implicitfast");
  if (!writing.model.contacts.empty()) xml.set("cone", "elliptic");
  xml.close();
}

void write_meshes(const Writing& writing) {
  const auto write = [&](const Collider& collider) {
    writing.xml.open("mesh").set("name", collider.name);
    writing.xml
        .set("vertex", numbers(std::vector<double>(collider.shape.points.reshaped().begin(),
                                                   collider.shape.points.reshaped().end())))
        .close();
  };
  const std::vector<Collider>& all = writing.model.colliders;
  const auto is_hull = [](const Collider& collider) { return collider.shape.kind == ShapeKind::hull; };
  if (std::none_of(all.begin(), all.end(), is_hull)) return;
  writing.xml.open("asset");
  for (const Collider& collider : all)
    if (is_hull(collider)) write(collider);
  writing.xml.close();
}

}  // namespace
}  // namespace exporter::mjcf

Export export_mjcf(const Model& original, const MjcfOptions& options) {
  using namespace exporter;
  if (options.timestep && (!(*options.timestep > 0.0) || !std::isfinite(*options.timestep)))
    throw SettingsError("MjcfOptions::timestep", "is not above 0, or not finite", "give a step in s, such as 0.001");
  original.validate();
  Model model = original;
  const double timestep = options.timestep.value_or(model.time_step > 0.0 ? model.time_step : 0.001);
  Report report;
  std::vector<mjcf::HeldPoint> held = mjcf::add_sites_of_loops(model, report);
  Xml xml;
  const Trees trees(model);
  const mjcf::Writing writing{model,           timestep, trees, mjcf::lay_out(model, trees, report),
                              std::move(held), report,   xml};
  xml.open("mujoco").set("model", model.name);
  mjcf::write_settings(writing);
  mjcf::write_meshes(writing);
  mjcf::write_world(writing);
  mjcf::write_contacts(writing);
  mjcf::write_couplings(writing);
  mjcf::write_loops(writing);
  mjcf::write_actuators_and_start(writing);
  xml.close();
  return finished(xml.text(), model, report);
}

}  // namespace lockstep
