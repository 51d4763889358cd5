// Mass matrix M(q) by composite rigid bodies (Featherstone 2008, table 6.2). SPDX-License-Identifier: Apache-2.0
//
// Composites are pseudo-inertias (M4). Column b is the force that a unit acceleration of joint b requires. It is passed
// inwards to every joint that carries b.
#pragma once

#include "frame.h"

namespace lockstep::kernels {

/// E^T A E of a symmetric A.
template <class J, class T>
LOCKSTEP_INLINE void turn_symmetric(J joint, const Body<ScalarOf<T>>& body, const Turn<T>& turn, const T* from,
                                    T* turned) {
  if constexpr (J::rotated) {  // columns, then rows
    Vec3<T> columns[3];
    each_axis([&](int k) LOCKSTEP_INLINED {
      columns[k] =
          to_parent(joint, body, turn, {simd::pair(from, 0, k), simd::pair(from, 1, k), simd::pair(from, 2, k)});
    });
    each_axis([&](int k) LOCKSTEP_INLINED {
      const Vec3<T> row = to_parent(joint, body, turn, {columns[0][k], columns[1][k], columns[2][k]});
      turned[k] = row[k];
      if (k == 0) turned[5] = row[1], turned[4] = row[2];
      if (k == 1) turned[3] = row[2];
    });
  } else if constexpr (J::prismatic || J::ball) {
    for (int k = 0; k < 6; ++k) turned[k] = from[k];
  } else {
    const T ii = from[J::i], jj = from[J::j], ij = from[3 + J::k];
    const T ik = from[3 + J::j], jk = from[3 + J::i];
    const T s = turn.s, c = turn.c, cross = c * ij, across = fma(s, ii - jj, cross);
    const T shift = s * (across + cross);  // s^2 (ii - jj) + 2 s c ij
    turned[J::i] = ii - shift;
    turned[J::j] = jj + shift;
    turned[J::k] = from[J::k];
    turned[3 + J::k] = fnma(s, s * ij, c * across);
    turned[3 + J::j] = fnma(s, jk, c * ik);
    turned[3 + J::i] = fma(s, ik, c * jk);
  }
}

/// Adds a body's composite, in its own frame, to `before`, which its parent has so far (M10).
template <class J, class T>
LOCKSTEP_INLINE void add_to_parent(J joint, const Body<ScalarOf<T>>& body, const Turn<T>& turn, const Vec3<T>& r,
                                   const PseudoInertia<T>& from, const PseudoInertia<T>& before, PseudoInertia<T>& to) {
  T turned[6];
  turn_symmetric(joint, body, turn, from.second, turned);
  Vec3<T> u = to_parent(joint, body, turn, from.moment);  // + m r / 2: then the shift adds r u^T + u r^T
  Vec3<T> moved = u;
  if (body.heavy)
    each_axis([&](int k) LOCKSTEP_INLINED {
      if (!J::off(k)) return;
      const T mr = from.mass * r[k];
      u[k] = fma(T(ScalarOf<T>(0.5)), mr, u[k]);
      moved[k] += mr;
    });
  to.mass = body.heavy ? before.mass + from.mass : before.mass;
  each_axis([&](int k) LOCKSTEP_INLINED {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    if (J::off(k)) turned[k] = fma(r[k] + r[k], u[k], turned[k]);
    if (J::off(j)) turned[3 + k] = fma(r[j], u[i], turned[3 + k]);
    if (J::off(i)) turned[3 + k] = fma(r[i], u[j], turned[3 + k]);
  });
  each_axis([&](int k) LOCKSTEP_INLINED {
    to.moment[k] = before.moment[k] + moved[k];
    to.second[k] = before.second[k] + turned[k];
    to.second[3 + k] = before.second[3 + k] + turned[3 + k];
  });
}

/// The force and the moment on the composite that a unit acceleration of the joint's coordinate requires (M11).
template <class J, class T>
LOCKSTEP_INLINE void unit_column(J, const PseudoInertia<T>& c, bool reversed, Vec3<T>& force, Vec3<T>& moment) {
  Vec3<T> f, n;
  f[J::k] = n[J::k] = T(0);
  if constexpr (J::prismatic) {
    f[J::i] = f[J::j] = T(0);
    f[J::k] = c.mass;
    n[J::i] = c.moment[J::j];
    n[J::j] = -c.moment[J::i];
  } else {
    f[J::i] = -c.moment[J::j];
    f[J::j] = c.moment[J::i];
    n[J::k] = c.second[J::i] + c.second[J::j];
    n[J::i] = -c.second[3 + J::j];
    n[J::j] = -c.second[3 + J::i];
  }
  if (reversed) each_axis([&](int a) LOCKSTEP_INLINED { f[a] = -f[a], n[a] = -n[a]; });
  force = f;
  moment = n;
}

/// Row of body b: the components along b's joint of its own unit column and of those of all bodies that it carries.
/// Then passes the columns and the composite on to the parent. One switch over the joint's kind serves all columns.
template <class J, class T>
LOCKSTEP_INLINE void rows_of_body(J joint, const Tables<ScalarOf<T>>& t, const Tile<T>& x, int b) {
  const Body<ScalarOf<T>>& body = t.body[b];
  const int velocity = body.velocity, carried = t.matrix.size[velocity], parent = body.parent;
  const bool reversed = body.sign < 0;
  Vec3<T>* force = x.bodies.column_force + b;
  Vec3<T>* moment = x.bodies.column_moment + b;
  T* row = x.dynamics.matrix + t.matrix.offset[velocity];
  const PseudoInertia<T>& composite = body.leaf ? x.bodies.base_inertia[b] : x.bodies.composite[b];
  unit_column(joint, composite, reversed, force[0], moment[0]);
  if (parent < 0) {
    for (int k = 0; k < carried; ++k) row[k] = J::prismatic ? force[k][J::k] : moment[k][J::k];
  } else {
    const Turn<T> turn = turn_of(joint, body, x, b);
    Vec3<T> r = origin(joint, body, J::prismatic ? x.state.q[body.joint] : T(0));
    add_to_parent(joint, body, turn, r, composite,
                  body.first ? x.bodies.base_inertia[parent] : x.bodies.composite[parent], x.bodies.composite[parent]);
    for (int k = 0; k < carried; ++k) {
      row[k] = J::prismatic ? force[k][J::k] : moment[k][J::k];
      Vec3<T> passed = to_parent(joint, body, turn, force[k]);
      moment[k] = cross_origin_add(joint, r, passed, to_parent(joint, body, turn, moment[k]));
      force[k] = passed;
    }
  }
  if (reversed)
    for (int k = 0; k < carried; ++k) row[k] = -row[k];
}

/// The own six rows and columns of the floating root that is body b, from its composite, angular before linear (M12).
/// `first` is its first velocity in the matrix.
template <class T>
LOCKSTEP_INLINE void root_inertia(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int b, const Columns& columns,
                                  int first, T* matrix) {
  const PseudoInertia<T>& c = t.body[b].leaf ? x.bodies.base_inertia[b] : x.bodies.composite[b];
  for (int k = 0; k < 3; ++k) {
    T* angular = matrix + columns.offset[first + k] - k;
    T* linear = matrix + columns.offset[first + 3 + k] - (3 + k);
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    angular[k] = c.second[i] + c.second[j];
    angular[3 + k] = T(0);
    angular[3 + i] = -c.moment[j];  // e_k x h
    angular[3 + j] = c.moment[i];
    linear[3 + k] = c.mass;
    for (int l = k + 1; l < 3; ++l) {
      angular[l] = -c.pair(k, l);
      linear[3 + l] = T(0);
    }
  }
}

/// Rows of a floating root: all columns of joints, and its own.
template <class T>
LOCKSTEP_INLINE void rows_of_root(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int root) {
  const int first = t.body[root].velocity, carried = t.matrix.size[first] - 6;
  const Vec3<T>*const force = x.bodies.column_force + root + 1, *const moment = x.bodies.column_moment + root + 1;
  for (int k = 0; k < 3; ++k) {
    T* angular = x.dynamics.matrix + t.matrix.offset[first + k] + 6 - k;
    T* linear = x.dynamics.matrix + t.matrix.offset[first + 3 + k] + 6 - (3 + k);
    for (int c = 0; c < carried; ++c) {
      angular[c] = moment[c][k];
      linear[c] = force[c][k];
    }
  }
  root_inertia(t, x, root, t.matrix, first, x.dynamics.matrix);
}

/// The part of M that belongs to a tree.
template <class T>
LOCKSTEP_INLINE void mass_matrix(const Tables<ScalarOf<T>>& t, const TreeStructure& tree, Tile<T>& x) {
  for (int b = tree.last_body - 1, first = tree.first_body; b >= first; --b) {
    if (t.body[b].root)
      rows_of_root(t, x, b);
    else
      with_joint(t.body[b], [&](auto joint) LOCKSTEP_INLINED { rows_of_body(joint, t, x, b); });
  }
}

}  // namespace lockstep::kernels
