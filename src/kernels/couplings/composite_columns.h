// A_r without A: columns of M S, passed inwards (M41). SPDX-License-Identifier: Apache-2.0
//
// As in mass_matrix.h, but joints that share a velocity share a unit column, and the component of a column along a
// joint goes to A_r at once. Behind A_r stands S^T A w, where the position phase has a solution of its own.
#pragma once

#include "kernels/dynamics/mass_matrix.h"

namespace lockstep::kernels {

// Loops below copy pointers to locals, because the compiler must assume that a store changes those in x.

template <class T>
LOCKSTEP_INLINE void add_squares(const Span<CompositeColumns::Square> list, int first, int last, const Tile<T>& x,
                                 T inertia) {
  const CompositeColumns::Square* const square = list.data;
  T* const reduced = x.dynamics.reduced;
  const T* const factor = x.couplings.factor;
  for (int i = first; i < last; ++i)
    reduced[square[i].entry] = fma(factor[square[i].factor], inertia, reduced[square[i].entry]);
}

/// Adds the inertia of body b's joint alone to A_r, and to what stands behind it.
template <class T>
LOCKSTEP_INLINE void add_squares(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int b, T inertia) {
  const CompositeColumns& m = t.reduction.composite;
  add_squares(m.squares, m.square_start[b], m.square_start[b + 1], x, inertia);
  if (m.pulled_start[b] < m.pulled_start[b + 1])
    add_squares(m.pulled, m.pulled_start[b], m.pulled_start[b + 1], x,
                x.couplings.correction[t.reduction.follower_of[t.body[b].joint]] * inertia);
}

/// Merges columns of one velocity that come from different branches.
template <class T>
LOCKSTEP_INLINE void merge_columns(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int b) {
  const CompositeColumns& m = t.reduction.composite;
  for (int i = m.merge_start[b]; i < m.merge_start[b + 1]; ++i) {
    const Merge merge = m.merges[i];
    x.bodies.composite_force[merge.to] = x.bodies.composite_force[merge.to] + x.bodies.composite_force[merge.from];
    x.bodies.composite_moment[merge.to] = x.bodies.composite_moment[merge.to] + x.bodies.composite_moment[merge.from];
  }
}

/// Adds `share` times the joint's unit column to the column in a place.
template <class J, class T>
LOCKSTEP_INLINE void add_unit(J, const Tile<T>& x, int place, bool first, T share, const Vec3<T>& force,
                              const Vec3<T>& moment) {
  Vec3<T>&to_force = x.bodies.composite_force[place], &to_moment = x.bodies.composite_moment[place];
  each_axis([&](int k) LOCKSTEP_INLINED {
    const bool has_force = J::prismatic == (k == J::k), has_moment = !J::prismatic || k != J::k;
    if (first) {
      to_force[k] = has_force ? share * force[k] : T(0);
      to_moment[k] = has_moment ? share * moment[k] : T(0);
    } else {
      if (has_force) to_force[k] = fma(share, force[k], to_force[k]);
      if (has_moment) to_moment[k] = fma(share, moment[k], to_moment[k]);
    }
  });
}

/// Adds the components of the columns along b's joint to A_r. Then adds the joint's own column to them, and passes them
/// on to the parent.
template <class J, class T>
LOCKSTEP_INLINE void composite_rows_of_body(J joint, const Tables<ScalarOf<T>>& t, const Tile<T>& x, int b) {
  const CompositeColumns& m = t.reduction.composite;
  const Body<ScalarOf<T>>& body = t.body[b];
  const bool reversed = body.sign < 0;
  Vec3<T>* const force = x.bodies.composite_force;
  Vec3<T>* const moment = x.bodies.composite_moment;
  const int j = body.joint, follower = t.reduction.follower_of[j];
  const auto component = [&](int place) LOCKSTEP_INLINED {
    const T value = J::prismatic ? force[place][J::k] : moment[place][J::k];
    return reversed ? -value : value;
  };

  // Components of the columns that arrive, for A_r (M41).
  T* const reduced = x.dynamics.reduced;
  const T* const factor = x.couplings.factor;
  const CompositeColumns::Row* const rows = m.rows.data;
  for (int i = m.row_start[b], last = m.row_start[b + 1]; i < last; ++i) {
    const CompositeColumns::Row row = rows[i];
    reduced[row.entry] = fma(factor[row.factor], component(row.place), reduced[row.entry]);
  }

  // The same with the follower's correction, for S^T A w.
  if (const int first = m.pull_start[b], last = m.pull_start[b + 1]; first < last) {
    const CompositeColumns::Row* const pulls = m.pulls.data;
    const T correction = x.couplings.correction[follower];
    for (int i = first; i < last; ++i)
      reduced[pulls[i].entry] = fma(correction, component(pulls[i].place), reduced[pulls[i].entry]);
  }

  // The joint's own unit column (M11), for A_r.
  const PseudoInertia<T>& composite = body.leaf ? x.bodies.base_inertia[b] : x.bodies.composite[b];
  Vec3<T> unit_force, unit_moment;
  unit_column(joint, composite, reversed, unit_force, unit_moment);
  const T unit = J::prismatic ? unit_force[J::k] : unit_moment[J::k];
  const T own = (reversed ? -unit : unit) + x.dynamics.joint_inertia[j];
  add_squares(t, x, b, own);
  if (t.guesses_servos()) x.dynamics.joint_inertia[j] = own;
  if (body.parent < 0) return;

  // It joins the columns of the joint's velocities, and that of corrections.
  for (int i = m.unit_start[b], last = m.unit_start[b + 1]; i < last; ++i)
    add_unit(joint, x, m.units[i].place, m.units[i].first, x.couplings.factor[m.units[i].factor], unit_force,
             unit_moment);
  if (m.correction[b].place >= 0)
    add_unit(joint, x, m.correction[b].place, m.correction[b].first, x.couplings.correction[follower], unit_force,
             unit_moment);

  // Composite (M10) and columns (M9) go on to the parent.
  const int parent = body.parent;
  const Turn<T> turn = turn_of(joint, body, x, b);
  const Vec3<T> r = origin(joint, body, J::prismatic ? x.state.q[j] : T(0));
  add_to_parent(joint, body, turn, r, composite,
                body.first ? x.bodies.base_inertia[parent] : x.bodies.composite[parent], x.bodies.composite[parent]);
  const int* const places = m.passed.data;
  for (int i = m.passed_start[b], last = m.passed_start[b + 1]; i < last; ++i) {
    const int place = places[i];
    Vec3<T> passed = to_parent(joint, body, turn, force[place]);
    moment[place] = cross_origin_add(joint, r, passed, to_parent(joint, body, turn, moment[place]));
    force[place] = passed;
  }
}

template <class T>
LOCKSTEP_INLINE void composite_rows_of_root(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int b) {
  const CompositeColumns& m = t.reduction.composite;
  for (int i = m.row_start[b]; i < m.row_start[b + 1]; ++i) {
    const CompositeColumns::Row row = m.rows[i];
    x.dynamics.reduced[row.entry] = row.factor < 3 ? x.bodies.composite_moment[row.place][row.factor]
                                                   : x.bodies.composite_force[row.place][row.factor - 3];
  }
  root_inertia(t, x, b, t.solver, t.roots[t.body[b].joint].solver, x.dynamics.reduced);
}

/// What composite columns add to.
template <class T>
LOCKSTEP_INLINE void clear_reduced(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const int behind = t.solve_twice ? t.solver.n : 0;
  for (int e = 0; e < t.solver.entries + behind; ++e) x.dynamics.reduced[e] = T(0);
}

/// The part of A_r that belongs to a tree.
template <class T>
LOCKSTEP_INLINE void composite_columns(const Tables<ScalarOf<T>>& t, const TreeStructure& tree, Tile<T>& x) {
  for (int b = tree.last_body - 1, first = tree.first_body; b >= first; --b) {
    merge_columns(t, x, b);
    if (t.body[b].root)
      composite_rows_of_root(t, x, b);
    else
      with_joint(t.body[b], [&](auto joint) LOCKSTEP_INLINED { composite_rows_of_body(joint, t, x, b); });
  }
}

}  // namespace lockstep::kernels
