// <connect> and <weld>. SPDX-License-Identifier: Apache-2.0
#include "loops.h"

#include <algorithm>

#include "export/names.h"
#include "model/softness_numbers.h"
#include "sections.h"
#include "sites.h"

namespace lockstep::exporter::mjcf {
namespace {

using Eigen::Vector3d;

constexpr double along_axis = 0.1;  // m, from the first point of a hinge to the second

void report_losses(const Loop& loop, Report& report) {
  if (loop.force_limit < infinity || loop.torque_limit < infinity)
    report.warn("force limits of loops, left out", loop.name);
  if (!is_hard(loop.softness))
    report.warn("softness of loops, left out: they are hard", loop.name);
  else if (erp_of(loop.softness) != erp_of(Loop().softness))
    report.remark("shares of an error that a step corrects (erp), left out", loop.name);
}

// The pose of the second body's frame in the first one, turned, and the point on the second body that meets it.
void write_weld(const Loop& loop, const Writing& writing) {
  const auto body = [&](const std::string& link) -> std::string {
    if (link.empty()) return "world";
    const int index = writing.model.link_index(link);
    if (writing.layout.is_world[static_cast<std::size_t>(index)]) return "world";
    return std::find_if(writing.layout.bodies.begin(), writing.layout.bodies.end(),
                        [&](const Body& candidate) { return candidate.link == index; })
        ->name;
  };
  const Vector3d at = loop.first_pose.translation(), anchor = loop.second_pose.translation();
  const Eigen::Quaterniond turn(Eigen::Matrix3d(loop.first_pose.linear() * loop.second_pose.linear().transpose()));
  writing.xml.open("weld").set("name", loop.name);
  writing.xml.set("body1", body(loop.first)).set("body2", body(loop.second));
  writing.xml.set("relpose", numbers({at[0], at[1], at[2], turn.w(), turn.x(), turn.y(), turn.z()}));
  writing.xml.set("anchor", numbers(anchor));
  write_hardness(writing.timestep, writing.xml);
  writing.xml.close();
}

}  // namespace

std::vector<HeldPoint> add_sites_of_loops(Model& model, Report& report) {
  Names equalities;
  for (const std::string& coupling : coupling_names(model)) equalities.take(coupling);
  for (Loop& loop : model.loops) {
    const std::string name = equalities.take(loop.name);
    if (name != loop.name) report.remark("loops with the name of a coupling, renamed", loop.name + " to " + name);
    loop.name = name;
  }
  std::vector<HeldPoint> held;
  for (const Loop& loop : model.loops) {
    const auto hold = [&](const std::string& name, const Vector3d& at) {
      held.push_back({name, site_at(loop.first, loop.first_pose * at, name + "_first", model),
                      site_at(loop.second, loop.second_pose * at, name + "_second", model)});
    };
    if (loop.kind != LoopKind::point && loop.kind != LoopKind::hinge) continue;
    hold(loop.name, Vector3d::Zero());
    if (loop.kind == LoopKind::hinge) hold(equalities.take(loop.name + "_axis"), along_axis * loop.axis.normalized());
  }
  return held;
}

void write_loops(const Writing& writing) {
  const auto& [model, timestep, trees, layout, held, report, xml] = writing;
  const auto is_written = [](const Loop& loop) { return loop.kind != LoopKind::slider; };
  for (const Loop& loop : model.loops) {
    if (!is_written(loop)) {
      report.warn("sliders of loops, left out", loop.name);
      continue;
    }
    if (loop.kind == LoopKind::hinge) report.remark("hinges of loops, as two points on the axis", loop.name);
    report_losses(loop, report);
  }
  if (std::none_of(model.loops.begin(), model.loops.end(), is_written)) return;
  xml.open("equality");
  for (const HeldPoint& point : held) {
    xml.open("connect").set("name", point.name).set("site1", point.first).set("site2", point.second);
    write_hardness(timestep, xml);
    xml.close();
    report.remark("points of loops, held by sites", point.name);
  }
  for (const Loop& loop : model.loops)
    if (loop.kind == LoopKind::weld) write_weld(loop, writing);
  xml.close();
}

}  // namespace lockstep::exporter::mjcf
