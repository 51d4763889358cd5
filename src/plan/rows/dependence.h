// Whether directions are linearly dependent. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <vector>

namespace lockstep {

/// Of `directions`, each by velocity, of n velocities in all.
bool depend(const std::vector<std::map<int, double>>& directions, int n);

}  // namespace lockstep
