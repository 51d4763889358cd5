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

constexpr double flat_range = 1e-3, base_of_field = 0.1;  // m, of what MuJoCo wants above 0

// Heights from the row of largest y to that of the least, from 0 to 1 of the largest.
void write_height_field(const Collider& collider, Xml& xml) {
  const Shape& shape = collider.shape;
  const double least = shape.heights.minCoeff(), rise = shape.heights.maxCoeff() - least;
  const double range = rise > 0.0 ? rise : flat_range;
  std::vector<double> numbers_of_rows;
  for (Eigen::Index row = shape.heights.rows() - 1; row >= 0; --row)
    for (Eigen::Index column = 0; column < shape.heights.cols(); ++column)
      numbers_of_rows.push_back((shape.heights(row, column) - least) / range);
  xml.open("hfield").set("name", collider.name);
  xml.set("nrow", std::to_string(shape.heights.rows())).set("ncol", std::to_string(shape.heights.cols()));
  xml.set("size", numbers({0.5 * shape.size[0], 0.5 * shape.size[1], range, base_of_field}));
  xml.set("elevation", numbers(numbers_of_rows)).close();
}

// Meshes of hulls, and height fields.
void write_assets(const Writing& writing) {
  const auto write = [&](const Collider& collider) {
    writing.xml.open("mesh").set("name", collider.name);
    writing.xml
        .set("vertex", numbers(std::vector<double>(collider.shape.points.reshaped().begin(),
                                                   collider.shape.points.reshaped().end())))
        .close();
  };
  const std::vector<Collider>& all = writing.model.colliders;
  const auto is = [](const Collider& collider, ShapeKind kind) { return collider.shape.kind == kind; };
  const auto is_asset = [&](const Collider& c) { return is(c, ShapeKind::hull) || is(c, ShapeKind::height_field); };
  if (std::none_of(all.begin(), all.end(), is_asset)) return;
  writing.xml.open("asset");
  for (const Collider& collider : all) {
    if (is(collider, ShapeKind::hull)) write(collider);
    if (is(collider, ShapeKind::height_field)) write_height_field(collider, writing.xml);
  }
  writing.xml.close();
}

}  // namespace
}  // namespace exporter::mjcf

Export export_mjcf(const Model& original, const MjcfOptions& options) {
  using namespace exporter;
  if (options.timestep && !(*options.timestep >= 1e-9 && *options.timestep <= 1e3))
    throw SettingsError("MjcfOptions::timestep", fmt::format("is {} s, outside 1e-9 to 1000", *options.timestep),
                        "give a step in s, such as 0.001");
  original.validate();
  Model model = original;
  const double timestep = options.timestep.value_or(model.time_step > 0.0 ? model.time_step : 0.001);
  Report report;
  std::vector<mjcf::HeldPoint> held = mjcf::add_sites_of_loops(model, report);
  mjcf::add_sites_of_tendons(model);
  Xml xml;
  const Trees trees(model);
  const mjcf::Writing writing{model,           timestep, trees, mjcf::lay_out(model, trees, report),
                              std::move(held), report,   xml};
  xml.open("mujoco").set("model", model.name);
  mjcf::write_settings(writing);
  mjcf::write_assets(writing);
  mjcf::write_world(writing);
  mjcf::write_contacts(writing);
  mjcf::write_couplings(writing);
  mjcf::write_spatial_tendons(writing);
  mjcf::write_loops(writing);
  mjcf::write_actuators_and_start(writing);
  xml.close();
  return finished(xml.text(), model, report);
}

}  // namespace lockstep
