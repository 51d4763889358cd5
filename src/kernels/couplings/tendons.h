// Puts tendons where their joints have them. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "coupling_error.h"

namespace lockstep::kernels {

/// Tells a traced step that the state has changed, which called stages read in memory.
template <class T>
LOCKSTEP_INLINE void keep_state(Tile<T>&) {}

/// Remembers where tendons are in the state that an environment keeps if it fails: place_tendons() writes to it.
template <class T>
LOCKSTEP_INLINE void keep_tendons(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int i = 0; i < t.tendons.count; ++i) {
    const int j = t.term_joint[t.term_start[t.tendons[i]]];
    x.couplings.tendon_position[i] = x.state.q[j], x.couplings.tendon_velocity[i] = x.state.v[t.velocity_of(j)];
  }
}

/// Puts tendons of frozen lanes back there, after a step.
template <class T>
LOCKSTEP_INLINE void put_back_tendons(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int i = 0; i < t.tendons.count; ++i) {
    const int j = t.term_joint[t.term_start[t.tendons[i]]];
    T &q = x.state.q[j], &v = x.state.v[t.velocity_of(j)];
    q = select(x.frozen, x.couplings.tendon_position[i], q);
    v = select(x.frozen, x.couplings.tendon_velocity[i], v);
  }
  keep_tendons(t, x);
}

/// (M112). Velocities in the order of followed() in consistent.h: a step leaves a tendon's where this puts it.
template <class T>
LOCKSTEP_INLINE void place_tendons(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Reduction<ScalarOf<T>>& r = t.reduction;
  for (int i = 0; i < t.tendons.count; ++i) {
    const int c = t.tendons[i], j = t.term_joint[t.term_start[c]], f = r.follower_of[j];
    T &q = x.state.q[j], &v = x.state.v[t.velocity_of(j)];
    T speed = T(0);
    for (int s = r.start[f]; s < r.start[f + 1]; ++s)
      speed = add_product(x.couplings.share[s], x.state.v[t.velocity_of(r.leader[s])], speed);
    q = select(x.frozen, q, -others_of(t, x, c, x.state.q));
    v = select(x.frozen, v, speed);
  }
  keep_state(x);
}

}  // namespace lockstep::kernels
