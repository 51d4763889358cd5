// Finds the active set where every bounded row bounds one velocity of its own. SPDX-License-Identifier: Apache-2.0
//
// (M83) to (M85). A round assumes for every velocity whether it is held at an end of its interval or at rest, or which
// impulse acts on it, and for every limited servo whether it is at its limit. It solves with held velocities masked in
// the factor of A itself, so no row needs a response, and moves what the solution contradicts to the neighbouring piece
// of (M54). A lane that has finished is solved again with the others, to the same bits.
#pragma once

#include "kernels/dynamics/ldlt.h"
#include "kernels/tile/control.h"
#include "projection.h"

namespace lockstep::kernels {

constexpr int all_move = 8;         ///< rounds in which everything may move; later one at a time, which cannot cycle
constexpr int rounds_for_each = 4;  ///< further rounds, for each row and servo
constexpr int sweeps_for_the_rest = 50;  ///< of lanes that ran out of rounds

/// Keeps A before it is factored in place, but for trees with articulated bodies (matrix_of_bodies()).
template <class T>
LOCKSTEP_INLINE void keep_matrix(const Tables<ScalarOf<T>>& t, const Tile<T>& x) {
  const int entries = t.rounds.columns.entries;
  if (!t.rounds.renumbered) {
    for (int e = 0; e < entries; ++e) x.held.matrix[e] = x.dynamics.reduced[e];
    return;
  }
  for (int e = 0; e < entries; ++e) x.held.matrix[e] = T(0);
  const Span<CopiedEntry> copies = t.rounds.from_reduced;
  for (int i = 0; i < copies.count; ++i) x.held.matrix[copies[i].to] = x.dynamics.reduced[copies[i].from];
}

/// A of the trees that articulated bodies solve, which have not computed it.
template <class T>
void matrix_of_bodies(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Span<CopiedEntry> copies = t.rounds.from_bodies;
  if (copies.count == 0) return;
  for (int i = t.tree.count - 1; i >= 0; --i) {
    const TreeStructure& tree = t.tree[i];
    if (tree.inertia != InertiaKind::articulated_bodies) continue;
    mass_matrix(t, tree, x);
    for (int j = tree.first_joint; j < tree.last_joint; ++j)
      x.dynamics.matrix[t.matrix.offset[t.velocity_of(j)]] += x.dynamics.joint_inertia[j];
  }
  for (int i = 0; i < copies.count; ++i) x.held.matrix[copies[i].to] = x.dynamics.matrix[copies[i].from];
}

/// From the solver's numbers to those of the rounds, and back.
template <class T>
LOCKSTEP_INLINE void to_rounds(const Tables<ScalarOf<T>>& t, const T* solver, T* rounds) {
  const Span<int> place = t.rounds.place;
  for (int z = 0; z < place.count; ++z) rounds[place[z]] = solver[z];
}
template <class T>
LOCKSTEP_INLINE void from_rounds(const Tables<ScalarOf<T>>& t, const T* rounds, T* solver) {
  const Span<int> place = t.rounds.place;
  for (int z = 0; z < place.count; ++z) solver[z] = rounds[place[z]];
}

/// Keeps the momentum to gain, before it is half solved in place, and the velocities at the start.
template <class T>
LOCKSTEP_INLINE void keep_momentum(const Tables<ScalarOf<T>>& t, const Tile<T>& x) {
  const int n = t.rounds.columns.n;
  to_rounds(t, x.dynamics.half_solved_position, x.held.momentum);
  if (t.solve_twice) to_rounds(t, x.dynamics.half_solved_velocity, x.held.momentum + n);
  if (t.rounds.renumbered) to_rounds(t, x.dynamics.start, x.held.start);
}

/// Lanes in which the search decides about limited servo i. Elsewhere a stage has it among the linear terms.
template <class T>
LOCKSTEP_INLINE typename T::Mask searched(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int i) {
  return t.integrator == Integrator::euler ? ~T::none() : x.servos.bounded[i];
}

/// A limited servo at velocity z of its solver velocity: its force (M63) if nothing limits it.
template <class T>
LOCKSTEP_INLINE T servo_force(const Tables<ScalarOf<T>>& t, const Tile<T>& x, const Servo<T>& own, int i, Phase phase,
                              T effort, T z) {
  const LimitedServo& servo = t.rounds.servos[i];
  T v = servo.share < 0 ? z : x.couplings.share[servo.share] * z;
  if (phase == position_phase && x.servos.corrected && servo.follower >= 0) v += x.couplings.correction[servo.follower];
  return own.force(x.servos.duration, x.servos.from[t.limited_servos[i]], v) + effort;
}

/// -1 or 1 for the end of the limit that the force is beyond, 0 if it is within.
template <class T>
LOCKSTEP_INLINE T saturated(T force, T most) {
  const T slack = T::by_precision(1 + 1e-6, 1 + 1e-15) * most;
  return select(less(slack, force), T(1), select(less(force, -slack), T(-1), T(0)));
}

/// Diagonal and right side of a round: A and the momentum with the servos' parts and the known impulses. Returns the
/// lanes in which the diagonal differs from that of the round before.
template <class T>
typename T::Mask round_terms(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Phase phase,
                             Tile<T>& x) {
  const int n = t.rounds.columns.n;
  const T zero = T(0), h = x.servos.duration;
  T* const rhs = x.held.rhs;
  T* const before = x.held.raw;
  for (int z = 0; z < n; ++z) {
    before[z] = x.held.diagonal[z];
    x.held.diagonal[z] = x.held.matrix[t.rounds.columns.offset[z]];
    rhs[z] = x.held.momentum[phase * n + z];
  }

  // Servos: a gain within their limit, a force beyond it (M63).
  for (int i = 0; i < t.limited_servos.count; ++i) {
    const auto acts = searched(t, x, i);
    if (!any(acts)) continue;
    const int j = t.limited_servos[i];
    const LimitedServo& servo = t.rounds.servos[i];
    const Servo<T> own = servo_of_solve<T>(t, batch, x, j, x.servos.time);
    const T effort = feed_forward<T>(t, batch, j, x.servos.time), sigma = x.servos.saturation[i];
    const T share = servo.share < 0 ? T(1) : x.couplings.share[servo.share];
    const auto linear = ~(less(zero, sigma) | less(sigma, zero));
    const T force = select(linear, servo_force(t, x, own, i, phase, effort, x.held.start[servo.velocity]),
                           sigma * effort_limit<T>(t, batch, j));
    const T gain = share * share * (h * fma(h, own.kp, own.kd));
    x.held.diagonal[servo.velocity] += select(linear & acts, gain, zero);
    rhs[servo.velocity] = fma(h * share, select(acts, force - effort, zero), rhs[servo.velocity]);
  }

  // Impulses of rows that are not held.
  for (int r = 0; r < t.bounds.single; ++r) {
    const Branch<T>& own = x.search.branch[phase * t.bounds.rows.count + r];
    const int z = t.rounds.velocity[r];
    rhs[z] += select(held(own), zero, own.impulse);
  }

  typename T::Mask differs = T::none();
  for (int z = 0; z < n; ++z) differs = differs | beyond(x.held.diagonal[z] - before[z], zero);
  return differs;
}

/// (M83): factors x.held.factor with the velocities `mask` held. A held velocity has the inverse 0, so it passes
/// through the elimination, and its entries stay as they were. Returns the lanes with a pivot that is too small.
template <class T>
typename T::Mask factor_masked(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Columns& columns = t.rounds.columns;
  T *const matrix = x.held.factor, *const inverse = x.held.inverse, *const raw = x.held.raw;
  const bool masks = t.bounds.single > 0;
  typename T::Mask weak = T::none();
  for (int i = columns.n - 1; i >= 0; --i) {
    T* const own = matrix + columns.offset[i];
    const int below = columns.size[i];
    for (int k = 1; masks && k < below; ++k) raw[k] = own[k];
    const T pivot = own[0] = scale_column(own, inverse + i, below);
    x.held.pivot[i] = pivot;
    inverse[i] = select(x.held.mask[i], T(0), inverse_of(pivot, least_pivot<T>(), weak));
    if (t.per_environment != 0) weak = weak | beyond(pivot, T(ScalarOf<T>(0x1p126)));
    subtract_from_ancestors(columns, i, own, matrix);
    for (int k = 1; masks && k < below; ++k) own[k] = select(x.held.mask[i + k], raw[k], own[k]);
  }
  return weak;
}

/// A with the diagonal of this round, where factor_masked() expects it.
template <class T>
LOCKSTEP_INLINE void copy_matrix(const Tables<ScalarOf<T>>& t, const Tile<T>& x) {
  for (int e = 0; e < t.rounds.columns.entries; ++e) x.held.factor[e] = x.held.matrix[e];
  for (int z = 0; z < t.rounds.columns.n; ++z) x.held.factor[t.rounds.columns.offset[z]] = x.held.diagonal[z];
}

/// (M84): velocities, and the impulses that hold those of `mask` at their goals. x.held.rhs is the momentum to gain
/// from the velocities `from`.
template <class T>
void solve_masked(const Tables<ScalarOf<T>>& t, Phase phase, const T* from, Tile<T>& x) {
  const Columns& columns = t.rounds.columns;
  const int n = columns.n;
  const T* const factor = x.held.factor;
  T *const y = x.held.rhs, *const u = x.held.raw, *const z = x.held.velocity + phase * n,
           *const impulse = x.held.impulse + phase * n;
  for (int j = n - 1; j >= 0; --j) {
    const T b = subtract_dot(factor + columns.offset[j] + 1, u + j + 1, columns.size[j] - 1, y[j]);
    const T moved = x.held.goal[phase * n + j] - from[j];
    u[j] = select(x.held.mask[j], moved, b);
    y[j] = select(x.held.mask[j], fnma(x.held.pivot[j], moved, b), b * x.held.inverse[j]);
  }
  for (int j = 0; j < n; ++j) {
    const T value = select(x.held.mask[j], u[j], y[j]);
    impulse[j] = select(x.held.mask[j], -y[j], T(0));
    z[j] = select(x.held.mask[j], x.held.goal[phase * n + j], from[j] + value);
    const T* const own = factor + columns.offset[j];
    for (int k = 1, below = columns.size[j]; k < below; ++k) y[j + k] = fnma(own[k], value, y[j + k]);
  }
}

/// The row in one phase.
template <class T>
LOCKSTEP_INLINE Bound<T> interval_of(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int r, Phase phase) {
  const int i = phase * t.bounds.rows.count + r;
  return {x.bounds.lo[i], x.bounds.hi[i], T(0), x.bounds.force[r], T(0)};
}

/// (M85): what a search in `lanes` begins with, from the diagonal of A alone; the other lanes keep their branches and
/// servos. Rows begin at their ends in the lanes `open`, and those without friction go on where the search before has
/// ended in the lanes `going_on`. Returns the lanes in which the diagonal differs from that of the round before.
template <class T>
typename T::Mask guess(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int phases,
                       typename T::Mask lanes, typename T::Mask open, typename T::Mask going_on, Tile<T>& x) {
  const int rows = t.bounds.rows.count, time = x.servos.time;
  const T zero = T(0), h = x.servos.duration;
  const Phase closing = Phase(phases - 1);
  const auto undecided = lanes & ~x.servos.decided, kept = going_on | ~lanes;

  // Servos: what is left of their force at the start once the joint alone has given way.
  for (int i = 0; i < t.limited_servos.count; ++i) {
    x.servos.saturation[i] = select(undecided, zero, x.servos.saturation[i]);
    if (!any(searched(t, x, i))) continue;
    const LimitedServo& servo = t.rounds.servos[i];
    const Servo<T> own = servo_of_solve<T>(t, batch, x, t.limited_servos[i], time);
    const T share = servo.share < 0 ? T(1) : x.couplings.share[servo.share];
    const T inertia = x.held.matrix[t.rounds.columns.offset[servo.velocity]];
    const T gain = share * share * (h * fma(h, own.kp, own.kd));
    const T force = servo_force(t, x, own, i, closing, feed_forward<T>(t, batch, t.limited_servos[i], time),
                                x.held.start[servo.velocity]);
    const T guessed = saturated(force * inertia, effort_limit<T>(t, batch, t.limited_servos[i]) * (inertia + gain));
    x.servos.saturation[i] = select(searched(t, x, i) & undecided, guessed, x.servos.saturation[i]);
  }

  // Rows begin free, or go on where they ended.
  for (int r = 0; r < t.bounds.single; ++r)
    for (int p = 0; p < 2; ++p) {
      Branch<T>& own = x.search.branch[p * rows + r];
      own = {own.low & kept, own.high & kept, own.stuck & ~lanes, select(lanes, zero, own.impulse)};
    }

  // Rows by (M85), phase by phase.
  typename T::Mask differs = T::none();
  for (int p = 0; p < phases; ++p) {
    differs = differs | round_terms(t, batch, Phase(p), x);
    for (int r = 0; r < t.bounds.single; ++r) {
      const int z = t.rounds.velocity[r];
      const Bound<T> row = interval_of(t, x, r, Phase(p));
      const T inertia = x.held.diagonal[z], momentum = fma(inertia, x.held.start[z], x.held.rhs[z]);
      const T slipping = clamp(-momentum, -row.force, row.force), reached = momentum + slipping;
      Branch<T> own;
      own.low = less(reached, inertia * row.lo) & open;
      own.high = less(inertia * row.hi, reached) & ~own.low & open;
      own.stuck = less(-row.force, momentum) & less(momentum, row.force) & ~own.low & ~own.high & open;
      own.impulse = select(open & ~held(own), slipping, zero);
      replace(x.search.branch[p * rows + r], own, lanes & (~going_on | less(zero, row.force)));
    }
  }

  for (int i = 0; i < t.limited_servos.count; ++i) {  // of what is held, that of its goal
    const LimitedServo& servo = t.rounds.servos[i];
    const int r = t.rounds.row_of[servo.velocity];
    if (r < 0 || !any(searched(t, x, i))) continue;
    const Branch<T>& own = x.search.branch[closing * rows + r];
    const Servo<T> drive = servo_of_solve<T>(t, batch, x, t.limited_servos[i], time);
    const T force = servo_force(t, x, drive, i, closing, feed_forward<T>(t, batch, t.limited_servos[i], time),
                                target(interval_of(t, x, r, closing), own));
    x.servos.saturation[i] =
        select(held(own) & searched(t, x, i) & undecided,
               saturated(force, effort_limit<T>(t, batch, t.limited_servos[i])), x.servos.saturation[i]);
  }
  return differs;
}

/// Sets the masks and goals of a phase. Returns the lanes in which a mask differs from the one before.
template <class T>
typename T::Mask set_goals(const Tables<ScalarOf<T>>& t, Phase phase, Tile<T>& x) {
  const int rows = t.bounds.rows.count, n = t.rounds.columns.n;
  typename T::Mask differs = T::none();
  for (int r = 0; r < t.bounds.single; ++r) {
    const Branch<T>& own = x.search.branch[phase * rows + r];
    const int z = t.rounds.velocity[r];
    const auto holds = held(own);
    differs = differs | (holds & ~x.held.mask[z]) | (x.held.mask[z] & ~holds);
    x.held.mask[z] = holds;
    x.held.goal[phase * n + z] = target(interval_of(t, x, r, phase), own);
  }
  return differs;
}

/// Moves the servos whose limit the solution of the closing phase contradicts, in the lanes that are open. In lanes of
/// `one_by_one` one of them moves, where nothing has moved `before`. Returns the lanes in which some has moved.
template <class T>
typename T::Mask move_servos(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Phase closing,
                             typename T::Mask one_by_one, typename T::Mask before, typename T::Mask open, Tile<T>& x) {
  typename T::Mask moved = T::none();
  for (int i = 0; i < t.limited_servos.count; ++i) {
    const auto acts = searched(t, x, i);
    if (!any(acts)) continue;
    const int j = t.limited_servos[i];
    const Servo<T> own = servo_of_solve<T>(t, batch, x, j, x.servos.time);
    // In both cases (M63) asks for the force at the velocities that the step ends with.
    const T force = servo_force(t, x, own, i, closing, feed_forward<T>(t, batch, j, x.servos.time),
                                x.held.velocity[closing * t.rounds.columns.n + t.rounds.servos[i].velocity]);
    const T sigma = x.servos.saturation[i], found = saturated(force, effort_limit<T>(t, batch, j));
    auto differs = (less(found, sigma) | less(sigma, found)) & open & acts & ~x.servos.decided;
    differs = differs & ~((moved | before) & one_by_one);
    moved = moved | differs;
    x.servos.saturation[i] = select(differs, sigma + clamp(found - sigma, T(-1), T(1)), sigma);
  }
  return moved;
}

/// Moves the rows and servos that the solution contradicts, in the lanes that are open; in lanes of `one_by_one` one of
/// them. Returns the lanes in which something has moved.
template <class T>
typename T::Mask move_pieces(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int phases,
                             typename T::Mask one_by_one, typename T::Mask open, Tile<T>& x) {
  const int rows = t.bounds.rows.count, n = t.rounds.columns.n;
  typename T::Mask any_moved = T::none();
  for (int p = 0; p < phases; ++p) {
    const T *const z = x.held.velocity + p * n, *const impulses = x.held.impulse + p * n;
    T scale = T(0);  // of rows that act in the lane, so that others do not decide what counts as rounding
    for (int r = 0; r < t.bounds.single; ++r) {
      const int k = t.rounds.velocity[r];
      const Branch<T>& own = x.search.branch[p * rows + r];
      const T size = farther(farther(T(0), z[k]), impulses[k] * x.held.light[r]);
      scale = select(held(own) | beyond(own.impulse, T(0)), larger(scale, size), scale);
    }
    typename T::Mask moved = T::none();
    for (int r = 0; r < t.bounds.single; ++r) {
      const int k = t.rounds.velocity[r];
      Branch<T>& own = x.search.branch[p * rows + r];
      const T impulse = select(held(own), impulses[k], own.impulse);
      const T slack = rounding<T>() * farther(scale, z[k]);
      typename T::Mask changed;
      const Branch<T> next = advance_branch(interval_of(t, x, r, Phase(p)), own, z[k], impulse, slack,
                                            slack * x.held.matrix[t.rounds.columns.offset[k]], changed);
      changed = changed & open & ~(moved & one_by_one);
      moved = moved | changed;
      replace(own, next, changed);
    }
    any_moved = any_moved | moved;
  }
  return any_moved | move_servos(t, batch, Phase(phases - 1), one_by_one, any_moved, open, x);
}

/// Gauss-Seidel by (M55), one velocity after the other, for lanes that ran out of rounds. It always converges.
template <class T>
void sweep_velocities(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Phase phase,
                      typename T::Mask lanes, Tile<T>& x) {
  const Columns& columns = t.rounds.columns;
  const int n = columns.n, rows = t.bounds.rows.count;
  T *const z = x.held.velocity + phase * n, *const change = x.held.raw;
  round_terms(t, batch, phase, x);
  for (int r = 0; r < t.bounds.single; ++r) {  // sweeps find the impulses anew
    const Branch<T>& own = x.search.branch[phase * rows + r];
    x.held.rhs[t.rounds.velocity[r]] -= select(held(own), T(0), own.impulse);
  }
  for (int k = 0; k < n; ++k) change[k] = z[k] - x.held.start[k];
  auto swept = lanes;
  repeat_while(x, swept, sweeps_for_the_rest, [&]() LOCKSTEP_INLINED {
    for (int k = 0; k < n; ++k) {
      // The speed that the other velocities leave it.
      T momentum = x.held.rhs[k];
      for (int e = 1; e < columns.size[k]; ++e)
        momentum = fnma(x.held.matrix[columns.offset[k] + e], change[k + e], momentum);
      int ancestor = columns.parent[k];
      for (int a = columns.row_start[k]; a < columns.row_start[k + 1]; ++a, ancestor = columns.parent[ancestor])
        momentum = fnma(x.held.matrix[columns.row[a]], change[ancestor], momentum);
      const T inertia = x.held.diagonal[k], speed = fma(T(1) / inertia, momentum, x.held.start[k]);
      // The impulse that its row has at that speed.
      T impulse = T(0);
      if (const int r = t.rounds.row_of[k]; r >= 0) {
        Branch<T>& own = x.search.branch[phase * rows + r];
        const Branch<T> found = project(interval_of(t, x, r, phase), speed, T(1) / inertia);
        impulse = found.impulse;
        replace(own, {found.low, found.high, found.stuck, select(held(found), T(0), impulse)}, lanes);
        x.held.impulse[phase * n + k] = select(lanes, impulse, x.held.impulse[phase * n + k]);
      }
      change[k] = select(lanes, (speed + impulse / inertia) - x.held.start[k], change[k]);
      z[k] = select(lanes, speed + impulse / inertia, z[k]);
    }
  });
  for (int k = 0; k < n; ++k) x.held.rhs[k] = change[k];
}

/// The change of velocity k that the last solve found.
template <class T>
LOCKSTEP_INLINE T found_change(const Tile<T>& x, int k) {
  return select(x.held.mask[k], x.held.raw[k], x.held.rhs[k]);
}

/// Rounds until all lanes of x.search.open have finished. `phases` is 1 where both have the same solution. A search
/// with the matrix of the one before goes on with its factor unless `other_matrix`, which is all lanes or none, and in
/// the lanes x.search.going_on with its branches.
template <class T>
void search_held_velocities(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int phases,
                            typename T::Mask other_matrix, Tile<T>& x) {
  const int budget = all_move + rounds_for_each * (t.bounds.single + t.limited_servos.count);
  auto& open = x.search.open;
  const auto other_guess = guess(t, batch, phases, ~T::none(), open, x.search.going_on, x);
  for (int r = 0; r < t.bounds.single; ++r)
    x.held.light[r] = T(1) / x.held.matrix[t.rounds.columns.offset[t.rounds.velocity[r]]];
  for (int z = 0; z < t.rounds.columns.n; ++z) x.held.mask[z] = x.held.mask[z] & ~other_matrix;
  const auto round = [&](bool first, typename T::Mask one_by_one) {
    for (int p = 0; p < phases; ++p) {
      auto other = set_goals(t, Phase(p), x);
      other = other | round_terms(t, batch, Phase(p), x);
      if (first && p == 0) other = other | other_guess | other_matrix;
      when(x, other, [&] {
        copy_matrix(t, x);
        const auto weak = factor_masked(t, x);
        if (first && p == 0) x.singular = weak;
      });
      solve_masked(t, Phase(p), x.held.start, x);
    }
    open = move_pieces(t, batch, phases, one_by_one, open, x);
  };
  round(true, T::none());
  repeat_while(x, open, all_move - 1, [&] { round(false, T::none()); });
  repeat_while(x, open, budget - all_move, [&] { round(false, ~T::none()); });
  when(x, open, [&] {
    for (int p = 0; p < phases; ++p) sweep_velocities(t, batch, Phase(p), open, x);
  });
}

/// Lanes in which the phases may have different solutions: a joint bounces or is beyond its range, or a follower is
/// corrected.
template <class T>
typename T::Mask lanes_with_two_phases(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch,
                                       const Tile<T>& x) {
  const Bounds<ScalarOf<T>>& b = t.bounds;
  const int n = t.rounds.columns.n;
  typename T::Mask differ = T::none();
  for (int f = 0; t.reduction.eliminates() && f < t.reduction.followers; ++f)
    differ = differ | beyond(x.couplings.correction[f], T(0));
  for (int z = 0; z < n; ++z) differ = differ | beyond(x.held.momentum[z] - x.held.momentum[n + z], T(0));
  for (int i = 0; i < b.watched.count; ++i) {
    if (b.watched[i].bounces) return ~T::none();
    if (!b.watched[i].ranged) continue;
    const T q = x.state.q[b.watched[i].joint];
    const Interval<T> range = position_limits<T>(t, batch, b.watched[i].joint);
    differ = differ | less(T(0), up_to_rounding(range.lo - q, range.lo)) |
             less(up_to_rounding(range.hi - q, range.hi), T(0));
  }
  return differ;
}

/// Intervals of all rows in one phase, and the lanes in which one asks for NaN or infinity.
template <class T>
void open_intervals(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Phase phase, Tile<T>& x) {
  const int rows = t.bounds.rows.count;
  StepTime<T> at{phase == velocity_phase && t.velocity_iterations > 0, ScalarOf<T>(1) / t.dt};
  if (t.solves_midpoint) at.start = x.stages.begin.q;
  for (int r = 0; r < rows; ++r) {
    bounded_row(t, batch, r, phase, at, T(0), x);
    T demand = x.bounds.lo[phase * rows + r] + x.bounds.hi[phase * rows + r] + x.bounds.force[r];
    if (t.bounds.kind[r] != BoundKind::joint) demand += x.bounds.centre[phase * rows + r];
    x.bounds.invalid = x.bounds.invalid | beyond(demand, largest<T>());
  }
}

}  // namespace lockstep::kernels
