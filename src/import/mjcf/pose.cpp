// The five ways to write an orientation. SPDX-License-Identifier: Apache-2.0
#include "pose.h"

#include <fmt/format.h>

#include <cctype>
#include <cmath>
#include <string>

namespace lockstep::importer::mjcf {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

Vector3d direction(const Element& element, const char* attribute, const double* numbers) {
  const Vector3d given(numbers[0], numbers[1], numbers[2]);
  if (!(given.stableNorm() > 1e-14)) element.fail(fmt::format("{} has no length", attribute), "give a direction");
  return given.stableNormalized();
}

Quaterniond turn(const Element& element, const char* attribute, const Settings& settings) {
  double n[6] = {1.0, 0.0, 0.0, 0.0, 0.0, 0.0};
  const std::string kind = attribute;
  const int count = kind == "quat" || kind == "axisangle" ? 4 : kind == "xyaxes" ? 6 : 3;
  element.numbers(attribute, n, count, count);
  if (kind == "quat") {
    const Quaterniond given(n[0], n[1], n[2], n[3]);
    if (!(given.coeffs().stableNorm() > 1e-14)) element.fail("quat has no length", "give a unit quaternion, w first");
    return Quaterniond(Eigen::Vector4d(given.coeffs().stableNormalized()));
  }
  if (kind == "axisangle")
    return Quaterniond(Eigen::AngleAxisd(settings.radians(n[3]), direction(element, attribute, n)));
  if (kind == "zaxis") return turn_to(direction(element, attribute, n));
  if (kind == "xyaxes") {
    const Vector3d x = direction(element, attribute, n);
    const Vector3d raw(n[3], n[4], n[5]), across = raw - raw.dot(x) * x;
    const Vector3d y = direction(element, attribute, across.data());
    Eigen::Matrix3d axes;
    axes << x, y, x.cross(y);
    return Quaterniond(axes);
  }
  return turn_by_euler({n[0], n[1], n[2]}, settings);
}

}  // namespace

Quaterniond turn_by_euler(const Vector3d& angles, const Settings& settings) {
  Quaterniond all = Quaterniond::Identity();
  for (int i = 0; i < 3; ++i) {  // small letters turn about moved axes, capital letters about fixed ones
    const char axis = settings.euler[static_cast<std::size_t>(i)];
    const Quaterniond one(Eigen::AngleAxisd(settings.radians(angles[i]),
                                            Vector3d::Unit(std::tolower(static_cast<unsigned char>(axis)) - 'x')));
    all = axis >= 'x' ? all * one : one * all;
  }
  return all;
}

Quaterniond turn_to(const Vector3d& direction) {
  const Vector3d z = direction.normalized();
  Vector3d axis = Vector3d::UnitZ().cross(z);
  const double sine = axis.norm();
  axis = sine < 1e-7 ? Vector3d::UnitX() : Vector3d(axis / sine);  // as MuJoCo 3.3.8 turns
  return Quaterniond(Eigen::AngleAxisd(std::atan2(sine, z.z()), axis));
}

Eigen::Isometry3d read_pose(const Element& element, const Settings& settings) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = element.triple("pos", Vector3d::Zero());
  // A quat counts last, even an own one beside a default, as in MuJoCo.
  const char* chosen = element.innermost({"axisangle", "xyaxes", "zaxis", "euler"});
  if (element.has("quat") && !chosen) chosen = "quat";
  int own = 0;
  for (const char* attribute : {"quat", "axisangle", "xyaxes", "zaxis", "euler"}) own += element.has_own(attribute);
  if (own > 1) element.fail("has two orientations", "keep one of quat, axisangle, xyaxes, zaxis, euler");
  if (chosen) pose.linear() = turn(element, chosen, settings).toRotationMatrix();
  return pose;
}

}  // namespace lockstep::importer::mjcf
