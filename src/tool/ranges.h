// Position ranges, and what followers leave of those of their leaders. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "lockstep/plan.h"

namespace lockstep::tool {

/// rad or m
struct Range {
  double lower = -infinity, upper = infinity;
  std::string lower_by, upper_by;  ///< the follower whose range ends it there; empty: its own
  bool operator==(const Range&) const = default;
};

/// By dof: the range that a step of the plan holds; infinite where it holds none. A tendon's soft range is a spring.
std::vector<Range> held_ranges(const Plan& plan);

/// The same for independent dofs within the ranges of the followers that have them as their only leader. lower > upper
/// where these leave nothing.
std::vector<Range> usable_ranges(const Plan& plan);

}  // namespace lockstep::tool
