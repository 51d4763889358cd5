// Finds the contacts of all pairs, and what moves them. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "box_box.h"
#include "box_capsule.h"
#include "box_sphere.h"
#include "capsule_capsule.h"
#include "capsule_sphere.h"
#include "carry.h"
#include "drift.h"
#include "half_space_box.h"
#include "half_space_capsule.h"
#include "half_space_sphere.h"
#include "kernels/dynamics/motion.h"
#include "sphere_sphere.h"

namespace lockstep::kernels {

constexpr double least_margin = 0.005;  // (M103), m

template <class T>
PlacedShape<T> placed_shape(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int collider) {
  const ColliderPlace<ScalarOf<T>>& own = t.contacts.colliders[collider];
  PlacedShape<T> shape;
  for (int k = 0; k < 3; ++k) shape.size[k] = T(own.size[k]);
  const Mat3<T> rotation = Mat3<T>::constant(own.rotation);
  const Vec3<T> offset = Vec3<T>::constant(own.offset);
  if (own.body < 0) {
    shape.rotation = rotation, shape.center = offset;
    return shape;
  }
  const Mat3<T>& world = x.contacts.motion.world[own.body];
  shape.center = multiply_add(world, offset, x.contacts.motion.place[own.body]);
  for (int c = 0; c < 3; ++c) {
    const Vec3<T> column = multiply(world, column_of(rotation, c));
    for (int r = 0; r < 3; ++r) shape.rotation(r, c) = column[r];
  }
  return shape;
}

/// Velocity of a point of a body, and its angular velocity, in the world.
template <class T>
void velocity_at(const Motion<T>& m, int body, const Vec3<T>& point, Vec3<T>& angular, Vec3<T>& linear) {
  angular = linear = Vec3<T>::zero();
  if (body < 0) return;
  angular = multiply(m.world[body], m.angular[body]);
  linear = cross_add(angular, point - m.place[body], multiply(m.world[body], m.linear[body]));
}

template <class T>
void touch_shapes(PairKind kind, const PlacedShape<T>& a, const PlacedShape<T>& b, T margin, Patch<T>& patch) {
  switch (kind) {
    case PairKind::half_space_box: return half_space_box(a, b, margin, patch);
    case PairKind::half_space_capsule: return half_space_capsule(a, b, margin, patch);
    case PairKind::half_space_sphere: return half_space_sphere(a, b, margin, patch);
    case PairKind::box_box: return box_box(a, b, margin, patch);
    case PairKind::box_capsule: return box_capsule(a, b, margin, patch);
    case PairKind::box_sphere: return box_sphere(a, b, margin, patch);
    case PairKind::capsule_capsule: return capsule_capsule(a, b, margin, patch);
    case PairKind::capsule_sphere: return capsule_sphere(a, b, margin, patch);
    case PairKind::sphere_sphere: return sphere_sphere(a, b, margin, patch);
  }
}

/// (M108): how the pair's velocities turn and move its second collider against the first, in the frame of the contact.
/// Each body is taken at its end of `gap` along the normal, the second one's at + gap / 2 from the reference point.
template <class T>
void find_columns(const Tables<ScalarOf<T>>& t, const TouchingPair<ScalarOf<T>>& pair, const ContactPatch<T>& patch,
                  T gap, Tile<T>& x) {
  const Motion<T>& m = x.contacts.motion;
  const Vec3<T> to_end = scaled(patch.axes[0], T(ScalarOf<T>(0.5)) * gap);
  for (int k = pair.column; k < pair.column + pair.columns; ++k) {
    const PairColumn& column = t.contacts.columns[k];
    Vec3<T> turning = Vec3<T>::zero(), moving = turning, parted = turning;
    for (int p = column.first; p < column.last; ++p) {
      const ColumnPart& part = t.contacts.parts[p];
      const Body<ScalarOf<T>>& body = t.body[part.body];
      const bool slides = part.component < 0 ? body.prismatic : part.component >= 3;
      const int axis = part.component < 0 ? body.axis : part.component % 3;
      T share = T(part.component < 0 ? body.sign * ScalarOf<T>(part.sign) : ScalarOf<T>(part.sign));
      if (part.share >= 0) share *= x.couplings.share[part.share];
      const Vec3<T> e = scaled(column_of(m.world[part.body], axis), share);
      if (slides) {
        moving = moving + e;
        continue;
      }
      turning = turning + e;
      moving = cross_add(e, patch.point - m.place[part.body], moving);
      parted = fma(cross(e, to_end), T(ScalarOf<T>(part.sign)), parted);
    }
    moving = moving + parted;
    for (int i = 0; i < 3; ++i) {
      x.contacts.turning[k][i] = dot(patch.axes[i], turning);
      x.contacts.moving[k][i] = dot(patch.axes[i], moving);
      x.contacts.parted[k][i] = dot(patch.axes[i], parted);
    }
  }
}

/// Finds the slots of one pair. Those beyond the margin (M103) are off. Returns the lanes in which a contact goes on
/// that has pressed in the step before.
template <class T>
typename T::Mask collide_pair(const Tables<ScalarOf<T>>& t, const TouchingPair<ScalarOf<T>>& pair,
                              ContactPatch<T>& touch, Tile<T>& x) {
  using S = ScalarOf<T>;
  const ColliderPlace<S>&first = t.contacts.colliders[pair.first], &second = t.contacts.colliders[pair.second];
  const PlacedShape<T> a = placed_shape(t, x, pair.first), b = placed_shape(t, x, pair.second);
  Vec3<T> turning[2], moving[2];
  velocity_at(x.contacts.motion, first.body, b.center, turning[0], moving[0]);
  velocity_at(x.contacts.motion, second.body, b.center, turning[1], moving[1]);
  const Vec3<T> turns = turning[1] - turning[0], moves = moving[1] - moving[0], between = b.center - a.center;
  const T speed = fma(sqrt(dot(turns, turns)), T(second.reach), sqrt(dot(moves, moves)));
  const T margin = fma(T(2 * t.dt), speed, T(S(least_margin)));
  const T distance = first.unlimited ? dot(a.axis(2), between) - T(second.reach)
                                     : sqrt(dot(between, between)) - T(first.reach + second.reach);
  touch.near = less(distance, margin) & ~x.frozen;
  ContactSlot<T>* const slots = x.contacts.slot + pair.slot;
  for (int s = 0; s < pair.slots; ++s) slots[s].live = T::none();
  if (!any(touch.near)) return T::none();
  Patch<T> patch;
  touch_shapes(pair.kind, a, b, margin, patch);
  touch.axes[0] = patch.normal, touch.axes[1] = patch.tangent, touch.axes[2] = patch.other_tangent;
  // Friction acts on the surfaces: where one body stands still, the point is the other's end of the gap. Two moving
  // bodies of a pair with one slot have an end each; those of others meet in the middle.
  const S end = first.body < 0 ? S(0.5) : second.body < 0 ? S(-0.5) : S(0);
  for (int s = 0; s < pair.slots; ++s) patch.point[s] = fma(patch.normal, T(end) * patch.gap[s], patch.point[s]);
  const bool parts = pair.slots == 1 && first.body >= 0 && second.body >= 0;
  touch.point = pair.slots == 1 ? patch.point[0] : b.center;
  touch.center = b.center;
  touch.frame = a.rotation;
  touch.place = multiply_transposed(a.rotation, between);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) touch.turn(i, j) = dot(a.axis(i), b.axis(j));
  for (int s = 0; s < pair.slots; ++s) {
    ContactSlot<T>& slot = slots[s];
    slot.live = touch.near & patch.valid[s] & less(patch.gap[s], margin);
    const Vec3<T> arm = patch.point[s] - touch.point;
    for (int i = 0; i < 3; ++i) slot.arm[i] = select(slot.live, dot(touch.axes[i], arm), T(0));
    slot.gap = patch.gap[s];
    slot.face = patch.face[s];
  }
  const auto held = carry_memory(pair.slots, x.contacts.known, touch, slots);
  find_drift(held, T(t.dt) * sqrt(dot(turns, turns)), touch);
  find_columns(t, pair, touch, parts ? patch.gap[0] : T(0), x);
  return held;
}

/// Of all pairs. Returns the lanes in which a contact goes on that has pressed in the step before.
template <class T>
typename T::Mask collide(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  motions(t, x, x.contacts.motion);
  typename T::Mask held = T::none();
  for (int p = 0; p < t.contacts.pairs.count; ++p)
    held = held | collide_pair(t, t.contacts.pairs[p], x.contacts.patch[p], x);
  return held;
}

}  // namespace lockstep::kernels
