// One function for each kind of part. SPDX-License-Identifier: Apache-2.0
#include "body_parts.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "limited.h"
#include "pose.h"

namespace lockstep::importer::mjcf {
namespace {

// MuJoCo 3.11 has polynomials of position and velocity here.
double linear(const Element& element, const char* attribute) {
  double terms[] = {0.0, 0.0, 0.0};
  element.numbers(attribute, terms, 1, 3);
  if (terms[1] != 0.0 || terms[2] != 0.0)
    element.fail(fmt::format("{} has terms of higher order, which lockstep lacks", attribute),
                 "keep the first number alone");
  return terms[0];
}

void read_range(const Element& element, const Settings& settings, JointPart& part) {
  const std::optional<Range> range = limited_range(element, "range", "limited", settings.autolimits);
  if (!range || !settings.has_limits) return;
  const bool turns = part.type != JointType::slide, is_ball = part.type == JointType::ball;
  if (is_ball && range->lower != 0.0)
    element.fail("is a ball joint with a range that does not begin at 0", "give 0 and the largest angle");
  part.lower = is_ball ? -infinity : turns ? settings.radians(range->lower) : range->lower;
  part.upper = turns ? settings.radians(range->upper) : range->upper;
  element.report().tally("position limits made hard, soft in MuJoCo",
                         words_of(yielding_of(element, "solreflimit", "solimplimit")));
  if (const double margin = element.number("margin", 0.0); margin != 0.0)
    element.report().warn("margins of position limits, left out", fmt::format("{:g} of {}", margin, element.title()));
}

void read_passive(const Element& element, const Settings& settings, JointPart& part) {
  if (settings.has_springs) part.stiffness = linear(element, "stiffness");
  const double rest = element.number("springref", 0.0);
  if (part.type != JointType::ball) part.rest = rest;  // MuJoCo's has no force in the drawn pose
  if (part.type == JointType::hinge) part.rest = settings.radians(part.rest);
  if (settings.has_damping) part.damping = linear(element, "damping");
  part.armature = element.number("armature", 0.0);
  if (settings.has_friction) part.friction = element.number("frictionloss", 0.0);
  double pair[] = {0.0, 0.0};
  element.numbers("springdamper", pair, 2, 2);
  if (pair[0] > 0.0 && pair[1] > 0.0)
    part.time_constant = pair[0], part.damping_ratio = pair[1];
  else if (pair[0] != 0.0 || pair[1] != 0.0)
    element.report().warn("springdampers of numbers that are not above 0, without effect", element.title());
}

void read_effort(const Element& element, const Settings& settings, JointPart& part) {
  const std::optional<Range> range =
      limited_range(element, "actuatorfrcrange", "actuatorfrclimited", settings.autolimits);
  if (range) part.effort_limit = symmetric(*range, "actuatorfrcrange of " + element.title(), element.report());
  if (element.truth("actuatorgravcomp", false))
    element.report().warn("gravity compensation by actuators, made passive: no effort limit bounds it",
                          element.title());
}

// A sphere has one number, a capsule or cylinder two; a fromto gives the half length instead.
int sizes_of(GeomType type) {
  switch (type) {
    case GeomType::sphere: return 1;
    case GeomType::capsule:
    case GeomType::cylinder: return 2;
    case GeomType::box:
    case GeomType::ellipsoid: return 3;
    default: return 0;
  }
}

void refuse_two_places(const Element& element) {
  if (element.has("pos")) element.fail("has a fromto and a pos", "keep one of them");
}

void place_between(const Element& element, GeomPart& part) {
  refuse_two_places(element);
  double ends[6] = {};
  element.numbers("fromto", ends, 6, 6);
  const Eigen::Vector3d from(ends[0], ends[1], ends[2]), to(ends[3], ends[4], ends[5]);
  if (sizes_of(part.type) < 2)
    element.fail("has fromto, which its type does not take",
                 "give pos, or make it a capsule, cylinder, box, ellipsoid");
  const double length = (from - to).stableNorm();
  if (!(length > 1e-14)) element.fail("has fromto with both ends in one place", "give two different points");
  part.pose.translation() = 0.5 * (from + to);
  part.pose.linear() = turn_to((from - to) / length).toRotationMatrix();
  if (sizes_of(part.type) == 2)
    part.size[1] = 0.5 * length;
  else
    part.size = {part.size[0], part.size[0], 0.5 * length};
}

}  // namespace

JointPart read_joint_part(Element element, const Eigen::Isometry3d& frame, const Settings& settings) {
  JointPart part;
  if (element.has("name")) element.rename("joint '" + element.name("name") + "'");
  part.place = element.place();
  part.type = element.tag() == "freejoint"
                  ? JointType::free
                  : static_cast<JointType>(element.word("type", {"hinge", "slide", "ball", "free"}, 0));
  if (part.type == JointType::free) {
    const int align = element.word("align", {"false", "true", "auto"}, 2);
    part.is_aligned = align == 2 ? settings.aligns_free : align == 1;
  }
  if (element.tag() == "freejoint") return part;
  if (part.type == JointType::ball) {
    part.anchor = frame * element.triple("pos", Eigen::Vector3d::Zero());
    part.axis = Eigen::Vector3d::UnitX();
    read_range(element, settings, part);
    read_passive(element, settings, part);
    return part;
  }
  if (part.type == JointType::free) {
    read_passive(element, settings, part);
    if (std::exchange(part.time_constant, 0.0) > 0.0)
      element.report().warn("springdampers of free joints, left out", element.title());
    if ((part.stiffness != 0.0 || part.damping != 0.0 || part.armature != 0.0 || part.friction != 0.0))
      element.report().warn("springs, damping, armature and friction of free joints, left out",
                            fmt::format("{}: {:g} {:g} {:g} {:g}", element.title(), part.stiffness, part.damping,
                                        part.armature, part.friction));
    return part;
  }
  part.anchor = frame * element.triple("pos", Eigen::Vector3d::Zero());
  part.axis = element.triple("axis", Eigen::Vector3d::UnitZ());
  if (!(part.axis.stableNorm() > 1e-14)) element.fail("axis has no length", "give a direction such as 0 0 1");
  part.axis = (frame.linear() * part.axis.stableNormalized()).eval();
  part.ref = element.number("ref", 0.0);
  if (part.type == JointType::hinge) part.ref = settings.radians(part.ref);
  read_range(element, settings, part);
  read_passive(element, settings, part);
  read_effort(element, settings, part);
  return part;
}

GeomPart read_geom(Element element, const Eigen::Isometry3d& frame, const std::string& suffix,
                   const Settings& settings) {
  if (element.has("name")) element.rename("geom '" + element.name("name") + suffix + "'");
  GeomPart part{.element = element};
  if (element.has("name")) part.name = element.name("name") + suffix;
  part.place = element.place();
  part.type = static_cast<GeomType>(
      element.word("type", {"plane", "hfield", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "sdf"}, 2));
  part.mesh = element.name("mesh", "");
  part.height_field = element.name("hfield", "");
  element.numbers("size", part.size.data(), 1, 3);
  if (element.has("fromto") && !part.mesh.empty()) element.fail("has a fromto and a mesh", "keep one of them");
  if (element.has("fromto"))
    place_between(element, part);
  else
    part.pose = read_pose(element, settings);
  for (int i = 0; part.mesh.empty() && i < sizes_of(part.type); ++i)
    if (!(part.size[i] > 0.0)) element.fail("has a size that is not above 0", "give its radius or half lengths in m");
  part.pose = frame * part.pose;
  return part;
}

SitePart read_site(const Element& element, const Eigen::Isometry3d& frame, const Settings& settings) {
  SitePart part;
  part.place = element.place();
  double ends[6] = {};
  if (element.numbers("fromto", ends, 6, 6) == 6) {
    refuse_two_places(element);
    const Eigen::Vector3d from(ends[0], ends[1], ends[2]), to(ends[3], ends[4], ends[5]);
    part.pose.translation() = 0.5 * (from + to);
    if (from != to) part.pose.linear() = turn_to(from - to).toRotationMatrix();
  } else {
    part.pose = read_pose(element, settings);
  }
  part.pose = frame * part.pose;
  return part;
}

std::optional<Shape> primitive_of(const GeomPart& geom) {
  const Eigen::Vector3d& size = geom.size;
  switch (geom.type) {
    case GeomType::plane: return Shape::half_space();
    case GeomType::sphere: return Shape::sphere(size[0]);
    case GeomType::capsule: return Shape::capsule(size[0], 2.0 * size[1]);
    case GeomType::cylinder: return Shape::cylinder(size[0], 2.0 * size[1]);
    case GeomType::ellipsoid: return Shape::ellipsoid(size);
    case GeomType::box: return Shape::box(2.0 * size);
    default: return std::nullopt;
  }
}

}  // namespace lockstep::importer::mjcf
