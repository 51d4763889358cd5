// Finds the contacts of all pairs, and what moves them. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "box_box.h"
#include "box_capsule.h"
#include "box_sphere.h"
#include "broad_phase.h"
#include "capsule_capsule.h"
#include "capsule_sphere.h"
#include "carry.h"
#include "convex.h"
#include "drift.h"
#include "half_space_box.h"
#include "half_space_capsule.h"
#include "half_space_cylinder.h"
#include "half_space_ellipsoid.h"
#include "half_space_hull.h"
#include "half_space_sphere.h"
#include "height_field.h"
#include "kernels/dynamics/motion.h"
#include "kernels/dynamics/relative_columns.h"
#include "place_collider.h"
#include "sphere_sphere.h"

namespace lockstep::kernels {

template <class T>
LOCKSTEP_INLINE HullTable<ScalarOf<T>> hull_at(const Tables<ScalarOf<T>>& t, int collider) {
  const ColliderStructure& own = t.contacts.colliders[collider];
  return own.kind == ShapeKind::hull ? hull_of(t.contacts, own.table) : HullTable<ScalarOf<T>>{};
}

template <class T>
LOCKSTEP_INLINE Core<T> core_of(const Tables<ScalarOf<T>>& t, int collider, const MovingCollider<T>& moving,
                                const HullTable<ScalarOf<T>>& hull) {
  const T(&size)[3] = moving.shape.size;
  return {t.contacts.colliders[collider].kind,
          {size[0], size[1], size[2]},
          &hull,
          t.declares(Parameter::collider_size) ? moving.scale : nullptr};
}

/// Of the lanes `near`. `memory` is that of a convex pair, where `kept` are the lanes that have one.
template <class T>
void touch_shapes(const Tables<ScalarOf<T>>& t, const TouchingPair<ScalarOf<T>>& pair, const MovingCollider<T>& before,
                  const MovingCollider<T>& after, T margin, typename T::Mask near, typename T::Mask kept,
                  ConvexMemory<T>* memory, GroundPoints<T>& ground, Patch<T>& patch) {
  using S = ScalarOf<T>;
  const PlacedShape<T>&a = before.shape, &b = after.shape;
  switch (pair.kind) {
    case PairKind::half_space_box: return half_space_box(a, b, margin, patch);
    case PairKind::half_space_hull: {
      const HullTable<S> hull = hull_at<T>(t, pair.second);
      return half_space_hull(a, core_of(t, pair.second, after, hull), b, T(pair.slack), patch);
    }
    case PairKind::half_space_cylinder: return half_space_cylinder(a, b, margin, patch);
    case PairKind::half_space_ellipsoid: return half_space_ellipsoid(a, b, margin, patch);
    case PairKind::half_space_capsule: return half_space_capsule(a, b, margin, patch);
    case PairKind::half_space_sphere: return half_space_sphere(a, b, margin, patch);
    case PairKind::height_field: {
      const HullTable<S> hull = hull_at<T>(t, pair.second);
      const HeightTable<S> field = height_field_of(t.contacts, t.contacts.colliders[pair.first].table);
      return touch_height_field(field, a, core_of(t, pair.second, after, hull), pair.point, ground, patch);
    }
    case PairKind::box_box: return box_box(a, b, pair, near, margin, patch);
    case PairKind::box_capsule: return box_capsule(a, b, margin, patch);
    case PairKind::box_sphere: return box_sphere(a, b, margin, patch);
    case PairKind::capsule_capsule: return capsule_capsule(a, b, margin, patch);
    case PairKind::capsule_sphere: return capsule_sphere(a, b, margin, patch);
    case PairKind::sphere_sphere: return sphere_sphere(a, b, margin, patch);
    case PairKind::convex_faces:
    case PairKind::convex_line:
    case PairKind::convex_point: {
      const HullTable<S> hull = hull_at<T>(t, pair.first), other_hull = hull_at<T>(t, pair.second);
      return touch_convex(core_of(t, pair.first, before, hull), core_of(t, pair.second, after, other_hull), a, b, pair,
                          margin, near, kept, *memory, patch);
    }
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
      const PartAxis<T> own = axis_of_part(t, part, m, x);
      if (own.slides) {
        moving = moving + own.axis;
        continue;
      }

      // A rotation moves the reference point, and the two ends of the gap against each other.
      turning = turning + own.axis;
      moving = cross_add(own.axis, patch.point - m.place[part.body], moving);
      parted = fma(cross(own.axis, to_end), T(ScalarOf<T>(part.sign)), parted);
    }
    moving = moving + parted;
    for (int i = 0; i < 3; ++i) {
      x.contacts.turning[k][i] = dot(patch.axes[i], turning);
      x.contacts.moving[k][i] = dot(patch.axes[i], moving);
      x.contacts.parted[k][i] = dot(patch.axes[i], parted);
    }
  }
}

/// What lies between a collider and the heights that it can reach.
template <class T>
T distance_above(const Tables<ScalarOf<T>>& t, int field, const MovingCollider<T>& before,
                 const MovingCollider<T>& after) {
  const Vec3<T> seen = multiply_transposed(before.shape.rotation, after.shape.center - before.shape.center);
  const HeightTable<ScalarOf<T>> table = height_field_of(t.contacts, t.contacts.colliders[field].table);
  return seen.z - after.reach - nearest_number(table, table.most, FieldCell<T>(table, before.shape, seen));
}

template <class T>
void find_ground_points(const Tables<ScalarOf<T>>& t, const TouchingPair<ScalarOf<T>>& pair,
                        const MovingCollider<T>& before, const MovingCollider<T>& after, const ContactPatch<T>& touch,
                        GroundPoints<T>& ground) {
  const HullTable<ScalarOf<T>> hull = hull_at<T>(t, pair.second);
  const HeightTable<ScalarOf<T>> field = height_field_of(t.contacts, t.contacts.colliders[pair.first].table);
  PlacedShape<T> seen = after.shape;
  seen.rotation = touch.turn, seen.center = touch.place;
  find_ground_points(field, before.shape, core_of(t, pair.second, after, hull), seen, after.reach, T(pair.slack),
                     ground);
}

/// Finds the slots of one pair. Those beyond the margin (M103) are off. Returns the lanes in which a contact goes on
/// that has pressed in the step before. Pairs of one contact follow each other and share `ground`.
template <class T>
typename T::Mask collide_pair(const Tables<ScalarOf<T>>& t, int p, GroundPoints<T>& ground, Tile<T>& x) {
  using S = ScalarOf<T>;
  const TouchingPair<S>& pair = t.contacts.pairs[p];
  ContactPatch<T>& touch = x.contacts.patch[p];
  const ColliderPlace<S>&first = t.contacts.colliders[pair.first], &second = t.contacts.colliders[pair.second];
  const MovingCollider<T>&before = x.contacts.collider[pair.first], &after = x.contacts.collider[pair.second];
  const PlacedShape<T>&a = before.shape, &b = after.shape;

  // The margin (M103), and the lanes in which the colliders can be within it.
  const Vec3<T> turns = after.angular - before.angular, between = b.center - a.center,
                moves = after.velocity_at(b.center) - before.velocity_at(b.center);
  const T speed = fma(sqrt(dot(turns, turns)), after.reach, sqrt(dot(moves, moves)));
  const T margin = fma(T(2 * t.dt), speed, T(S(least_margin)));
  const T distance = first.kind == ShapeKind::half_space ? dot(a.axis(2), between) - after.reach
                     : first.kind == ShapeKind::height_field
                         ? distance_above(t, pair.first, before, after)
                         : sqrt(dot(between, between)) - (before.reach + after.reach);
  touch.near = less(distance, margin) & ~x.frozen;
  if (pair.by_boxes && any(touch.near)) touch.near = touch.near & boxes_meet(before, after, margin);
  if (!any(touch.near)) {
    clear_pair(pair, p, x.contacts);
    return T::none();
  }
  ContactSlot<T>* const slots = x.contacts.slot + pair.slot;
  ConvexMemory<T>* const memory = pair.memory < 0 ? nullptr : x.contacts.convex + pair.memory;
  touch.live_count = 0;

  // The second collider as the first sees it, for drift.
  touch.center = b.center;
  touch.frame = a.rotation;
  touch.place = multiply_transposed(a.rotation, between);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) touch.turn(i, j) = dot(a.axis(i), b.axis(j));

  // Points, gaps and the frame of the contact, by the pair of shapes.
  Patch<T> patch;
  if (pair.kind == PairKind::height_field && pair.point == 0) find_ground_points(t, pair, before, after, touch, ground);
  const auto kept = memory ? x.contacts.kept & less(T(S(0.25)), dot(memory->normal, memory->normal)) : T::none();
  touch_shapes(t, pair, before, after, margin, touch.near, kept, memory, ground, patch);
  touch.axes[0] = patch.normal, touch.axes[1] = patch.tangent, touch.axes[2] = patch.other_tangent;

  // Friction acts on the surfaces: where one body stands still, the point is the other's end of the gap. Two moving
  // bodies of a pair with one slot have an end each; those of others meet in the middle.
  const S end = first.body < 0 ? S(0.5) : second.body < 0 ? S(-0.5) : S(0);
  for (int s = 0; s < pair.slots; ++s) patch.point[s] = fma(patch.normal, T(end) * patch.gap[s], patch.point[s]);
  const bool parts = pair.slots == 1 && first.body >= 0 && second.body >= 0;

  touch.point = pair.slots == 1 ? patch.point[0] : b.center;  // the reference point (M108)

  // Slots within the margin are live. Memory without one would depend on how a pair was found to be far.
  auto touches = T::none();
  for (int s = 0; s < pair.slots; ++s) {
    ContactSlot<T>& slot = slots[s];
    slot.live = touch.near & patch.valid[s] & less(patch.gap[s], margin);
    const Vec3<T> arm = patch.point[s] - touch.point;
    for (int i = 0; i < 3; ++i) slot.arm[i] = select(slot.live, dot(touch.axes[i], arm), T(0));
    slot.gap = patch.gap[s];
    slot.face = patch.face[s];
    touches = touches | slot.live;
    if (any(slot.live)) touch.live[touch.live_count++] = s;
  }
  if (memory) {
    memory->normal = select<T>(touches, memory->normal, Vec3<T>::zero());
    memory->corners = select<T>(touches, memory->corners, Vec3<T>::zero());
  }

  // What goes on from the step before, and what moves the pair.
  TurningFriction<T>* const turning =
      pair.turning_friction < 0 ? nullptr : x.contacts.turning_friction + pair.turning_friction;
  const auto held = carry_memory(pair.slots, x.contacts.kept, touch, slots, turning);
  find_drift(held & x.contacts.known, T(t.dt) * sqrt(dot(turns, turns)), touch);
  find_columns(t, pair, touch, parts ? patch.gap[0] : T(0), x);
  return held;
}

/// Of one pair.
template <class T>
void count_live(const LiveSlots<T>& slots, SolveCounts<T>& counts) {
  const T one = T(1), zero = T(0);
  T live = zero;
  for (const ContactSlot<T>& slot : slots) live += select(slot.live, one, zero);
  counts.live += live;
  counts.near += select(less(zero, live), one, zero);
  counts.tile_live += T(slots.patch.live_count);
}

/// Of all pairs. Returns the lanes in which a contact goes on that has pressed in the step before. Needs kinematics().
template <class T>
typename T::Mask collide(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  move_bodies(t, x, x.contacts.motion);
  for (int c = 0; c < t.contacts.colliders.count; ++c) place_collider(t, c, x.contacts);
  typename T::Mask held = T::none();
  x.contacts.near_count = 0;
  x.counts.steps += select(x.frozen, T(0), T(1));
  const int listed = list_pairs(t, x);
  GroundPoints<T> ground;
  for (int i = 0; i < listed; ++i) {
    const int p = x.contacts.near_pairs[i];  // those that are near stay, at most as far back
    held = held | collide_pair(t, p, ground, x);
    const ContactPatch<T>& patch = x.contacts.patch[p];
    if (patch.live_count == 0) continue;
    x.contacts.listed_pairs[x.contacts.near_count] = x.contacts.near_pairs[x.contacts.near_count] = p;
    ++x.contacts.near_count;
    count_live(LiveSlots<T>{x.contacts.slot + t.contacts.pairs[p].slot, patch}, x.counts);
  }
  x.contacts.listed_count = x.contacts.near_count;
  x.contacts.listed_lanes = ~T::none();
  x.contacts.lists_all = true;
  return held;
}

}  // namespace lockstep::kernels
