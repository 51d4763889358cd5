// SPDX-License-Identifier: Apache-2.0
#include "visuals.h"

#include <fmt/format.h>

#include "import/meshes/visual.h"
#include "origin.h"

namespace lockstep::importer::urdf {

std::vector<VisualMesh> read_visuals(Element& link, const std::string& name, const ImportOptions& options,
                                     MeshFiles& meshes) {
  std::vector<VisualMesh> visuals;
  link.each_child("visual", [&](Element visual) {
    const Eigen::Isometry3d pose = read_origin(visual);
    std::optional<Element> geometry = visual.child("geometry");
    if (!geometry) return;
    geometry->each_child("mesh", [&](Element mesh) {
      const std::string file = mesh.name("filename");
      if (options.leave_out_meshes) return mesh.report().warn("visual meshes, left out on request", name);
      if (const std::string reason = MeshFiles::unreadable(file); !reason.empty())
        return mesh.report().warn("visual meshes, left out", fmt::format("that of {} {}", name, reason));
      mesh.rename("visual " + mesh.title() + " of link '" + name + "'");
      const Eigen::Affine3d scaled(Eigen::Scaling(mesh.triple("scale", Eigen::Vector3d::Ones())));
      const Solid& solid = meshes.solid(
          file, "", scaled, [&](const std::string& rule, const std::string& remedy) { mesh.fail(rule, remedy); });
      visuals.push_back(visual_of(solid, name, pose, mesh.report()));
    });
  });
  return visuals;
}

}  // namespace lockstep::importer::urdf
