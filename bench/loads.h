// Mechanisms and settings that several benchmarks share. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "lockstep/lockstep.h"

namespace lockstep::bench {

struct Load {
  Model model;
  StepSettings settings;
  int environments = 4096;
  int substeps = 4;
  int reset_after = 100;  ///< steps; so the motion neither diverges nor comes to rest
  int threads = 1;
  Engine engine = Engine::automatic;
};

/// The engine of a load. Automatic is what a batch takes by itself where the program holds no generated kernel, whether
/// this one does or not.
Engine engine_of(const Plan& plan, Engine wanted);

/// A scene of tests/scenes.
Load scene(const std::string& name, Method method, int iterations);

/// The same with position ranges that no joint reaches the end of.
Load scene_with_ranges(const std::string& name, Method method);

/// A chain like chain8 of any length, with that many couplings from its first joint on.
Load chain(int joints, int couplings, Method method);

}  // namespace lockstep::bench
