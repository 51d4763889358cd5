// What the rules for a Model have in common. SPDX-License-Identifier: Apache-2.0
#include "rules.h"

#include <cmath>

namespace lockstep {

using std::string;

string quoted(const char* kind, const string& name) { return string(kind) + " '" + name + "'"; }

void require(bool holds, const string& element, const string& rule, const string& remedy) {
  if (!holds) throw ModelError(element, rule, remedy);
}

void finite(double value, const string& element, const string& what) {
  require(std::isfinite(value), element, what + " is not a finite number", "give a finite number");
}

void finite(const Eigen::Ref<const Eigen::MatrixXd>& values, const string& element, const string& what) {
  require(values.allFinite(), element, what + " has an entry that is not a finite number", "give finite numbers");
}

void not_negative(double value, const string& element, const string& what) {
  finite(value, element, what);
  require(value >= 0.0, element, what + " is negative (" + std::to_string(value) + ")", "give 0 or more");
}

void rigid(const Eigen::Isometry3d& pose, const string& element, const string& what) {
  finite(pose.matrix(), element, what);
  const Eigen::Matrix3d rotation = pose.linear();
  require((rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < 1e-9 &&
              rotation.determinant() > 0.0,
          element, what + " is not a rigid transform: its 3x3 part is no rotation matrix",
          "use a rotation matrix or a unit quaternion");
}

void proper_softness(const Softness& softness, const string& element, const string& what) {
  const auto [first, second] = numbers_of(softness);
  finite(first, element, "softness of the " + what);
  finite(second, element, "softness of the " + what);
  switch (kind_of(softness)) {
    case SoftnessKind::hard:
      require(first >= 0.0 && first < 2.0, element,
              "erp of a hard " + what + " is " + std::to_string(first) + ", outside [0, 2)",
              "give 0.2; at 2 the error would change its sign forever");
      break;
    case SoftnessKind::erp_cfm:
      require(first >= 0.0 && first <= 1.0, element, "erp of the " + what + " is outside [0, 1]",
              "give a share between 0 and 1");
      require(second >= 0.0, element, "cfm of the " + what + " is negative", "give 0 (hard) or more");
      break;
    case SoftnessKind::spring:
      require(first >= 0.0 && second >= 0.0, element, "kp or kd of the soft " + what + " is negative",
              "give 0 or more");
      break;
    case SoftnessKind::frequency:
      require(first >= 0.0 && second >= 0.0, element,
              "natural frequency or damping ratio of the " + what + " is negative",
              "give 0 or more (rad/s; Hz times 2 pi)");
      break;
  }
}

}  // namespace lockstep
