// Arrays of the couplings: their coefficients, the elimination of followers, the rows that are solved.
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "state.h"

namespace lockstep::kernels {

/// What follows from the gear ratios of the plan or of this tile; errors of couplings and followers.
template <class T>
struct Couplings {
  T* coefficient;        // [coupling terms]
  T* offset;             // [couplings] with the turns of their joints (M81)
  T* turns;              // [joints] whole turns, only if a joint turns for ever
  T* share;              // entries of S
  T* follower_inverse;   // entries of J_F^-1
  T* elimination;        // [entries] (M43), where S differs
  T* correction;         // [followers] w of (M39): the velocity that corrects their errors
  T* velocity_error;     // [followers] velocity less that of S z
  T* removed_this_step;  // [followers] the part of it that this step removes by force
  T* acceleration;       // [followers] that removes this part
  T* factor;             // products of entries of S, for composite columns
  T* error;              // [couplings] C
  T* impulse;            // [couplings]: only if recorded
  T* tendon_position;    // [tendons] in the state that a lane keeps if it fails
  T* tendon_velocity;    // [tendons] the same

  template <class Take>
  void ratios(const Tables<ScalarOf<T>>& t, Take& take) {
    const auto& r = t.reduction;
    take("couplings.coefficient", coefficient, t.term_value.count, Lifetime::call);
    const bool turn = t.turning.count > 0;
    take("couplings.offset", offset, t.couplings, turn ? Lifetime::turn : Lifetime::call);
    take("couplings.turns", turns, turn ? t.joints : 0, Lifetime::turn);
    take("couplings.share", share, r.value.count, Lifetime::call);
    take("couplings.follower_inverse", follower_inverse, r.inverse_value.count, Lifetime::call);
    take("couplings.elimination", elimination, r.entries, Lifetime::call);
  }
  template <class Take>
  void followers(const Tables<ScalarOf<T>>& t, Take& take) {
    const auto& r = t.reduction;
    const int eliminated = r.eliminates() ? r.followers : 0;
    take("couplings.correction", correction, eliminated);
    take("couplings.velocity_error", velocity_error, eliminated);
    take("couplings.removed_this_step", removed_this_step, r.removes_by_force ? eliminated : 0);
    take("couplings.acceleration", acceleration, r.removes_by_force ? eliminated : 0);
    take("couplings.factor", factor, r.composite.factors.count, Lifetime::call);
  }
  template <class Take>
  void results(const Tables<ScalarOf<T>>& t, Take& take) {
    take("couplings.error", error, t.couplings);
    take("couplings.impulse", impulse, t.record_impulses ? t.couplings : 0, Lifetime::state);
    take("couplings.tendon_position", tendon_position, t.tendons.count, Lifetime::state);
    take("couplings.tendon_velocity", tendon_velocity, t.tendons.count, Lifetime::state);
  }
};

/// Couplings that are solved as rows, by row, and behind them those that are folded.
template <class T>
struct CouplingRows {
  T* value;     // [terms]
  T* response;  // [rows][solver] X = L^-T J^T
  T* delassus;  // K
  T* error;     // C
  T* rate;      // bias = rate C
  T* cfm;
  T* bias;
  T* start;                 // J v at the start of the step
  T* speed;                 // J v, in the position phase
  T* residual;              // J v + b + cfm impulse, in sweeps
  T* velocity_phase_speed;  // J v, in the velocity phase
  T* inverse;               // 1 / (r + cfm), 1 / D where K is factored, or 1 / cfm of folded couplings
  T* impulse;
  T* position_impulse;
  T* velocity_impulse;

  template <class Take>
  void arrays(const Tables<ScalarOf<T>>& t, Take& take) {
    const int rows = t.rows.count, with_impulse = t.impulse_coupling.count;
    take("rows.response", response, rows * t.solver.n);
    take("rows.delassus", delassus, t.rows.response_entries);
    take("rows.error", error, rows);
    take("rows.rate", rate, with_impulse);
    take("rows.cfm", cfm, with_impulse);
    take("rows.bias", bias, rows);
    take("rows.start", start, rows);
    take("rows.speed", speed, rows);
    take("rows.residual", residual, t.rows.columns.n > 0 ? 0 : rows, Lifetime::stage);
    take("rows.velocity_phase_speed", velocity_phase_speed, rows);
    take("rows.inverse", inverse, with_impulse);
    take("rows.impulse", impulse, rows);
    take("rows.position_impulse", position_impulse, with_impulse);
    take("rows.velocity_impulse", velocity_impulse, with_impulse);
  }
  template <class Take>
  void values(const Tables<ScalarOf<T>>& t, Take& take) {
    take("rows.value", value, t.rows.term_value.count + t.folded.term_value.count, Lifetime::call);
  }
};

}  // namespace lockstep::kernels
