// Followers that are functions of a joint, and what follows these: where they are, and S there.
// SPDX-License-Identifier: Apache-2.0
//
// (M138), (M139). Such followers are always where their couplings have them: they have no errors. S differs from step
// to step, so each integrator asks for it wherever it computes the mass matrix.
#pragma once

#include "coupling_error.h"
#include "function_values.h"
#include "gear_ratios.h"
#include "spatial_tendons.h"

namespace lockstep::kernels {

/// Puts curved followers where the other joints of `q` and their velocities `v` have them (M138).
template <class T>
void place_curved(const Tables<ScalarOf<T>>& t, const Tile<T>& x, T* q, T* v) {
  for (int i = 0; i < t.functions.placing.count; ++i) {
    const int c = t.functions.placing[i], first = t.term_start[c], f = t.functions.of_coupling[c];
    T speed = T(0);
    if (f >= 0) {
      const int leader = t.functions.places[f].leader;
      const simd::Curve<T> curve = curve_at(t, x, f, q[leader]);
      q[t.term_joint[first]] = curve.value;
      speed = curve.slope * v[t.velocity_of(leader)];
    } else {
      q[t.term_joint[first]] = -others_of(t, x, c, q);
      for (int k = first + 1; k < t.term_start[c + 1]; ++k)
        speed = fnma(x.couplings.coefficient[k], v[t.velocity_of(t.term_joint[k])], speed);
    }
    v[t.velocity_of(t.term_joint[first])] = speed;
  }
}

/// The same for positions alone.
template <class T>
void place_curved_positions(const Tables<ScalarOf<T>>& t, const Tile<T>& x, T* q) {
  for (int i = 0; i < t.functions.placing.count; ++i) {
    const int c = t.functions.placing[i], f = t.functions.of_coupling[c];
    q[t.term_joint[t.term_start[c]]] =
        f >= 0 ? curve_at(t, x, f, q[t.functions.places[f].leader]).value : -others_of(t, x, c, q);
  }
}

/// At the start of a call, in lanes that are not frozen: users may have moved joints.
template <class T>
void place_loaded(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const auto keep = [&](auto&& act) LOCKSTEP_INLINED {
    for (int i = 0; i < t.functions.placing.count; ++i) {
      const int j = t.term_joint[t.term_start[t.functions.placing[i]]], k = t.velocity_of(j);
      act(x.state.q[j], x.next.q[j]), act(x.state.v[k], x.next.v[k]);
    }
  };
  keep([](const T& now, T& before) LOCKSTEP_INLINED { before = now; });
  place_curved(t, x, x.state.q, x.state.v);
  keep([&](T& now, const T& before) LOCKSTEP_INLINED { now = select(x.frozen, before, now); });
}

/// S at x.state, and f'' for the bias forces. Puts spatial tendons where they are there. Needs kinematics().
template <class T>
void changing_shares(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int i = 0; i < t.functions.places.count; ++i) {
    const FunctionPlace& f = t.functions.places[i];
    const simd::Curve<T> curve = curve_at(t, x, i, x.state.q[f.leader]);
    x.couplings.coefficient[f.term] = -curve.slope;
    x.functions.bend[i] = curve.bend;
  }
  if (t.functions.used()) eliminate_ratios(t, x);
  if (t.spatial.used()) spatial_shares(t, x);
  use_shares(t, x);
}

}  // namespace lockstep::kernels
