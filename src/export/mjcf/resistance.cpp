// Attributes that joints and tendons share. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "model/softness_numbers.h"
#include "sections.h"

namespace lockstep::exporter::mjcf {
namespace {

// MuJoCo wants two ends of a range, the lower one first, and takes no denormal numbers.
constexpr double open_end = 1e10, least_width = 1e-300;

bool is_tendon(const Joint& joint) { return joint.kind == JointKind::tendon; }

std::string range_of(const Joint& joint, double shift, Report& report) {
  if (joint.lower == -infinity || joint.upper == infinity)
    report.remark(fmt::format("ranges with an open end, written as {:g}", open_end), joint.name);
  const double lower = std::max(joint.lower + shift, -open_end);
  double upper = std::min(joint.upper + shift, open_end);
  if (lower == upper) upper = std::max(std::nextafter(upper, infinity), upper + least_width);
  return numbers({lower, upper});
}

void write_range(const Joint& joint, double shift, Xml& xml, Report& report) {
  xml.set("limited", "true");
  if (joint.kind == JointKind::ball)
    xml.set("range", numbers({0.0, joint.upper}));
  else
    xml.set("range", range_of(joint, shift, report));
  report.remark("position limits, soft in MuJoCo", joint.name);
  if (!is_hard(joint.limit_softness))
    report.warn("softness of position limits, left out: they are MuJoCo's", joint.name);
  else if (erp_of(joint.limit_softness) != Hard().erp)
    report.remark("shares of an error that a step corrects (erp), left out", joint.name);
  if (joint.restitution > 0.0) report.warn("restitution of position limits, left out", joint.name);
}

void write_spring(const Joint& joint, double shift, Xml& xml) {
  xml.set("stiffness", numbers(joint.stiffness));
  if (!is_tendon(joint)) return void(xml.set_unless(0.0, "springref", joint.rest));
  const double rest = joint.rest + shift;
  xml.set("springlength", numbers(rest == -1.0 ? std::nextafter(-1.0, 0.0) : rest));  // -1: that of the joints' springs
}

}  // namespace

void write_resistance(const Joint& joint, double shift, Xml& xml, Report& report) {
  const bool has_range = joint.lower > -infinity || joint.upper < infinity;
  const auto* spring = std::get_if<Spring>(&joint.limit_softness);
  // A tendon's spring has no force within a range.
  const bool is_slack = is_tendon(joint) && has_range && spring && spring->kd == 0.0 && joint.stiffness == 0.0;
  if (has_range && !is_slack) write_range(joint, shift, xml, report);
  if (!has_range && joint.kind == JointKind::revolute)
    report.remark("revolute joints without a range, which are continuous in MJCF", joint.name);
  xml.set_unless(0.0, "damping", joint.damping)
      .set_unless(0.0, "armature", joint.armature)
      .set_unless(0.0, "frictionloss", joint.friction);
  if (joint.stiffness > 0.0) write_spring(joint, shift, xml);
  if (is_slack) xml.set("stiffness", numbers(spring->kp)).set("springlength", range_of(joint, shift, report));
  if (joint.effort_limit < infinity && joint.kind != JointKind::ball) {  // those of balls are their actuators'

    const double limit = std::max(joint.effort_limit, least_width);
    xml.set("actuatorfrclimited", "true").set("actuatorfrcrange", numbers({-limit, limit}));
  }
  if (joint.friction > 0.0) report.remark("dry friction, soft in MuJoCo", joint.name);
  if (joint.velocity_limit < infinity) report.warn("velocity limits, left out", joint.name);
}

}  // namespace lockstep::exporter::mjcf
