// The mechanisms of the stability tests. SPDX-License-Identifier: Apache-2.0
//
// Links are those of tests/scenes unless said otherwise. Joints are j0, j1, ... in order.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "lockstep/model.h"

namespace lockstep::stability {

/// One driven joint and `followers` joints that mimic it, hung on the link `carrier` and 1 rad off their couplings.
Model star(int followers, const std::string& carrier);

/// A serial arm of 17 links, in which each joint mimics the one before. All 16 couplings start 1 rad off.
Model serial();

/// chain8 with q_A = ratio q_B; its couplings start 1 rad off.
Model geared(double ratio);

/// chain8 with these masses and damping in proportion to them; its couplings start 1 rad off. It tests whether
/// couplings and arithmetic bear the masses. Without the damping, heavy links would test the energy of a first-order
/// integrator.
Model with_masses(const std::function<double(int)>& mass);

/// Two continuous joints about the vertical with q_0 = 2 q_1. An effort on j1 turns them round and round.
Model turning();

/// Two links in gravity with joints about y and q_0 = -ratio q_1, side by side or the second on the first.
enum class Arrangement { side_by_side, second_on_first };
Model pair(Arrangement arrangement, double ratio = -1.0);

/// Sliders of 1 kg without gravity, for closed formulas. Joints are s0, s1, ...
Model sliding(int sliders);

/// chain8 with the loop (0,2), (2,4), (0,4): the third coupling follows from the others up to its offset.
Model loop(double offset);

/// Largest difference of potential energy, J. Each link may move up and down by the length of the chain that carries
/// it.
double height_range(const Model& model);

}  // namespace lockstep::stability
