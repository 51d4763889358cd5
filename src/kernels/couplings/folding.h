// Soft couplings as part of A_r and of the forces (M95). SPDX-License-Identifier: Apache-2.0
//
// A spring that is taken at the end of the step is linear in the new velocities, as servos are. So it needs no row.
#pragma once

#include "free_velocity.h"
#include "row_terms.h"

namespace lockstep::kernels {

/// Adds the folded couplings to A_r. A coupling without a response, whose inertia is singular, adds nothing.
template <class T>
void fold_matrix(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Rows<ScalarOf<T>>& rows = t.folded;
  const T* const value = x.rows.value + t.rows.term_value.count;
  T* const reduced = x.dynamics.reduced;
  const int* entry = t.folded_entry.data;
  typename T::Mask weak = T::none();
  for (int r = 0; r < rows.count; ++r) {
    const int i = t.rows.count + r, undamped = t.undamped_row[i];
    set_softness(rows.softness[r], undamped < 0 ? T(0) : x.undamped.compliance[undamped], i, x);
    const T stiffness = x.rows.inverse[i] = inverse_of(x.rows.cfm[i], least_pivot<T>(), weak);
    for (int k = rows.term_start[r]; k < rows.term_start[r + 1]; ++k) {
      const T share = stiffness * value[k];
      for (int l = rows.term_start[r]; l <= k; ++l, ++entry) reduced[*entry] = fma(share, value[l], reduced[*entry]);
    }
  }
}

/// Adds what the folded couplings do to the momentum to gain. Followers move by their corrections in the position
/// phase.
template <class T>
void fold_forces(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Rows<ScalarOf<T>>& rows = t.folded;
  const T* const value = x.rows.value + t.rows.term_value.count;
  T *const position = x.dynamics.half_solved_position, *const velocity = x.dynamics.half_solved_velocity;
  const bool twice = x.solves_twice && velocity != position;
  for (int r = 0; r < rows.count; ++r) {
    const int i = t.rows.count + r, coupling = rows.coupling[r];
    T speed = x.rows.rate[i] * x.couplings.error[coupling];
    for (int k = rows.term_start[r]; k < rows.term_start[r + 1]; ++k)
      speed = fma(value[k], x.dynamics.start[rows.term_index[k]], speed);
    const T impulse = x.rows.inverse[i] * speed;
    const T corrected = x.rows.inverse[i] * with_corrections(t, x, coupling, speed);
    for (int k = rows.term_start[r]; k < rows.term_start[r + 1]; ++k) {
      const int z = rows.term_index[k];
      position[z] = fnma(value[k], corrected, position[z]);
      if (twice) velocity[z] = fnma(value[k], impulse, velocity[z]);
    }
  }
}

/// The impulses of the folded couplings (M96), for plans that record them.
template <class T>
void folded_impulses(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const auto impulse = [&](int i, const T* v) LOCKSTEP_INLINED {
    const int c = t.impulse_coupling[i];
    T speed = x.rows.rate[i] * x.couplings.error[c];
    for (int k = t.term_start[c]; k < t.term_start[c + 1]; ++k)
      speed = fma(x.couplings.coefficient[k], v[t.velocity_of(t.term_joint[k])], speed);
    return -(x.rows.inverse[i] * speed);
  };
  for (int i = t.rows.count; i < t.impulse_coupling.count; ++i) {
    x.rows.velocity_impulse[i] = impulse(i, x.next.v);
    x.rows.position_impulse[i] =
        t.record_diagnostics ? impulse(i, x.diagnostics.moved_velocity) : x.rows.velocity_impulse[i];
  }
}

}  // namespace lockstep::kernels
