// What follows from the gear ratios: coefficients of couplings, S of the elimination, values of rows.
// SPDX-License-Identifier: Apache-2.0
//
// They are the same for all environments, or for all steps of a call if the field is declared. So a step computes them
// only where a follower is a function of a joint (functions.h).
#pragma once

#include "function_values.h"

namespace lockstep::kernels {

template <class T>
LOCKSTEP_INLINE void spread(Span<ScalarOf<T>> table, T* values) {
  for (int i = 0; i < table.count; ++i) values[i] = T(table[i]);
}

/// Values of rows' terms: sums of couplings' coefficients times entries of S.
template <class T>
void combine(const Rows<ScalarOf<T>>& rows, const Tile<T>& x, T* value) {
  for (int k = 0; k < rows.term_value.count; ++k) {
    T sum = T(0);
    for (int c = rows.contribution_start[k]; c < rows.contribution_start[k + 1]; ++c) {
      const Contribution part = rows.contribution[c];
      const T term = part.term < 0 ? T(1) : x.couplings.coefficient[part.term];
      sum = part.value < 0 ? sum + term : fma(term, x.couplings.share[part.value], sum);
    }
    value[k] = sum;
  }
}

/// Masses from the tables, the same in all lanes.
template <class T>
void uniform_masses(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int b = 0; b < t.bodies; ++b) {
    const Body<ScalarOf<T>>& body = t.body[b];
    x.bodies.base_inertia[b].mass = T(body.base_mass);
    for (int k = 0; k < 3; ++k) x.bodies.base_inertia[b].moment[k] = T(body.base_moment[k]);
    for (int k = 0; k < 6; ++k) x.bodies.base_inertia[b].second[k] = T(body.base_second[k]);
  }
}

/// Products of entries of S, for composite columns.
template <class T>
void composite_factors(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Span<CompositeColumns::Factor> factors = t.reduction.composite.factors;
  for (int i = 0; i < factors.count; ++i) {
    T product = T(ScalarOf<T>(factors[i].times));
    if (factors[i].left >= 0) product *= x.couplings.share[factors[i].left];
    if (factors[i].right >= 0) product *= x.couplings.share[factors[i].right];
    x.couplings.factor[i] = product;
  }
}

/// Ratios from the tables, the same in all lanes.
template <class T>
void uniform_ratios(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Bounds<ScalarOf<T>>& bounds = t.bounds;
  if (bounds.rows.count > 0) {
    spread(bounds.member_share, x.bounds.member_share);
    spread(bounds.rows.term_value, x.bounds.value);
    for (int m = 0; m < bounds.member.count; ++m)
      x.bounds.member_inverse[m] = T(ScalarOf<T>(1) / bounds.member_share[m]);
    for (int r = 0; r < bounds.rows.count; ++r) x.bounds.newly_active[r] = 0;
  }
  spread(t.term_value, x.couplings.coefficient);
  spread(t.reduction.value, x.couplings.share);
  composite_factors(t, x);
  spread(t.reduction.inverse_value, x.couplings.follower_inverse);
  if (t.functions.used()) uniform_functions(t, x);
  for (int c = 0; c < t.couplings && !t.declares(Parameter::offset); ++c)
    if (t.turning.count == 0 || !t.coupling_turns[c]) x.couplings.offset[c] = T(t.offset[c]);
  spread(t.rows.term_value, x.rows.value);
  spread(t.folded.term_value, x.rows.value + t.rows.term_value.count);
}

/// The followers' rows of S from the couplings' coefficients of this tile, by the elimination (M43) that the plan
/// lists.
template <class T>
void eliminate_ratios(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  // (M43), then S and J_F^-1 from what it leaves.
  const Reduction<ScalarOf<T>>& r = t.reduction;
  for (int i = 0; i < r.fills.count; ++i)
    x.couplings.elimination[r.fills[i].entry] =
        r.fills[i].term < 0 ? T(r.fills[i].value) : x.couplings.coefficient[r.fills[i].term];
  for (int e = 0; e < r.eliminations.count; ++e) {
    const auto& step = r.eliminations[e];
    const T factor = x.couplings.elimination[step.factor] / x.couplings.elimination[step.pivot];
    for (int u = step.first; u < step.last; ++u)
      x.couplings.elimination[r.updates[u].target] =
          fnma(factor, x.couplings.elimination[r.updates[u].source], x.couplings.elimination[r.updates[u].target]);
  }
  for (int f = 0; f < r.pivot.count; ++f) {
    const T inverse = T(1) / x.couplings.elimination[r.pivot[f]];
    for (int s = r.start[f]; s < r.start[f + 1]; ++s)
      x.couplings.share[s] = -(x.couplings.elimination[r.value_entry[s]] * inverse);
    for (int s = r.inverse_start[f]; s < r.inverse_start[f + 1]; ++s)
      x.couplings.follower_inverse[s] = x.couplings.elimination[r.inverse_entry[s]] * inverse;
  }
}

/// What follows from S: J S, and shares of joints in the rows of their bounds.
template <class T>
void use_shares(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  composite_factors(t, x);
  combine(t.rows, x, x.rows.value);
  combine(t.folded, x, x.rows.value + t.rows.term_value.count);

  const Bounds<ScalarOf<T>>& bounds = t.bounds;
  if (bounds.rows.count == 0) return;
  combine(bounds.rows, x, x.bounds.value);
  for (int m = 0; m < bounds.member.count; ++m) {
    if (bounds.member[m].share < 0) continue;
    x.bounds.member_share[m] = x.couplings.share[bounds.member[m].share];
    x.bounds.member_inverse[m] = T(1) / x.bounds.member_share[m];
    if (t.shares_change())  // a function may stand still
      x.bounds.member_inverse[m] =
          select(beyond(x.bounds.member_share[m], T(ScalarOf<T>(1e-30))), x.bounds.member_inverse[m], T(0));
  }
}

/// Gear ratios of this tile.
template <class T>
void own_ratios(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  const ScalarOf<T>* gears = batch.field(Parameter::gear_ratio);
  for (int k = 0; k < t.term_gear.count; ++k)
    if (t.term_gear[k] >= 0) x.couplings.coefficient[k] = T::load(gears + t.term_gear[k] * batch.stride);
  eliminate_ratios(t, x);
  use_shares(t, x);
}

}  // namespace lockstep::kernels
