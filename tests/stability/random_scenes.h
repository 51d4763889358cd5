// Random mechanisms with random bounds: what the search runs over. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "lockstep/model.h"
#include "lockstep/step.h"

namespace lockstep::stability {

/// A mechanism of tests/scenes with gear ratios of 0.1 to 10, limits around where it starts, dry friction, servos of
/// 1 to 1e6 N m/rad with and without effort limits, a few kinematic drives, couplings that may slip, and a step.
struct RandomScene {
  Model model;
  double dt, seconds;
  bool displaced;  ///< starts off its couplings, which come back before limits do
};
RandomScene random_scene(std::uint64_t seed);

/// Steps the scene in single precision, by the default method unless told otherwise, in four environments with other
/// targets. Returns what promise it broke, or nothing.
std::string broken_promise(const RandomScene& scene, Method method = Method::automatic);

/// Searches seeds first ... first + count - 1, fails for each that breaks a promise, and names it.
void search(std::uint64_t first, int count);

}  // namespace lockstep::stability
