// Which pairs can have a slot within the margin: by spheres about the colliders, then by boxes.
// SPDX-License-Identifier: Apache-2.0
//
// It loses no pair of which collide_pair() would find a slot, so results have the same bits without it.
#pragma once

#include "shapes.h"

namespace lockstep::kernels {

constexpr double least_margin = 0.005;  // (M103), m

/// (M161): how far the collider's pairs reach, whatever the other one is.
template <class T>
void bound_pairs(const Tables<ScalarOf<T>>& t, MovingCollider<T>& moving) {
  using S = ScalarOf<T>;
  const Vec3<T> velocity = moving.velocity_at(moving.shape.center);
  const T turn = T(2 * t.dt) * sqrt(dot(moving.angular, moving.angular)),
          way = T(2 * t.dt) * sqrt(dot(velocity, velocity));
  moving.stretch = select(less(turn, T(S(0.5))), (T(1) + turn) / (T(1) - turn), T(S(1e6)));
  moving.span = moving.reach + (T(S(least_margin)) + way);
  moving.other_span = fma(moving.reach, T(1) + turn, way);
}

/// Lanes in which the spheres about the two are within any margin that the pair can have (M161).
template <class T>
LOCKSTEP_INLINE typename T::Mask spheres_meet(ShapeKind kind, const MovingCollider<T>& first,
                                              const MovingCollider<T>& second) {
  using S = ScalarOf<T>;
  constexpr S rounding = S(1.001);
  const Vec3<T> between = second.shape.center - first.shape.center;
  if (kind == ShapeKind::height_field)
    return less(dot(first.shape.axis(2), between) - first.shape.size[2],
                fma(T(rounding), second.other_span, T(S(2 * least_margin))));
  if (kind == ShapeKind::half_space)
    return less(dot(first.shape.axis(2), between), fma(T(rounding), second.other_span, T(S(2 * least_margin))));
  const T most = T(rounding) * first.stretch * (first.span + second.other_span);
  return less(dot(between, between), most * most);
}

/// Lanes in which no axis of one of the boxes about the two has a gap beyond the margin (M162).
template <class T>
typename T::Mask boxes_meet(const MovingCollider<T>& first, const MovingCollider<T>& second, T margin) {
  using S = ScalarOf<T>;
  const PlacedShape<T>&a = first.shape, &b = second.shape;
  const Vec3<T> between = b.center - a.center;
  // A gap is smaller along a normal that leans by 2 mrad to that of a face; the rest is for rounding.
  const T most = fma(T(S(1.01)), margin, T(S(2.1e-3)) * (first.reach + second.reach));
  T turn[3][3], place[3], across[3];
  for (int j = 0; j < 3; ++j) across[j] = second.half[j];
  auto meet = ~T::none();
  for (int i = 0; i < 3; ++i) {
    const Vec3<T> axis = a.axis(i);
    place[i] = dot(axis, between);
    T extent = first.half[i];
    for (int j = 0; j < 3; ++j) {
      turn[i][j] = dot(axis, b.axis(j));
      const T size = absolute(turn[i][j]);
      extent = fma(size, second.half[j], extent);
      across[j] = fma(size, first.half[i], across[j]);
    }
    meet = meet & less(absolute(place[i]) - extent, most);
  }
  for (int j = 0; j < 3; ++j) {
    const T along = fma(turn[0][j], place[0], fma(turn[1][j], place[1], turn[2][j] * place[2]));
    meet = meet & less(absolute(along) - across[j], most);
  }
  return meet;
}

/// The pair has no slot in any lane.
template <class T>
LOCKSTEP_INLINE void clear_pair(const TouchingPair<ScalarOf<T>>& pair, int p, Contacts<T>& contacts) {
  contacts.patch[p].near = T::none();
  contacts.patch[p].live_count = 0;
  for (int s = 0; s < pair.slots; ++s) contacts.slot[pair.slot + s].live = T::none();
  if (pair.memory >= 0) contacts.convex[pair.memory].normal = contacts.convex[pair.memory].corners = Vec3<T>::zero();
}

/// Lists the pairs whose spheres meet in near_pairs, and clears the others. Returns how many it lists.
template <class T>
int list_pairs(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  int listed = 0;
  const auto moves = ~x.frozen;
  for (int p = 0; p < t.contacts.pairs.count; ++p) {
    const TouchingPair<ScalarOf<T>>& pair = t.contacts.pairs[p];
    const auto near = spheres_meet(t.contacts.colliders[pair.first].kind, x.contacts.collider[pair.first],
                                   x.contacts.collider[pair.second]);
    if (any(near & moves))
      x.contacts.near_pairs[listed++] = p;
    else
      clear_pair(pair, p, x.contacts);
  }
  return listed;
}

}  // namespace lockstep::kernels
