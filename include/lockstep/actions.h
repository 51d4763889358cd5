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

/// How Batch::set_actions() maps actions from [-1, 1] to targets or efforts. Actions beyond are clipped.
///
/// With `low` and `high`, -1 is `low` and 1 is `high`, and between it is linear. With `scale`, an action a is
/// center + scale a. With neither, the model decides:
/// - position: its range. Where an end is missing, 0.5 rad or 0.05 m from where the model starts.
/// - position_change: 5 % of that range to either side.
/// - velocity and effort: its velocity limit and its effort limit to either side; a joint without one is refused.
/// The range of a follower or a tendon is within what the ranges of its leaders leave it; a tendon over joints without
/// ranges reaches as far as their 0.5 rad or 0.05 m do.
struct ActionMap {
  ActionKind kind = ActionKind::position;
  /// By action, finite, low <= high; rad, m, rad/s, m/s, N m or N.
  std::vector<double> low = {}, high = {};
  /// The dofs that the actions are for, each once: those with a drive, or any for `effort`. Empty:
  /// Plan::driven_dofs(), or Plan::independent_dofs() for `effort`.
  std::vector<int> dofs = {};
  /// By action, finite; in place of low and high. A center without a scale is refused. Without a center, it is the
  /// position where the model starts for `position`, and 0 for the others.
  std::vector<double> scale = {}, center = {};
  /// Share of the new value in a moving average of targets or efforts, in (0, 1]: target += alpha (new - target).
  /// Below 1 it is not for `position_change`.
  double alpha = 1.0;
  /// Actions are rad, m, rad/s, m/s, N m or N themselves: neither mapped nor clipped. low, high and scale are empty
  /// then.
  bool raw = false;
};

}  // namespace lockstep
