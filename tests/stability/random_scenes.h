// Random mechanisms with random bounds, and a search for broken promises. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "lockstep/model.h"
#include "lockstep/step.h"

namespace lockstep::stability {

/// A random mechanism of tests/scenes and a step. Gear ratios are 0.1 to 10. There are limits around the start, dry
/// friction, servos of 1 to 1e6 N m/rad with and without effort limits, a few kinematic drives and force limits.
struct RandomScene {
  Model model;
  double dt, seconds;
  bool displaced;  ///< starts with coupling errors, which are corrected before violations of limits
};
RandomScene random_scene(std::uint64_t seed);

/// Steps four environments of the scene with different targets in single precision. Returns the promise that it broke,
/// or an empty string.
std::string broken_promise(const RandomScene& scene, Method method = Method::automatic);

/// Expects that none of the seeds first ... first + count - 1 breaks a promise.
void search(std::uint64_t first, int count);

}  // namespace lockstep::stability
