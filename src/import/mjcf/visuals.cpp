// SPDX-License-Identifier: Apache-2.0
#include "visuals.h"

#include <fmt/format.h>

#include "import/meshes/visual.h"
#include "meshes.h"

namespace lockstep::importer::mjcf {

namespace {

bool touches(const GeomPart& geom) {
  return geom.element.whole("contype", 1) != 0 || geom.element.whole("conaffinity", 1) != 0;
}

std::vector<const GeomPart*> shown_geoms(const Body& body) {
  std::vector<const GeomPart*> meshes, looks;
  for (const GeomPart& geom : body.geoms) {
    if (geom.type != GeomType::mesh) continue;
    meshes.push_back(&geom);
    if (!touches(geom)) looks.push_back(&geom);
  }
  return looks.empty() ? meshes : looks;
}

}  // namespace

void look(const Scene& scene, const std::vector<Place>& places, Draft& draft) {
  Report& report = scene.report();
  for (std::size_t b = 1; b < scene.bodies.all.size(); ++b) {
    if (!scene.is_read[b]) continue;
    const Body& body = scene.bodies.all[b];
    const auto& [link, pose] = places[b];
    for (const GeomPart* geom : shown_geoms(body)) {
      if (link.empty())
        report.remark("visual meshes of the world, which are not drawn", body.name);
      else if (scene.options.leave_out_meshes)
        report.warn("visual meshes, left out on request", body.name);
      else if (const std::string reason = scene.meshes.unreadable(*geom); !reason.empty())
        report.warn("visual meshes, left out", fmt::format("that of {} {}", body.name, reason));
      else
        draft.visual_meshes.push_back(visual_of(scene.meshes.mesh_of(*geom), link, pose * geom->pose, report));
    }
  }
}

}  // namespace lockstep::importer::mjcf
