// Mass matrix M(q) by composite rigid bodies (Featherstone 2008, table 6.2). SPDX-License-Identifier: Apache-2.0
//
// Composites are pseudo-inertias (M4); column b is the force that a unit
// acceleration of joint b takes, passed inwards to every joint that carries it.
#pragma once

#include "frame.h"

namespace lockstep::kernels {

/// Adds a body's composite, given in its own frame, to its parent's (M10).
template <class J, class T>
LOCKSTEP_INLINE void add_to_parent(J joint, const Body<ScalarOf<T>>& body, T s, T c, const Vec3<T>& r,
                                   const PseudoInertia<T>& from, PseudoInertia<T>& to) {
  // Second moment as E^T Sigma E: columns, then rows.
  T turned[6];
  if (body.rotated) {
    Vec3<T> columns[3];
    for (int k = 0; k < 3; ++k)
      columns[k] = to_parent(joint, body, s, c, {from.pair(0, k), from.pair(1, k), from.pair(2, k)});
    for (int k = 0; k < 3; ++k) {
      const Vec3<T> row = to_parent(joint, body, s, c, {columns[0][k], columns[1][k], columns[2][k]});
      turned[k] = row[k];
      if (k == 0) turned[5] = row[1], turned[4] = row[2];
      if (k == 1) turned[3] = row[2];
    }
  } else if constexpr (J::prismatic) {
    for (int k = 0; k < 6; ++k) turned[k] = from.second[k];
  } else {
    const T ii = from.second[J::i], jj = from.second[J::j], ij = from.second[3 + J::k];
    const T ik = from.second[3 + J::j], jk = from.second[3 + J::i];
    const T shift = s * fma(s, jj - ii, T(ScalarOf<T>(-2)) * (c * ij));  // s^2 (jj - ii) - 2 s c ij
    turned[J::i] = ii + shift;
    turned[J::j] = jj - shift;
    turned[J::k] = from.second[J::k];
    turned[3 + J::k] = fma(c, fma(s, ii - jj, c * ij), -(s * (s * ij)));
    turned[3 + J::j] = fnma(s, jk, c * ik);
    turned[3 + J::i] = fma(s, ik, c * jk);
  }
  const Vec3<T> h = to_parent(joint, body, s, c, from.moment);
  to.mass += from.mass;
  Vec3<T> u;  // h + m r / 2, so that r u^T + u r^T is all that the shift adds
  for (int k = 0; k < 3; ++k) {
    const T mr = from.mass * r[k];
    to.moment[k] += h[k] + mr;
    u[k] = fma(T(ScalarOf<T>(0.5)), mr, h[k]);
  }
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    to.second[k] += fma(r[k] + r[k], u[k], turned[k]);
    to.second[3 + k] += fma(r[i], u[j], fma(r[j], u[i], turned[3 + k]));
  }
}

/// Force and moment of the composite under a unit acceleration of the joint's coordinate (M11).
template <class J, class T>
LOCKSTEP_INLINE void unit_column(J, const PseudoInertia<T>& c, T sign, Vec3<T>& force, Vec3<T>& moment) {
  if constexpr (J::prismatic) {
    force = Vec3<T>::zero();
    force[J::k] = c.mass * sign;
    moment[J::k] = T(0);
    moment[J::i] = c.moment[J::j] * sign;
    moment[J::j] = -(c.moment[J::i] * sign);
  } else {
    force[J::k] = T(0);
    force[J::i] = -(c.moment[J::j] * sign);
    force[J::j] = c.moment[J::i] * sign;
    moment[J::k] = (c.second[J::i] + c.second[J::j]) * sign;
    moment[J::i] = -(c.second[3 + J::j] * sign);
    moment[J::j] = -(c.second[3 + J::i] * sign);
  }
}

/// Rows of body b: what the unit columns of b and of all bodies that it carries ask of b's joint. Then these columns
/// and b's composite go on to its parent. One dispatch serves the whole subtree, whose columns are independent.
template <class J, class T>
LOCKSTEP_INLINE void rows_of_body(J joint, const Tables<ScalarOf<T>>& t, Tile<T>& x, int b) {
  const Body<ScalarOf<T>>& body = t.body[b];
  const int velocity = velocity_of(t, b), carried = t.matrix.size[velocity];
  const T s = x.sine[b], c = x.cosine[b], sign = T(body.sign);
  Vec3<T>* force = x.column_force + b;
  Vec3<T>* moment = x.column_moment + b;
  T* row = x.matrix + t.matrix.offset[velocity];
  unit_column(joint, x.composite[b], sign, force[0], moment[0]);
  if (body.parent < 0) {
    for (int k = 0; k < carried; ++k) row[k] = (J::prismatic ? force[k][J::k] : moment[k][J::k]) * sign;
    return;
  }
  const Vec3<T> r = origin(joint, body, J::prismatic ? x.q[joint_of(t, b)] : T(0));
  add_to_parent(joint, body, s, c, r, x.composite[b], x.composite[body.parent]);
  for (int k = 0; k < carried; ++k) {
    row[k] = (J::prismatic ? force[k][J::k] : moment[k][J::k]) * sign;
    const Vec3<T> passed = to_parent(joint, body, s, c, force[k]);
    moment[k] = cross_add(r, passed, to_parent(joint, body, s, c, moment[k]));
    force[k] = passed;
  }
}

/// Rows of a floating root: all columns, and its own six from its composite, in the order angular, linear (M12).
template <class T>
LOCKSTEP_INLINE void rows_of_root(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const PseudoInertia<T>& c = x.composite[0];
  const auto row = [&](int velocity) { return x.matrix + t.matrix.offset[velocity] - velocity; };
  for (int k = 0; k < 3; ++k) {
    T* angular = row(k);
    T* linear = row(3 + k);
    for (int b = 1; b < t.bodies; ++b) {
      angular[5 + b] = x.column_moment[b][k];
      linear[5 + b] = x.column_force[b][k];
    }
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

template <class T>
void mass_matrix(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int b = 0; b < t.bodies; ++b) x.composite[b] = inertia_of(t, x, b);
  for (int b = t.bodies - 1; b >= 0; --b) {
    if (t.body[b].root)
      rows_of_root(t, x);
    else
      with_joint(t.body[b], [&](auto joint) { rows_of_body(joint, t, x, b); });
  }
}

}  // namespace lockstep::kernels
