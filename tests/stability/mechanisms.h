// The mechanisms of the stability suite. SPDX-License-Identifier: Apache-2.0
//
// Links are those of tests/scenes unless said otherwise. Joints are j0, j1, ... in order.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "lockstep/model.h"

namespace lockstep::stability {

/// One driven joint and `followers` that mimic it, all 1 rad off, hung on the link `carrier`.
Model star(int followers, const std::string& carrier);

/// A serial arm of 17 links whose every joint mimics the one before; all 16 couplings start 1 rad off.
Model serial();

/// chain8 with q_A = ratio q_B, off by 1 rad.
Model geared(double ratio);

/// chain8 with other masses and damping in proportion to them, 1 rad off: what is asked is whether couplings and
/// arithmetic bear the masses. Undamped heavy links ask how far an integrator of first order keeps energy, which is
/// another question.
Model weighing(const std::function<double(int)>& mass);

/// Two continuous joints about the vertical with q_0 = 2 q_1, j1 pushed round and round.
Model turning();

/// Two links about y in gravity, side by side or the second on the first, with q_0 = -ratio q_1.
enum class Arrangement { side_by_side, second_on_first };
Model pair(Arrangement arrangement, double ratio = -1.0);

/// One slider of 1 kg with no gravity, and `others` like it: closed forms. Joints s0, s1, ...
Model sliding(int sliders);

/// chain8 with the loop (0,2), (2,4), (0,4): the third coupling follows from the others up to its offset.
Model loop(double offset);

/// From the lowest to the highest that every link can be, J: twice the length of the chain that carries it.
double height_range(const Model& model);

}  // namespace lockstep::stability
