// Where colliders are in a step, and how large: (M167). SPDX-License-Identifier: Apache-2.0
#pragma once

#include "broad_phase.h"
#include "simd/sincos.h"

namespace lockstep::kernels {

/// Whether Shape::size has twice the number that kernels take.
constexpr bool is_halved(ShapeKind kind, int k) {
  return kind == ShapeKind::box || (k == 1 && (kind == ShapeKind::cylinder || kind == ShapeKind::capsule));
}

/// The environments' own places and sizes of colliders, where they are declared and `batch` has them: the model's else.
template <class T>
void load_colliders(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  using S = ScalarOf<T>;
  const S* row = batch.field(Parameter::collider_place);
  for (int i = 0; i < t.contacts.places(t); ++i, row += row ? batch.stride : 0)
    x.contacts.own_place[i] = row ? T::load(row) : T(0);
  if (!t.declares(Parameter::collider_size)) return;
  row = batch.field(Parameter::collider_size);
  for (int c = 0; c < t.contacts.colliders.count; ++c) {
    const ColliderPlace<S>& own = t.contacts.colliders[c];
    for (int k = 0; k < 3; ++k, row += row ? batch.stride : 0) {
      const T usual = T(own.kind == ShapeKind::hull ? S(1) : own.size[k]);
      x.contacts.own_size[3 * c + k] = row ? T::load(row) * T(S(is_halved(own.kind, k) ? 0.5 : 1.0)) : usual;
    }
  }
}

/// Sizes, and what bounds the collider.
template <class T>
LOCKSTEP_INLINE void size_collider(const Tables<ScalarOf<T>>& t, int c, const Contacts<T>& contacts,
                                   MovingCollider<T>& moving) {
  using S = ScalarOf<T>;
  const ColliderPlace<S>& own = t.contacts.colliders[c];
  for (int k = 0; k < 3; ++k) moving.shape.size[k] = T(own.size[k]), moving.half[k] = T(own.half[k]);
  moving.reach = T(own.reach);
  if (!t.declares(Parameter::collider_size) || is_ground(own.kind)) return;
  const T* const size = contacts.own_size + 3 * c;
  const bool is_hull = own.kind == ShapeKind::hull;
  T grows = T(0);
  for (int k = 0; k < 3; ++k) {
    if (is_hull)
      moving.scale[k] = size[k];
    else
      moving.shape.size[k] = size[k];
    if (is_hull || own.size[k] > S(0)) grows = larger(grows, size[k] / T(is_hull ? S(1) : own.size[k]));
  }
  // A hull's radius stays.
  const T radius = T(is_hull ? own.size[0] : S(0));
  moving.reach = fma(moving.reach - radius, grows, radius);
  for (int k = 0; k < 3; ++k) moving.half[k] = fma(moving.half[k] - radius, grows, radius);
}

/// (M167), in the axes of its body, or of the world.
template <class T>
LOCKSTEP_INLINE void offset_collider(const Tables<ScalarOf<T>>& t, int c, const Contacts<T>& contacts,
                                     Mat3<T>& rotation, Vec3<T>& offset) {
  const ColliderPlace<ScalarOf<T>>& own = t.contacts.colliders[c];
  rotation = Mat3<T>::constant(own.rotation), offset = Vec3<T>::constant(own.offset);
  if (!t.declares(Parameter::collider_place)) return;
  const T* const place = contacts.own_place + 4 * c;
  T sine, cosine;
  sincos(place[3], sine, cosine);
  const auto turned = [&](const Vec3<T>& v) LOCKSTEP_INLINED {
    return Vec3<T>{fnma(sine, v.y, cosine * v.x), fma(sine, v.x, cosine * v.y), v.z};
  };
  for (int k = 0; k < 3; ++k) {
    const Vec3<T> column = turned(column_of(rotation, k));
    for (int r = 0; r < 3; ++r) rotation(r, k) = column[r];
  }
  offset = turned(offset) + Vec3<T>{place[0], place[1], place[2]};
  if (!own.in_link) return;
  const Mat3<T> link = Mat3<T>::constant(own.link_rotation);
  rotation = product(link, rotation);
  offset = multiply_add(link, offset, Vec3<T>::constant(own.link_offset));
}

/// Colliders that stand in the world have the body -1.
template <class T>
void place_collider(const Tables<ScalarOf<T>>& t, int c, Contacts<T>& contacts) {
  const Motion<T>& m = contacts.motion;
  MovingCollider<T>& moving = contacts.collider[c];
  size_collider(t, c, contacts, moving);
  Mat3<T> rotation;
  Vec3<T> offset;
  offset_collider(t, c, contacts, rotation, offset);
  const int body = t.contacts.colliders[c].body;
  if (body < 0) {
    moving.shape.rotation = rotation, moving.shape.center = offset;
    moving.place = moving.angular = moving.linear = Vec3<T>::zero();
    return bound_pairs(t, moving);
  }
  const Mat3<T>& world = m.world[body];
  moving.place = m.place[body];
  moving.shape.center = multiply_add(world, offset, moving.place);
  for (int k = 0; k < 3; ++k) {
    const Vec3<T> column = multiply(world, column_of(rotation, k));
    for (int r = 0; r < 3; ++r) moving.shape.rotation(r, k) = column[r];
  }
  moving.angular = multiply(world, m.angular[body]);
  moving.linear = multiply(world, m.linear[body]);
  bound_pairs(t, moving);
}

}  // namespace lockstep::kernels
