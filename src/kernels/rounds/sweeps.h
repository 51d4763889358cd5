// Projected Gauss-Seidel over bounds, couplings and contacts: pgs beside contacts. SPDX-License-Identifier: Apache-2.0
//
// (M129). The rows are those of the Newton rounds, each with the law that it has there. A sweep visits one after the
// other, (16) of the note, with the impulses that the others have: contacts, bounds of single velocities, and rows over
// several. Friction is projected onto the disc that the normal impulse allows. What is left after the last sweep is
// left: sweeps are here to be compared with.
#pragma once

#include "kernels/contacts/law.h"
#include "rows.h"

namespace lockstep::kernels {

/// act(velocity, its column of J) of a slot's three speeds, and its column of the rows that resist turning.
template <class T, class Act>
LOCKSTEP_INLINE void each_entry(const Tables<ScalarOf<T>>& t, const TouchingPair<ScalarOf<T>>& pair,
                                const ContactSlot<T>& slot, const Tile<T>& x, Act&& act) {
  for (int k = pair.column; k < pair.column + pair.columns; ++k)
    act(t.contacts.columns[k].velocity,
        pair.slots == 1 ? x.contacts.moving[k] : cross_add(x.contacts.turning[k], slot.arm, x.contacts.moving[k]),
        by_radii(pair, x.contacts.turning[k]));
}

/// y <- A^-1 y, with the factor that holds no velocity.
template <class T>
void answer(const Tables<ScalarOf<T>>& t, T* y, Tile<T>& x) {
  const Columns& columns = t.rounds.columns;
  T* const u = x.held.raw;
  for (int j = columns.n - 1; j >= 0; --j) {
    u[j] = subtract_dot(x.held.factor + columns.offset[j] + 1, u + j + 1, columns.size[j] - 1, y[j]);
    y[j] = u[j] * x.held.inverse[j];
  }
  for (int j = 0; j < columns.n; ++j) {
    const T* const own = x.held.factor + columns.offset[j];
    for (int k = 1, below = columns.size[j]; k < below; ++k) y[j + k] = fnma(own[k], y[j], y[j + k]);
  }
}

template <class T>
LOCKSTEP_INLINE T tangential_compliance(const ContactSlot<T>& slot, const TurningFriction<T>* turning) {
  const T stiffness = turning ? turning->stiffness : slot.stiffness;
  return select(slot.live, T(1) / select(slot.live, stiffness, T(1)), T(1));
}

/// How all velocities answer a unit impulse of each contact, bound and row, one behind the other, and what a visit
/// takes back for each m/s that is missing.
template <class T>
void find_answers(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const int n = t.rounds.columns.n;
  const T zero = T(0), one = T(1), half = T(ScalarOf<T>(0.5));
  T* y = x.rounds.answer;
  const auto clear = [&](int rows) LOCKSTEP_INLINED {
    for (int k = 0; k < rows * n; ++k) y[k] = zero;
  };

  // Contacts: W_c of (M129), of which a visit needs the normal's part and the larger eigenvalue of the tangents'. The
  // trace of the rows that resist turning is no less than theirs.
  each_slot(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>& slot) LOCKSTEP_INLINED {
    TurningFriction<T>* const turning = turning_of(pair, slot, x);
    clear(turning ? 6 : 3);
    each_entry(t, pair, slot, x, [&](int k, const Vec3<T>& entry, const Vec3<T>& turns) LOCKSTEP_INLINED {
      for (int i = 0; i < 3; ++i) y[i * n + k] = entry[i];
      for (int i = 0; turning && i < 3; ++i) y[(3 + i) * n + k] = turns[i];
    });
    T response[3][3];
    for (int i = 0; i < 3; ++i, y += n) {
      answer(t, y, x);
      const RelativeTwist<T> twist = twist_of(t, pair, x, y);
      slot_speed(slot, twist, response[i]);
      if (turning && i == 0) turning->across = by_radii(pair, twist.turning);
    }
    T trace = zero;
    for (int i = 0; turning && i < 3; ++i, y += n) {
      answer(t, y, x);
      trace += by_radii(pair, twist_of(t, pair, x, y).turning)[i];
    }
    const T compliance = select(slot.live, one / select(slot.live, slot.stiffness, one), one);
    const T mean = half * (response[1][1] + response[2][2]), apart = half * (response[1][1] - response[2][2]);
    const T most = mean + sqrt(fma(apart, apart, response[1][2] * response[1][2])) + trace;
    slot.visit[0] = one / (response[0][0] + compliance);
    slot.visit[1] = one / (most + tangential_compliance(slot, turning));
    slot.across[0] = response[0][1], slot.across[1] = response[0][2];
  });

  // Bounds of single velocities, then rows over several.
  for (int r = 0; r < t.bounds.single; ++r, y += n) {
    clear(1);
    y[t.rounds.velocity[r]] = one;
    answer(t, y, x);
  }
  each_row(t, x, [&](const RowSlot& slot, ActingRow<T>&, const int* velocity, const T* value) LOCKSTEP_INLINED {
    clear(1);
    for (int k = 0; k < slot.last - slot.first; ++k) y[velocity[k]] = value[k];
    answer(t, y, x);
    y += n;
  });
}

/// Visits a contact: its normal, and then friction, which moves by the larger response of its rows. Returns how many
/// rows it has.
template <class T>
LOCKSTEP_INLINE int visit_slot(const Tables<ScalarOf<T>>& t, const TouchingPair<ScalarOf<T>>& pair, T friction,
                               typename T::Mask lanes, const T* y, T* z, ContactSlot<T>& slot, Tile<T>& x) {
  const int n = t.rounds.columns.n;
  const T zero = T(0), one = T(1);
  TurningFriction<T>* const turning = turning_of(pair, slot, x);
  const int rows = turning ? 6 : 3;
  T* const impulse = slot.force.impulse;
  T u[3], change[6], along[2];
  const RelativeTwist<T> twist = twist_of(t, pair, x, z);
  slot_speed(slot, twist, u);

  // The normal (M129).
  const T compliance = select(slot.live, one / select(slot.live, slot.stiffness, one), zero);
  const auto acts = slot.live & lanes;
  const T missing = fma(compliance, impulse[0] - slot.push, u[0] + slot.bias);
  const T asked = larger(fnma(slot.visit[0], missing, impulse[0]), zero);
  change[0] = select(acts, select(slot.given, slot.normal, asked) - impulse[0], zero);
  impulse[0] += change[0];

  // Friction, on the disc that the new normal impulse allows.
  const T yields = tangential_compliance(slot, turning);
  for (int i = 0; i < 2; ++i) {
    const T slides = fma(slot.across[i], change[0], u[1 + i]) + slot.drift[i];
    along[i] = fnma(slot.visit[1], fma(yields, impulse[1 + i] - slot.carried[i], slides), impulse[1 + i]);
  }
  T squared = fma(along[0], along[0], along[1] * along[1]);
  Vec3<T> about = Vec3<T>::zero();
  if (turning) {
    Vec3<T>& own = turning->force.impulse;
    const Vec3<T> turns = fma(turning->across, change[0], by_radii(pair, twist.turning)) + turning->drift;
    about = own - scaled(fma(own - turning->carried, yields, turns), slot.visit[1]);
    squared += dot(about, about);
  }
  const T length = sqrt(squared), most = friction * impulse[0];
  const auto slides = less(most, length);
  const T share = select(slides, most / larger(length, T(ScalarOf<T>(1e-30))), one);
  for (int i = 0; i < 2; ++i) {
    change[1 + i] = select(acts, fma(share, along[i], -impulse[1 + i]), zero);
    impulse[1 + i] += change[1 + i];
  }
  for (int i = 0; turning && i < 3; ++i) {
    T& own = turning->force.impulse[i];
    change[3 + i] = select(acts, fma(share, about[i], -own), zero);
    own += change[3 + i];
  }

  // What has changed, and the velocities that it moves.
  slot.force.slides = (slot.force.slides & ~lanes) | (acts & slides & less(zero, impulse[0]));
  slot.force.sticks = (slot.force.sticks & ~lanes) | (acts & ~slides & less(zero, impulse[0]));
  for (int i = 0; i < rows; ++i)
    for (int k = 0; k < n; ++k) z[k] = fma(y[i * n + k], change[i], z[k]);
  return rows;
}

/// One sweep over everything, in these lanes.
template <class T>
void sweep_all(const Tables<ScalarOf<T>>& t, typename T::Mask lanes, T* z, Tile<T>& x) {
  const int n = t.rounds.columns.n;
  const T* y = x.rounds.answer;
  const auto push = [&](T change) LOCKSTEP_INLINED {
    for (int k = 0; k < n; ++k) z[k] = fma(y[k], change, z[k]);
    y += n;
  };
  each_slot(t, x, [&](const auto& pair, const ContactPatch<T>& patch, ContactSlot<T>& slot) LOCKSTEP_INLINED {
    y += n * visit_slot(t, pair, patch.friction, lanes, y, z, slot, x);
  });
  for (int r = 0; r < t.bounds.single; ++r) {
    const int k = t.rounds.velocity[r];
    T& impulse = x.rounds.single_impulse[r];
    const Branch<T> found = project(interval_of(t, x, r, position_phase), fnma(y[k], impulse, z[k]), y[k]);
    const T change = select(lanes, found.impulse - impulse, T(0));
    impulse += change;
    replace(x.search.branch[r], found, lanes);
    push(change);
  }
  each_row(t, x, [&](const RowSlot& slot, ActingRow<T>& row, const int* velocity, const T* value) LOCKSTEP_INLINED {
    const T response = row_speed(slot, velocity, value, y), speed = row_speed(slot, velocity, value, z);
    const Bound<T> bound{row.lo, row.hi, row.centre, row.force, row.cfm};
    const Branch<T> found = project(bound, fnma(response, row.law.impulse, speed), response);
    const T change = select(lanes, found.impulse - row.law.impulse, T(0));
    replace(row.law, found, lanes);
    push(change);
  });
}

/// So many sweeps, from no impulses or from those of the position phase, as pgs does without contacts. Where a servo
/// turns out to be at its limit, or not, they begin once more. Returns the lanes in which servos have not settled.
template <class T>
typename T::Mask sweep(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int times, bool from_zero,
                       typename T::Mask lanes, Tile<T>& x) {
  const int n = t.rounds.columns.n;
  const T zero = T(0);
  T *const z = x.rounds.z, *const swept = x.rounds.gradient;
  constexpr int most_guesses = 4;  // of the limited servos
  auto open = lanes;
  for (int guess = 0; guess < most_guesses && any(open); ++guess) {
    // The impulses to begin with.
    const auto fresh = from_zero ? open : T::none();
    for (int r = 0; r < t.bounds.single; ++r) {
      x.rounds.single_impulse[r] = select(fresh, zero, x.rounds.single_impulse[r]);
      replace(x.search.branch[r], {T::none(), T::none(), T::none(), zero}, open);
    }
    each_slot(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>& slot) LOCKSTEP_INLINED {
      const T last[3] = {slot.pressed, slot.memory[0], slot.memory[1]};
      for (int i = 0; i < 3; ++i)
        slot.force.impulse[i] = select(open, select(fresh | ~slot.live, zero, last[i]), slot.force.impulse[i]);
      if (TurningFriction<T>* const turning = turning_of(pair, slot, x)) {
        const Vec3<T> begins = select<T>(fresh | ~slot.live, Vec3<T>::zero(), turning->memory);
        turning->force.impulse = select<T>(open, begins, turning->force.impulse);
      }
    });
    each_row(t, x, [&](const RowSlot& slot, ActingRow<T>& row, const int*, const T*) LOCKSTEP_INLINED {
      const T last = slot.bounded >= 0 ? x.bounds.impulse[slot.bounded] : x.rows.position_impulse[slot.coupling];
      row.law.impulse = select(open, select(fresh, zero, last), row.law.impulse);
    });

    // The matrix, with servos as they are taken for, and what all velocities answer.
    round_terms(t, batch, position_phase, x);
    for (int k = 0; k < n; ++k) x.held.mask[k] = T::none();
    copy_matrix(t, x);
    x.rounds.weak = x.rounds.weak | (factor_masked(t, x) & open);
    find_answers(t, x);

    // The velocities that these impulses lead to, and the sweeps from there.
    for (int k = 0; k < n; ++k) swept[k] = x.held.rhs[k];
    for (int r = 0; r < t.bounds.single; ++r) swept[t.rounds.velocity[r]] += x.rounds.single_impulse[r];
    each_slot(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>& slot) LOCKSTEP_INLINED {
      const Vec3<T> f{slot.force.impulse[0], slot.force.impulse[1], slot.force.impulse[2]};
      const TurningFriction<T>* const turning = turning_of(pair, slot, x);
      each_entry(t, pair, slot, x, [&](int k, const Vec3<T>& entry, const Vec3<T>& turns) LOCKSTEP_INLINED {
        swept[k] += dot(entry, f);
        if (turning) swept[k] += dot(turns, turning->force.impulse);
      });
    });
    add_row_momentum(t, swept, x);
    answer(t, swept, x);
    for (int k = 0; k < n; ++k) swept[k] += x.held.start[k];
    for (int s = 0; s < times; ++s) sweep_all(t, open, swept, x);
    for (int k = 0; k < n; ++k) x.held.velocity[k] = z[k] = select(open, swept[k], z[k]);
    open = move_servos(t, batch, position_phase, T::none(), T::none(), open, x);
  }

  // Speeds at the result.
  slot_speeds(t, z, &ContactSlot<T>::speed, x);
  each_row(t, x, [&](const RowSlot& slot, ActingRow<T>& row, const int* velocity, const T* value) LOCKSTEP_INLINED {
    row.speed = select(lanes, row_speed(slot, velocity, value, z), row.speed);
  });
  return open;
}

}  // namespace lockstep::kernels
