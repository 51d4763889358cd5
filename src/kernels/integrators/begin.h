// Where a step began, while its stages look elsewhere. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/tile/tile.h"

namespace lockstep::kernels {

template <class T>
void keep_begin(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int j = 0; j < t.joints; ++j) x.stages.begin.q[j] = x.state.q[j];
  for (int k = 0; k < t.velocities; ++k) x.stages.begin.v[k] = x.state.v[k];
  for (int k = 0; t.floating && k < 7; ++k) x.stages.begin.pose[k] = x.state.pose[k];
}

/// What fails keeps this state: check.h.
template <class T>
void return_to_begin(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int j = 0; j < t.joints; ++j) x.state.q[j] = x.stages.begin.q[j];
  for (int k = 0; k < t.velocities; ++k) x.state.v[k] = x.stages.begin.v[k];
  for (int k = 0; t.floating && k < 7; ++k) x.state.pose[k] = x.stages.begin.pose[k];
}

}  // namespace lockstep::kernels
