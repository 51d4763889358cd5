// ActionMap: what actions of an agent mean. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

namespace lockstep {

enum class ActionKind {
  position,         ///< of the drives: the position target. Velocity targets stay
  position_change,  ///< of the drives: is added to the position target, which stays within the model's range
  velocity,         ///< of the drives: the velocity target. Position targets stay, so it is for drives without kp
  effort,           ///< the feed-forward effort
};

/// How Batch::set_actions() maps actions from [-1, 1]: -1 is `low` and 1 is `high`, and between it is linear. Actions
/// beyond are clipped.
///
/// There is one action for each of Plan::driven_dofs(). For `effort` there is one for each of Plan::independent_dofs().
struct ActionMap {
  ActionKind kind = ActionKind::position;
  /// By action, finite, low <= high; rad, m, rad/s, m/s, N m or N. Empty: the model's position range, 5 % of it to
  /// either side, its velocity limit or its effort limit. A tendon's position range is within those of its joints.
  std::vector<double> low = {}, high = {};
};

}  // namespace lockstep
