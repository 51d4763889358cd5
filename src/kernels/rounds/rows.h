// Rows over several velocities in the Newton rounds: their law, and how they enter a round. SPDX-License-Identifier:
// Apache-2.0
//
// (M117) to (M119). Every kind of row has one law, (M55). A row that is hard, or too stiff for the matrix of a round,
// gets a compliance that is small beside its response. A multiplier takes back what this compliance lets through.
#pragma once

#include "kernels/bounds/held_velocities.h"
#include "kernels/loops/loop_rows.h"

namespace lockstep::kernels {

/// sigma of (M118), and how far it may be lowered.
template <class S>
constexpr S added_share = S(sizeof(S) == 4 ? 1e-4 : 1e-7);
template <class S>
constexpr S least_added_share = S(sizeof(S) == 4 ? 1e-6 : 1e-9);
/// What a hard row may miss, as a share of the speeds that meet in it (M119).
template <class S>
constexpr S row_tolerance = S(sizeof(S) == 4 ? 1e-6 : 1e-12);

constexpr int most_updates = 12;  ///< of the multipliers in one solve

/// act(slot, its row, its velocities, their values)
template <class T, class Act>
LOCKSTEP_INLINE void each_row(const Tables<ScalarOf<T>>& t, const Tile<T>& x, Act&& act) {
  const Rounds& rounds = t.rounds;
  for (int s = 0; s < rounds.slots.count; ++s) {
    const RowSlot& slot = rounds.slots[s];
    const T* const values = (slot.bounded >= 0 ? x.bounds.value
                             : slot.loop >= 0  ? x.loops.value
                                               : x.rows.value) +
                            slot.value;
    act(slot, x.rounds.row[s], rounds.term.data + slot.first, values);
  }
}

/// J z
template <class T>
LOCKSTEP_INLINE T row_speed(const RowSlot& slot, const int* velocity, const T* value, const T* z) {
  T sum = T(0);
  for (int k = 0, count = slot.last - slot.first; k < count; ++k) sum = fma(value[k], z[velocity[k]], sum);
  return sum;
}

/// (M117): the branch and the impulse at the speed u.
template <class T>
LOCKSTEP_INLINE Branch<T> row_law(const ActingRow<T>& row, T u) {
  return project(Bound<T>{row.lo, row.hi, row.centre, row.force, row.cfm}, fnma(row.added, row.multiplier, u),
                 row.added);
}

/// The impulse at the speed u on the branch that the row is on.
template <class T>
LOCKSTEP_INLINE T impulse_on_branch(const ActingRow<T>& row, T u) {
  const Bound<T> bound{row.lo, row.hi, row.centre, row.force, row.cfm};
  const T reached = fnma(row.added, row.multiplier, u);
  return select(held(row.law), (target(bound, row.law) - reached) / (row.added + row.cfm), row.law.impulse);
}

/// Minus the derivative of the impulse, where the row is on this branch.
template <class T>
LOCKSTEP_INLINE T row_gain(const ActingRow<T>& row, const Branch<T>& law) {
  return select(held(law), T(1) / (row.added + row.cfm), T(0));
}

/// J A^-1 J^T of the rows whose softness refers to it. Factors A in x.held.factor.
template <class T>
void exact_responses(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Columns& columns = t.rounds.columns;
  const int n = columns.n;
  for (int k = 0; k < n; ++k) {
    x.held.diagonal[k] = x.held.matrix[columns.offset[k]];
    x.held.mask[k] = T::none();
  }
  copy_matrix(t, x);
  factor_masked(t, x);
  T* const y = x.rounds.step;
  each_row(t, x, [&](const RowSlot& slot, ActingRow<T>& row, const int* velocity, const T* value) {
    if (slot.bounded < 0 && slot.loop < 0) return;
    for (int k = 0; k < n; ++k) y[k] = T(0);
    for (int k = 0; k < slot.last - slot.first; ++k) y[velocity[k]] = value[k];
    T sum = T(0);
    for (int j = n - 1; j >= 0; --j) {
      y[j] = subtract_dot(x.held.factor + columns.offset[j] + 1, y + j + 1, columns.size[j] - 1, y[j]);
      sum = fma(y[j] * y[j], x.held.inverse[j], sum);
    }
    row.own_response = sum;
  });
}

/// (M63): whether a servo is at its limit is decided by the velocity phase. Elsewhere it then has no limit, or its
/// force.
template <class T>
LOCKSTEP_INLINE void decide_servo(typename T::Mask decided, ActingRow<T>& row) {
  const T far = T(ScalarOf<T>(unlimited));
  const auto holds = held(row.law), pulls = less(T(0), row.law.impulse);
  row.force = select(decided & holds, far, row.force);
  row.centre = select(decided & ~holds, select(pulls, -far, far), row.centre);
}

/// What a coupling asks of its speed in the position phase: its bias, with the corrections of followers.
template <class T>
LOCKSTEP_INLINE T position_phase_bias(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int e) {
  const int coupling = t.rows.coupling[e];
  return with_corrections(t, x, coupling, x.rows.rate[e] * x.couplings.error[coupling]);
}

/// Compliance, interval and box of the rows in one phase, without multipliers.
template <class T>
void open_row_slots(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Phase phase, Tile<T>& x) {
  using S = ScalarOf<T>;
  const Bounds<S>& b = t.bounds;
  const T far = T(S(unlimited)), zero = T(0);
  each_row(t, x, [&](const RowSlot& slot, ActingRow<T>& row, const int*, const T*) {
    if (slot.loop >= 0) return;
    if (slot.coupling >= 0) {  // an equality
      const int e = slot.coupling;
      row.lo = -far, row.hi = far, row.force = far;
      row.centre = phase == position_phase ? position_phase_bias(t, x, e) : velocity_phase_bias(t, x, e);
      row.cfm = x.rows.cfm[e];
    } else {
      const int r = slot.bounded, i = phase * b.rows.count + r, undamped = b.undamped_row[r];
      row.lo = x.bounds.lo[i], row.hi = x.bounds.hi[i], row.force = x.bounds.force[r];
      row.centre = b.kind[r] == BoundKind::joint ? zero : x.bounds.centre[i];
      if (b.kind[r] == BoundKind::servo) {
        row.cfm = x.bounds.cfm[r];
        decide_servo(x.servos.decided, row);
      } else {
        const RowSoftness<S>& softness = b.rows.softness[r];
        const T response = undamped >= 0 ? x.undamped.compliance[undamped] : row.own_response;
        row.cfm = b.kind[r] == BoundKind::joint || b.kind[r] == BoundKind::drive ? zero : T(softness.cfm);
        if (softness.cfm_per_response > 0) row.cfm = fma(T(softness.cfm_per_response), response, row.cfm);
        x.bounds.cfm[r] = row.cfm;
      }
    }
  });

  // Response by the diagonal of A (M118), and speeds that meet in the row (M119).
  each_row(t, x, [&](const RowSlot& slot, ActingRow<T>& row, const int* velocity, const T* value) {
    T response = zero;
    row.rounding = zero;
    for (int k = 0; k < slot.last - slot.first; ++k) {
      const T mobility = T(1) / x.held.matrix[t.rounds.columns.offset[velocity[k]]];
      response = fma(value[k] * value[k], mobility, response);
      const T pushed = absolute(x.held.momentum[phase * t.rounds.columns.n + velocity[k]]) * mobility;
      row.rounding = fma(absolute(value[k]), pushed, row.rounding);
    }
    row.response = response;
  });
  if (t.loops.used()) open_loop_rows(t, batch, phase, x);

  // Compliance to add (M117). A row that moves nothing takes no impulse.
  each_row(t, x, [&](const RowSlot&, ActingRow<T>& row, const int*, const T*) {
    row.added = larger(fma(T(added_share<S>), row.response, -row.cfm), zero);
    row.cfm = select(less(zero, row.added + row.cfm), row.cfm, infinite_compliance<T>());
    row.multiplier = zero;
    row.yields = T::none();
  });
}

/// The law of all rows at the iterate.
template <class T>
void evaluate_rows(const Tables<ScalarOf<T>>& t, const T* z, Tile<T>& x) {
  each_row(t, x, [&](const RowSlot& slot, ActingRow<T>& row, const int* velocity, const T* value) LOCKSTEP_INLINED {
    row.speed = row_speed(slot, velocity, value, z);
    row.law = row_law(row, row.speed);
  });
}

/// Adds J^T impulse.
template <class T>
void add_row_momentum(const Tables<ScalarOf<T>>& t, T* momentum, Tile<T>& x) {
  each_row(t, x, [&](const RowSlot& slot, ActingRow<T>& row, const int* velocity, const T* value) LOCKSTEP_INLINED {
    for (int k = 0; k < slot.last - slot.first; ++k)
      momentum[velocity[k]] = fma(value[k], row.law.impulse, momentum[velocity[k]]);
  });
}

/// Adds J^T G J to the packed `matrix`.
template <class T>
void add_row_gains(const Tables<ScalarOf<T>>& t, T* matrix, Tile<T>& x) {
  each_row(t, x, [&](const RowSlot& slot, ActingRow<T>& row, const int*, const T* value) LOCKSTEP_INLINED {
    const T gain = row_gain(row, row.law);
    const int* entry = t.rounds.term_entry.data + slot.entry;
    for (int k = 0; k < slot.last - slot.first; ++k) {
      const T share = gain * value[k];
      for (int l = 0; l <= k; ++l, ++entry) matrix[*entry] = fma(share, value[l], matrix[*entry]);
    }
  });
}

/// The speeds that meet in a row: what is below the rounding of these is zero.
template <class T>
LOCKSTEP_INLINE T size_of_row(const RowSlot& slot, const ActingRow<T>& row, const int* velocity, const T* value,
                              const T* z) {
  T size = row.rounding;
  for (int k = 0; k < slot.last - slot.first; ++k) size = fma(absolute(value[k]), absolute(z[velocity[k]]), size);
  return size + absolute(target(Bound<T>{row.lo, row.hi, row.centre, row.force, row.cfm}, row.law));
}

/// The law at the iterate, whose speeds are computed afresh: sums of many steps would drift. Rows stay on their branch
/// unless the solution of the round contradicts it by more than rounding, or the lane has not taken all of the step
/// (`bends`). Returns the lanes in which some row leaves its branch.
template <class T>
typename T::Mask move_rows(const Tables<ScalarOf<T>>& t, const T* z, typename T::Mask bends, typename T::Mask open,
                           Tile<T>& x) {
  typename T::Mask moved = T::none();
  each_row(t, x, [&](const RowSlot& slot, ActingRow<T>& row, const int* velocity, const T* value) LOCKSTEP_INLINED {
    row.speed = row_speed(slot, velocity, value, z);
    const T compliance = row.added + row.cfm, without = fnma(row.added, row.multiplier, row.speed);
    const Bound<T> bound{row.lo, row.hi, row.centre, row.force, row.cfm};
    const T impulse = impulse_on_branch(row, row.speed);
    const T slack = rounding<T>() * size_of_row(slot, row, velocity, value, z);
    typename T::Mask changed;
    const Branch<T> before = row.law;
    advance_branch(bound, row.law, fma(compliance, impulse, without), impulse, slack,
                   slack / larger(row.response + row.cfm, T(ScalarOf<T>(1e-30))), changed);
    const auto renewed = changed | bends;
    row.law.impulse = impulse;
    replace(row.law, row_law(row, row.speed), renewed);
    replace(row.law, before, ~open);
    moved = moved | (changed & open);
  });
  return moved;
}

/// What the updates of the multipliers know of a lane.
template <class T>
struct Updates {
  T count = T(0);
  T missing = T(0);  // largest share of the allowance, before the last update
};

/// (M119): after a round in which nothing has changed its branch, in the lanes `settled`. Rows whose added compliance
/// shows take their impulse as multiplier. Returns the lanes that need a further round.
template <class T>
typename T::Mask update_multipliers(const Tables<ScalarOf<T>>& t, const T* z, typename T::Mask settled,
                                    Updates<T>& updates, Tile<T>& x) {
  using S = ScalarOf<T>;
  const T zero = T(0), tolerance = T(row_tolerance<S>);

  // What each row misses, by rank, and whether some row may still get stiffer.
  T largest = zero;
  typename T::Mask missing[ranks], may_stiffen = T::none();
  for (auto& rank : missing) rank = T::none();
  each_row(t, x, [&](const RowSlot& slot, ActingRow<T>& row, const int* velocity, const T* value) LOCKSTEP_INLINED {
    const T error = row.added * absolute(row.law.impulse - row.multiplier),
            allowed = tolerance * size_of_row(slot, row, velocity, value, z);
    const auto misses = settled & held(row.law) & ~row.yields & less(allowed, error);
    row.missing = select(misses, error / larger(allowed, T(S(1e-30))), zero);
    largest = larger(largest, row.missing);
    may_stiffen = may_stiffen | (misses & less(T(S(1.01) * least_added_share<S>) * row.response, row.added));
    missing[static_cast<int>(slot.rank)] = missing[static_cast<int>(slot.rank)] | misses;
  });
  auto open = settled & less(zero, largest) & less(updates.count, T(S(most_updates)));
  if (!any(open)) return open;

  // An update that leaves much behind: the added compliance is too large, or rows contradict each other.
  const auto again = open & less(zero, updates.count);
  const auto slow = again & ~less(largest, T(S(0.1)) * updates.missing),
             stalls = again & ~less(largest, T(S(0.5)) * updates.missing) & ~may_stiffen;
  auto higher = T::none(), gives_way = stalls;
  typename T::Mask yields[ranks];
  for (int rank = 0; rank < ranks; ++rank) yields[rank] = T::none();
  for (int rank = ranks - 1; rank > 0; --rank) {  // the last rank that misses, if one before it does too
    higher = T::none();
    for (int before = 0; before < rank; ++before) higher = higher | missing[before];
    yields[rank] = gives_way & missing[rank] & higher;
    gives_way = gives_way & ~missing[rank];
  }

  // Lanes go on while updates help.
  auto conflict = T::none();
  for (const auto& rank : yields) conflict = conflict | rank;
  open = open & (conflict | may_stiffen | ~(again & ~less(largest, T(S(0.9)) * updates.missing)));

  // Rows yield, get stiffer, or keep their impulse as multiplier.
  each_row(t, x, [&](const RowSlot& slot, ActingRow<T>& row, const int*, const T*) LOCKSTEP_INLINED {
    const auto misses = less(zero, row.missing) & open;
    const auto gives = misses & yields[static_cast<int>(slot.rank)];
    row.yields = row.yields | gives;
    const T smaller_share = larger(T(S(0.1)) * row.added, T(least_added_share<S>) * row.response);
    row.added =
        select(gives, row.response, select(misses & slow & ~conflict, smaller(row.added, smaller_share), row.added));
    const auto takes = open & ~row.yields & less(zero, row.added);
    // Beside a conflict that has just ended, multipliers have grown for nothing.
    row.multiplier = select(open & conflict, zero, select(takes, row.law.impulse, row.multiplier));
    row.multiplier = select(row.yields, zero, row.multiplier);
    row.law.impulse = select(settled, impulse_on_branch(row, row.speed), row.law.impulse);
  });
  updates.count = select(open, updates.count + T(1), updates.count);
  updates.missing = select(open, select(conflict, T(S(1e30)), largest), updates.missing);
  return open;
}

}  // namespace lockstep::kernels
