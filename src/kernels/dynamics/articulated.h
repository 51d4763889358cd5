// L^T D L of A by articulated bodies (Featherstone 1983), for long chains. SPDX-License-Identifier: Apache-2.0
//
// (M22) to (M25). A itself is not computed. Its pivots take one pass over the bodies, and so does each solve with L.
// The factors are those of ldlt.h except for rounding, because both go from the leaves to the root.
#pragma once

#include "ldlt.h"
#include "mass_matrix.h"

namespace lockstep::kernels {

using simd::ArticulatedInertia;

/// Adds a rigid body to the inertia of what it carries (M22).
template <class T>
LOCKSTEP_INLINE void add_rigid(const PseudoInertia<T>& body, ArticulatedInertia<T>& sum) {
  each_axis([&](int k) LOCKSTEP_INLINED {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    sum.angular[k] += body.second[i] + body.second[j];
    sum.angular[3 + k] = sum.angular[3 + k] - body.second[3 + k];
    sum.across(i, j) = sum.across(i, j) - body.moment[k];
    sum.across(j, i) += body.moment[k];
    sum.linear[k] += body.mass;
  });
}

/// Calls act(entry of one, entry of the other) for each entry. Vec3 says why not for the whole.
template <class A, class B, class Act>
LOCKSTEP_INLINE void each_entry(A& one, B& other, Act&& act) {
  each_axis([&](int k) LOCKSTEP_INLINED {
    act(one.angular[k], other.angular[k]);
    act(one.angular[3 + k], other.angular[3 + k]);
    act(one.linear[k], other.linear[k]);
    act(one.linear[3 + k], other.linear[3 + k]);
    each_axis([&](int l) LOCKSTEP_INLINED { act(one.across(k, l), other.across(k, l)); });
  });
}

/// I - U D^-1 U^T (M23): the inertia with the joint free to move. u_moment and u_force are U D^-1.
template <class T>
LOCKSTEP_INLINE void release(const Vec3<T>& moment, const Vec3<T>& force, const Vec3<T>& u_moment,
                             const Vec3<T>& u_force, ArticulatedInertia<T>& a) {
  each_axis([&](int k) LOCKSTEP_INLINED {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    a.angular[k] = fnma(u_moment[k], moment[k], a.angular[k]);
    a.angular[3 + k] = fnma(u_moment[i], moment[j], a.angular[3 + k]);
    a.linear[k] = fnma(u_force[k], force[k], a.linear[k]);
    a.linear[3 + k] = fnma(u_force[i], force[j], a.linear[3 + k]);
    each_axis([&](int l) LOCKSTEP_INLINED { a.across(k, l) = fnma(u_moment[k], force[l], a.across(k, l)); });
  });
}

/// Moves an inertia to the parent's axes and origin (M23).
template <class J, class T>
LOCKSTEP_INLINE void move_to_parent(J joint, const Body<ScalarOf<T>>& body, const Turn<T>& turn, const Vec3<T>& r,
                                    ArticulatedInertia<T>& a) {
  ArticulatedInertia<T> turned;
  turn_symmetric(joint, body, turn, a.angular, turned.angular);
  turn_symmetric(joint, body, turn, a.linear, turned.linear);
  Vec3<T> columns[3], before[3], after[3];
  each_axis([&](int l) LOCKSTEP_INLINED {
    columns[l] = to_parent(joint, body, turn, {a.across(0, l), a.across(1, l), a.across(2, l)});
  });
  each_axis([&](int k) LOCKSTEP_INLINED {
    before[k] = to_parent(joint, body, turn, {columns[0][k], columns[1][k], columns[2][k]});
  });
  // H + [r]x M, by columns, and J + [r]x H^T + ([r]x (H + [r]x M)^T)^T
  each_axis([&](int l) LOCKSTEP_INLINED {
    const Vec3<T> moved = cross_origin_add(
        joint, r, {simd::pair(turned.linear, 0, l), simd::pair(turned.linear, 1, l), simd::pair(turned.linear, 2, l)},
        {before[0][l], before[1][l], before[2][l]});
    each_axis([&](int k) LOCKSTEP_INLINED { after[k][l] = moved[k]; });
  });
  each_axis([&](int k) LOCKSTEP_INLINED {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    a.angular[k] = cross_component(joint, r, after[k], k, cross_component(joint, r, before[k], k, turned.angular[k]));
    a.angular[3 + k] =
        cross_component(joint, r, after[i], j, cross_component(joint, r, before[j], i, turned.angular[3 + k]));
    a.linear[k] = turned.linear[k];
    a.linear[3 + k] = turned.linear[3 + k];
  });
  a.across = {after[0], after[1], after[2]};
}

/// One body with what it carries: its pivot, U D^-1, and the inertia that it passes on to its parent (M22), (M23).
template <class J, class T>
LOCKSTEP_INLINE typename T::Mask articulate(J joint, const Tables<ScalarOf<T>>& t, const Tile<T>& x, int b, int place) {
  const int z = t.articulated.velocity[b];
  const Body<ScalarOf<T>>& body = t.body[b];
  ArticulatedInertia<T> own;
  each_entry(own, x.articulated.inertia[place],
             [&](T& entry, const T& carried) LOCKSTEP_INLINED { entry = body.leaf ? T(0) : carried; });
  add_rigid(x.bodies.base_inertia[b], own);
  Vec3<T> moment, force;
  each_axis([&](int k) LOCKSTEP_INLINED {
    moment[k] = J::prismatic ? own.across(k, J::k) : simd::pair(own.angular, k, J::k);
    force[k] = J::prismatic ? simd::pair(own.linear, k, J::k) : own.across(J::k, k);
  });
  typename T::Mask weak = T::none();
  const T pivot = (J::prismatic ? force : moment)[J::k] + x.dynamics.joint_inertia[body.joint];
  const T inverse = x.dynamics.inverse[z] = inverse_of(pivot, least_pivot<T>(), weak);
  Vec3<T> u_moment, u_force;
  each_axis([&](int k) LOCKSTEP_INLINED {
    u_moment[k] = moment[k] * inverse;
    u_force[k] = force[k] * inverse;
    x.articulated.hinge_moment[b][k] = body.sign < 0 ? -u_moment[k] : u_moment[k];
    x.articulated.hinge_force[b][k] = body.sign < 0 ? -u_force[k] : u_force[k];
  });
  if (body.parent < 0) return weak;
  release(moment, force, u_moment, u_force, own);
  Vec3<T> r = origin(joint, body, J::prismatic ? x.articulated.factored_q[body.joint] : T(0));
  move_to_parent(joint, body, turn_of(joint, body, x, b), r, own);
  each_entry(x.articulated.inertia[place], own, [](T& passed, const T& entry) LOCKSTEP_INLINED { passed = entry; });
  return weak;
}

/// The own block of A of the floating root that is body b: its six rows and columns, in the order angular, linear.
template <class T>
LOCKSTEP_INLINE T* block_of_root(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int b) {
  return x.articulated.root_block + t.body[b].joint * t.articulated.root.entries;
}

template <class T>
void pack_root(const Tables<ScalarOf<T>>& t, const ArticulatedInertia<T>& a, T* block) {
  const Columns& columns = t.articulated.root;
  for (int k = 0; k < 3; ++k)
    for (int l = 0; l < 3; ++l) {
      block[columns.offset[k] + 3 + l - k] = a.across(k, l);
      if (l < k) continue;
      block[columns.offset[k] + l - k] = simd::pair(a.angular, k, l);
      block[columns.offset[3 + k] + l - k] = simd::pair(a.linear, k, l);
    }
}

/// Finds the pivots of A and what its L is made of. Returns the lanes that have a pivot which is too small.
template <class T>
typename T::Mask factor_articulated(const Tables<ScalarOf<T>>& t, const Tile<T>& x) {
  const Articulated& a = t.articulated;
  typename T::Mask weak = T::none();
  for (int j = 0; x.articulated.factored_q != x.state.q && j < t.joints; ++j)
    x.articulated.factored_q[j] = x.state.q[j];
  for (int p = a.all.first; p < a.all.last; ++p) {
    const Visit& visit = a.visits[p];
    const int place = a.carried[visit.begin].place;
    for (int j = visit.merge_first; j < visit.merge_last; ++j)
      each_entry(x.articulated.inertia[a.merges[j].to], x.articulated.inertia[a.merges[j].from],
                 [](T& sum, const T& entry) LOCKSTEP_INLINED { sum += entry; });
    if (const int b = visit.body; t.body[b].root) {
      T* const block = block_of_root(t, x, b);
      add_rigid(x.bodies.base_inertia[b], x.articulated.inertia[place]);
      pack_root(t, x.articulated.inertia[place], block);
      weak = weak | factor(a.root, all_of(a.root), block, x.dynamics.inverse + a.velocity[b], T(0));
    } else {
      with_joint(t.body[visit.body],
                 [&](auto joint) LOCKSTEP_INLINED { weak = weak | articulate(joint, t, x, visit.body, place); });
    }
  }
  return weak;
}

/// (M24) at one joint and its body, for all vectors that come there.
template <class J, class T>
LOCKSTEP_INLINE void pass_inwards(J joint, const Tables<ScalarOf<T>>& t, const Tile<T>& x, const Visit& visit,
                                  T* vector, int stride) {
  const int b = visit.body;
  const Body<ScalarOf<T>>& body = t.body[b];
  const Carried* const carried = t.articulated.carried.data;
  T* const own = vector + t.articulated.velocity[b];
  const Vec3<T>&u_force = x.articulated.hinge_force[b], &u_moment = x.articulated.hinge_moment[b];
  const Turn<T> turn = turn_of(joint, body, x, b);
  const bool reversed = body.sign < 0;
  const Vec3<T> r = origin(joint, body, J::prismatic && body.parent >= 0 ? x.articulated.factored_q[body.joint] : T(0));
  const auto pass_on = [&](Vec3<T>& force, Vec3<T>& moment, Vec3<T> f, Vec3<T> m) LOCKSTEP_INLINED {
    f = to_parent(joint, body, turn, f);
    m = to_parent(joint, body, turn, m);
    each_axis([&](int k) LOCKSTEP_INLINED {
      force[k] = f[k];
      moment[k] = cross_component(joint, r, f, k, m[k]);
    });
  };
  for (int i = visit.begin; i < visit.known; ++i) {
    const Carried one = carried[i];
    const T y = own[one.vector * stride];
    pass_on(x.articulated.wrench_force[one.place], x.articulated.wrench_moment[one.place],
            {u_force[0] * y, u_force[1] * y, u_force[2] * y}, {u_moment[0] * y, u_moment[1] * y, u_moment[2] * y});
  }
  for (int i = visit.known; i < visit.last; ++i) {
    const Carried one = carried[i];
    Vec3<T>&force = x.articulated.wrench_force[one.place], &moment = x.articulated.wrench_moment[one.place];
    T& entry = own[one.vector * stride];
    const T carried = (J::prismatic ? force : moment)[J::k], y = reversed ? entry + carried : entry - carried;
    entry = y;
    pass_on(force, moment, fma(u_force, y, force), fma(u_moment, y, moment));
  }
}

/// (M24) at a floating root. All vectors come from joints.
template <class T>
LOCKSTEP_INLINE void pass_root(const Tables<ScalarOf<T>>& t, const Tile<T>& x, const Visit& visit, T* vector,
                               int stride) {
  const Carried* const carried = t.articulated.carried.data;
  for (int i = visit.begin; i < visit.last; ++i) {
    T* const own = vector + t.articulated.velocity[visit.body] + carried[i].vector * stride;
    const Vec3<T>&moment = x.articulated.wrench_moment[carried[i].place],
          &force = x.articulated.wrench_force[carried[i].place];
    T y[6] = {own[0] - moment.x, own[1] - moment.y, own[2] - moment.z,
              own[3] - force.x,  own[4] - force.y,  own[5] - force.z};
    const T* column = block_of_root(t, x, visit.body) + t.articulated.root.entries;
#pragma GCC unroll 6
    for (int k = 5; k >= 0; --k) {
      column -= 6 - k;
#pragma GCC unroll 6
      for (int l = 5; l > k; --l) y[k] = fnma(column[l - k], y[l], y[k]);
      own[k] = y[k];
    }
  }
}

/// b <- L^-T b for vectors that are `stride` numbers apart, and zero except for bodies on their paths.
template <class T>
void solve_inwards(const Tables<ScalarOf<T>>& t, const Tile<T>& x, const Path& path, T* vector, int stride) {
  const Articulated& a = t.articulated;
  for (int p = path.first; p < path.last; ++p) {
    const Visit& visit = a.visits[p];
    for (int j = visit.merge_first; j < visit.merge_last; ++j) {
      const Merge merge = a.merges[j];
      x.articulated.wrench_force[merge.to] =
          x.articulated.wrench_force[merge.to] + x.articulated.wrench_force[merge.from];
      x.articulated.wrench_moment[merge.to] =
          x.articulated.wrench_moment[merge.to] + x.articulated.wrench_moment[merge.from];
    }
    if (t.body[visit.body].root)
      pass_root(t, x, visit, vector, stride);
    else
      with_joint(t.body[visit.body],
                 [&](auto joint) LOCKSTEP_INLINED { pass_inwards(joint, t, x, visit, vector, stride); });
  }
}

/// (M25) at one joint: what its parent's acceleration does to a vector.
template <class J, class T>
LOCKSTEP_INLINE void pass_outwards(J joint, const Tables<ScalarOf<T>>& t, const Tile<T>& x, int b, T& own,
                                   Vec3<T>* angular, Vec3<T>* linear) {
  const Body<ScalarOf<T>>& body = t.body[b];
  Vec3<T> w = Vec3<T>::zero(), v = Vec3<T>::zero();
  if (body.parent >= 0) {
    const Turn<T> turn = turn_of(joint, body, x, b);
    const Vec3<T> r = origin(joint, body, J::prismatic ? x.articulated.factored_q[body.joint] : T(0)),
                  turning = angular[body.parent];
    const Vec3<T> back = {-r[0], -r[1], -r[2]};  // w x r = -r x w
    w = to_body(joint, body, turn, turning);
    v = to_body(joint, body, turn, cross_origin_add(joint, back, turning, linear[body.parent]));
    own = own - dot(x.articulated.hinge_moment[b], w) - dot(x.articulated.hinge_force[b], v);
  }
  if (body.leaf) return;
  (J::prismatic ? v : w)[J::k] = fma(T(body.sign), own, (J::prismatic ? v : w)[J::k]);
  angular[b] = w;
  linear[b] = v;
}

/// b <- L^-1 b for `first`, and for `second` unless it is null.
template <class T>
void solve_outwards(const Tables<ScalarOf<T>>& t, const Tile<T>& x, T* first, T* second) {
  T* const vectors[2] = {first, second};
  const int count = second ? 2 : 1;
  for (int i = 0; i < t.tree.count; ++i) {
    const TreeStructure& tree = t.tree[i];
    if (tree.inertia != InertiaKind::articulated_bodies) continue;
    int b = tree.first_body;
    if (tree.root >= 0) {
      for (int n = 0; n < count; ++n) {
        T* const own = vectors[n] + t.articulated.velocity[b];
        solve_downwards(t.articulated.root, all_of(t.articulated.root), block_of_root(t, x, b), own);
        x.articulated.reached_angular[n * t.bodies + b] = {own[0], own[1], own[2]};
        x.articulated.reached_linear[n * t.bodies + b] = {own[3], own[4], own[5]};
      }
      ++b;
    }
    for (; b < tree.last_body; ++b)
      with_joint(t.body[b], [&](auto joint) LOCKSTEP_INLINED {
        for (int n = 0; n < count; ++n)
          pass_outwards(joint, t, x, b, vectors[n][t.articulated.velocity[b]],
                        x.articulated.reached_angular + n * t.bodies, x.articulated.reached_linear + n * t.bodies);
      });
  }
}

/// y = L v, the other way round: v are velocities, and what their bodies' parents move is added.
template <class T>
void multiply_outwards(const Tables<ScalarOf<T>>& t, const Tile<T>& x, const T* v, T* y) {
  Vec3<T>*const angular = x.articulated.reached_angular, *const linear = x.articulated.reached_linear;
  for (int i = 0; i < t.tree.count; ++i) {
    const TreeStructure& tree = t.tree[i];
    if (tree.inertia != InertiaKind::articulated_bodies) continue;
    int b = tree.first_body;
    if (tree.root >= 0) {
      const int first = t.articulated.velocity[b];
      const T *const own = v + first, *const block = block_of_root(t, x, b);
      const Columns& root = t.articulated.root;
      for (int j = 0; j < root.n; ++j)
        for (int k = 1; k < root.size[j]; ++k)
          y[first + j + k] = fma(block[root.offset[j] + k], own[j], y[first + j + k]);
      angular[b] = {own[0], own[1], own[2]};
      linear[b] = {own[3], own[4], own[5]};
      ++b;
    }
    for (; b < tree.last_body; ++b)
      with_joint(t.body[b], [&](auto joint) LOCKSTEP_INLINED {
        const int z = t.articulated.velocity[b];
        T moved = T(0);  // -L's entries times what the parent does
        pass_outwards(joint, t, x, b, moved, angular, linear);
        y[z] = y[z] - moved;
        if (!t.body[b].leaf) (joint.prismatic ? linear : angular)[b][joint.k] += T(t.body[b].sign) * (v[z] - moved);
      });
  }
}

}  // namespace lockstep::kernels
