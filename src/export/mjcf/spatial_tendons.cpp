// <spatial>: tendons over sites. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "model/tendons.h"
#include "sections.h"
#include "sites.h"

namespace lockstep::exporter::mjcf {
namespace {

// A segment that goes on where the last one ended needs no site for its start.
bool goes_on(const TendonSegment& last, const TendonSegment& next) {
  return last.second == next.first && last.second_point == next.first_point && last.share == next.share;
}

void write_path(const Joint& tendon, const Model& model, Xml& xml) {
  const TendonSegment* last = nullptr;
  const auto write_site = [&](const std::string& link, const Eigen::Vector3d& at) {
    xml.open("site").set("site", find_site(model, link, at)).close();
  };
  for (const TendonSegment& segment : tendon.path) {
    if (!last ? segment.share != 1.0 : !goes_on(*last, segment))
      xml.open("pulley").set("divisor", numbers(1.0 / segment.share)).close();
    if (!last || !goes_on(*last, segment)) write_site(segment.first, segment.first_point);
    write_site(segment.second, segment.second_point);
    last = &segment;
  }
}

}  // namespace

void add_sites_of_tendons(Model& model) {
  for (const Joint& joint : model.joints)
    for (const TendonSegment& segment : joint.path) {
      site_at(segment.first, segment.first_point, joint.name + "_site", model);
      site_at(segment.second, segment.second_point, joint.name + "_site", model);
    }
}

void write_spatial_tendons(const Writing& writing) {
  bool is_open = false;
  for (const Joint& joint : writing.model.joints) {
    if (!is_spatial(joint)) continue;
    if (!is_open) writing.xml.open("tendon");
    is_open = true;
    writing.xml.open("spatial").set("name", joint.name);
    write_resistance(joint, 0.0, writing.xml, writing.report);
    write_path(joint, writing.model, writing.xml);
    writing.xml.close();
    writing.report.remark("tendons over sites, as spatial tendons", joint.name);
  }
  if (is_open) writing.xml.close();
}

}  // namespace lockstep::exporter::mjcf
