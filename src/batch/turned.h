// Angle and whole turns of one joint in the rows of a batch (M80). SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "plan/tables.h"
#include "simd/turns.h"

namespace lockstep {

/// Of the rows of a loop's turns, which have 2 sin(angle / 2): (M130).
template <class S>
S angle_of_gap(S gap) {
  return S(2) * std::asin(std::min(S(0.5) * gap, S(1)));
}

template <class S>
struct JointTurns {
  S angle, turns;
};

/// For joint j with this position. Its angle is kept[at], if a joint turns for ever. Joints that do not turn for ever
/// have no turns.
template <class S>
JointTurns<S> turned(const TableStructure& t, int j, S position, const S* kept, std::ptrdiff_t at) {
  using One = simd::Wide<S, 1, simd::Unfused>;
  if (t.turning.count == 0 || !t.turns[j]) return {position, S(0)};
  if (std::abs(position) <= S(simd::surely_within)) return {position, S(0)};
  const simd::Turned<One> joint = simd::turned(One(position), One(kept[at]));
  return {joint.angle.lane(0), joint.turns.lane(0)};
}

/// Puts joint j at `number`, in double.
template <class S>
void turn_to(const TableStructure& t, int j, double number, S& position, S* kept, std::ptrdiff_t at) {
  using One = simd::Wide<S, 1, simd::Unfused>;
  position = static_cast<S>(number);
  if (t.turning.count == 0 || !t.turns[j]) return;
  const double turns = std::nearbyint(number / (2.0 * std::numbers::pi));
  if (!(std::abs(turns) <= static_cast<double>(simd::most_turns<S>))) return;
  kept[at] = static_cast<S>(std::fma(-2.0 * std::numbers::pi, turns, number));
  position = simd::position_of(simd::Turned<One>{One(kept[at]), One(static_cast<S>(turns))}).lane(0);
}

}  // namespace lockstep
