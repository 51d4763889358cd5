// Accelerations of followers that are functions of a joint: (M139). SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/tile/tile.h"

namespace lockstep::kernels {

/// J_F^-1 f'' v^2, with the velocities of x.state: what the bias forces add at the followers' joints.
template <class T>
void curved_accelerations(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Reduction<ScalarOf<T>>& r = t.reduction;
  for (int f = 0; f < r.followers; ++f) {
    T sum = T(0);
    for (int s = r.inverse_start[f]; s < r.inverse_start[f + 1]; ++s) {
      const int i = t.functions.of_coupling[r.inverse_coupling[s]];
      if (i < 0) continue;
      const T v = x.state.v[t.velocity_of(t.functions.places[i].leader)];
      sum = fma(x.couplings.follower_inverse[s], x.functions.bend[i] * v * v, sum);
    }
    x.functions.acceleration[f] = sum;
  }
}

/// What these take of the armatures, which no body has.
template <class T>
void add_curved_armatures(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  const Reduction<ScalarOf<T>>& r = t.reduction;
  const Field<T> armature = field<T>(batch, Parameter::armature, t.armature.data);
  for (int f = 0; f < r.followers; ++f) {
    const int j = r.follower[f];
    T& bias = x.dynamics.bias[t.velocity_of(j)];
    bias = fma(armature.at(j, t.dof[j]), x.functions.acceleration[f], bias);
  }
}

}  // namespace lockstep::kernels
