// What Batch::inverse_kinematics() takes beside a target. SPDX-License-Identifier: Apache-2.0
#pragma once

namespace lockstep {

struct InverseKinematicsOptions {
  int iterations = 100;     ///< the most, >= 1
  double tolerance = 1e-6;  ///< m and rad, > 0: an environment ends where less is left
};

}  // namespace lockstep
