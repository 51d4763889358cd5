// Where a step began, while its stages look elsewhere. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tile.h"

namespace lockstep::kernels {

template <class T>
void keep_begin(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int j = 0; j < t.joints; ++j) x.begin_q[j] = x.q[j];
  for (int k = 0; k < t.velocities; ++k) x.begin_v[k] = x.v[k];
  for (int k = 0; t.floating && k < 7; ++k) x.begin_pose[k] = x.root_pose[k];
}

/// What fails keeps this state: check.h.
template <class T>
void return_to_begin(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int j = 0; j < t.joints; ++j) x.q[j] = x.begin_q[j];
  for (int k = 0; k < t.velocities; ++k) x.v[k] = x.begin_v[k];
  for (int k = 0; t.floating && k < 7; ++k) x.root_pose[k] = x.begin_pose[k];
}

}  // namespace lockstep::kernels
