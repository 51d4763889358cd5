// What is measured: mechanisms and settings that several programs must have alike. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "lockstep/lockstep.h"

namespace lockstep::bench {

struct Load {
  Model model;
  StepSettings settings;
  int environments = 4096;
  int substeps = 4;
  int reset_after = 100;  ///< steps: near the start of the motion, where nothing has blown up or come to rest
  int threads = 1;
  Engine engine = Engine::automatic;
};

/// A scene of tests/scenes.
Load scene(const std::string& name, Method method, int iterations);

/// The same with ranges of the joints' positions that they never leave.
Load scene_with_ranges(const std::string& name, Method method);

/// A chain like chain8, of any length, the first joints of which are coupled as there.
Load chain(int joints, int couplings, Method method);

}  // namespace lockstep::bench
