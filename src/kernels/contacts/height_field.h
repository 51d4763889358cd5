// Points of shapes against the triangles of a height field that are below them. SPDX-License-Identifier: Apache-2.0
//
// (M168), (M169). A pair is one point and has one slot, so each point has the normal of its own triangle. What ends
// between points is missed: docs/contacts.md says it.
#pragma once

#include "half_space_box.h"
#include "half_space_cylinder.h"
#include "half_space_ellipsoid.h"
#include "half_space_hull.h"
#include "support.h"

namespace lockstep::kernels {

/// A triangle of the field, in the field's frame.
template <class T>
struct Facet {
  Vec3<T> corner[3];
  Vec3<T> normal;  // upwards, length 1
  T height;        // above the point that asked for it
  T number;
  typename T::Mask inside;  // lanes in which the point is above or below the field
};

/// The cell below a point of the field's frame: its corner of least x and y, and where the point is in it. Points
/// beyond the edges have the nearest cell.
template <class T>
struct FieldCell {
  T column, row, u, v, index;
  typename T::Mask inside;

  LOCKSTEP_INLINE FieldCell(const HeightTable<ScalarOf<T>>& field, const PlacedShape<T>& placed, const Vec3<T>& p) {
    using S = ScalarOf<T>;
    const T right = T(S(field.columns - 1)), back = T(S(field.rows - 1)), half = T(S(0.5));
    const T x = fma(p.x, placed.size[0], half * right), y = fma(p.y, placed.size[1], half * back);
    inside = ~less(x, T(0)) & ~less(right, x) & ~less(y, T(0)) & ~less(back, y);
    // A number that is none becomes 0.
    const auto kept = [](T at, T most) LOCKSTEP_INLINED { return smaller(select(less(T(0), at), at, T(0)), most); };
    column = truncated(kept(x, right - T(1))), row = truncated(kept(y, back - T(1)));
    u = kept(x, right) - column, v = kept(y, back) - row;
    index = fma(row, T(S(field.columns)), column);
  }
};

/// Of the grid's point that is nearest.
template <class T>
LOCKSTEP_INLINE T nearest_number(const HeightTable<ScalarOf<T>>& field, const ScalarOf<T>* numbers,
                                 const FieldCell<T>& cell) {
  using S = ScalarOf<T>;
  const T half = T(S(0.5)), one = T(1), zero = T(0);
  const T column = select(less(half, cell.u), one, zero), row = select(less(half, cell.v), one, zero);
  return gather(numbers, fma(row, T(S(field.columns)), cell.index + column));
}

/// (M168).
template <class T>
Facet<T> facet_below(const HeightTable<ScalarOf<T>>& field, const PlacedShape<T>& placed, const Vec3<T>& p) {
  using S = ScalarOf<T>;
  const FieldCell<T> cell(field, placed, p);
  const T near_left = gather(field.heights, cell.index), near_right = gather(field.heights + 1, cell.index),
          far_left = gather(field.heights + field.columns, cell.index),
          far_right = gather(field.heights + field.columns + 1, cell.index);
  const auto lower = ~less(cell.u, cell.v);
  const T along = select(lower, near_right - near_left, far_right - far_left),
          across = select(lower, far_right - near_right, far_left - near_left);
  Facet<T> facet;
  facet.inside = cell.inside;
  facet.height = fma(along, cell.u, fma(across, cell.v, near_left));
  const T slope_x = along * placed.size[0], slope_y = across * placed.size[1];
  const T up = T(1) / sqrt(fma(slope_x, slope_x, fma(slope_y, slope_y, T(1))));
  facet.normal = {-slope_x * up, -slope_y * up, up};
  facet.number = fma(T(S(2)), cell.index, select(lower, T(0), T(1)));
  const T half = T(S(0.5)), width = T(1) / placed.size[0], depth = T(1) / placed.size[1];
  const T left = (cell.column - half * T(S(field.columns - 1))) * width,
          near = (cell.row - half * T(S(field.rows - 1))) * depth;
  facet.corner[0] = {left, near, near_left};
  facet.corner[1] = {select(lower, left + width, left), select(lower, near, near + depth),
                     select(lower, near_right, far_left)};
  facet.corner[2] = {left + width, near + depth, far_right};
  return facet;
}

/// Of a ball: from the triangle to its centre, and the gap.
template <class T>
struct FacetGap {
  Vec3<T> normal, nearest;
  T gap, number;
  typename T::Mask above, valid;  // lanes in which the centre is above its plane; in which it is known
};

/// (M169): the nearest point of the triangle. Below its plane, the plane counts.
template <class T>
FacetGap<T> gap_to(const Facet<T>& facet, const Vec3<T>& center, T radius) {
  using S = ScalarOf<T>;
  const T height = dot(facet.normal, center - facet.corner[0]);
  const Vec3<T> foot = fma(facet.normal, -height, center);
  auto within = ~T::none();
  Vec3<T> nearest = foot;  // of the edges
  T least = T(S(1e30));
  const auto turns = [&](int k) LOCKSTEP_INLINED { return facet.corner[(k + 1) % 3] - facet.corner[k]; };
  const T side = sign_of(dot(facet.normal, cross(turns(0), turns(1))));  // of the order of the corners
  for (int k = 0; k < 3; ++k) {
    const Vec3<T> edge = turns(k), from = foot - facet.corner[k];
    within = within & ~less(side * dot(facet.normal, cross(edge, from)), T(0));
    const T share = clamp(dot(edge, from) / dot(edge, edge), T(0), T(1));
    const Vec3<T> at = fma(edge, share, facet.corner[k]), away = at - foot;
    const T squared = dot(away, away);
    const auto nearer = less(squared, least);
    least = select(nearer, squared, least), nearest = select<T>(nearer, at, nearest);
  }
  FacetGap<T> found;
  found.above = ~less(height, T(0)), found.valid = facet.inside, found.number = facet.number;
  const Vec3<T> away = center - nearest;
  const T distance = sqrt(dot(away, away));
  const auto by_edge = found.above & ~within & less(T(S(1e-9)), distance);
  found.normal = select<T>(by_edge, scaled(away, T(1) / select(by_edge, distance, T(1))), facet.normal);
  found.gap = select(by_edge, distance, height) - radius;
  found.nearest = select<T>(by_edge, nearest, foot);
  return found;
}

/// The nearer of two triangles: the one below p, and the one below the foot of the centre on its plane, which has the
/// nearest point where neighbours lie in one plane.
template <class T>
FacetGap<T> gap_toward(const HeightTable<ScalarOf<T>>& field, const PlacedShape<T>& placed, const Vec3<T>& p,
                       const Vec3<T>& center, T radius) {
  const Facet<T> facet = facet_below(field, placed, p);
  FacetGap<T> found = gap_to(facet, center, radius);
  const T height = dot(facet.normal, center - facet.corner[0]);
  const FacetGap<T> next = gap_to(facet_below(field, placed, fma(facet.normal, -height, center)), center, radius);
  const auto nearer = found.above & next.above & next.valid & less(next.gap, found.gap);
  found.normal = select<T>(nearer, next.normal, found.normal);
  found.nearest = select<T>(nearer, next.nearest, found.nearest);
  found.gap = select(nearer, next.gap, found.gap), found.number = select(nearer, next.number, found.number);
  return found;
}

/// The points of a collider that may touch the field, in the field's frame: each is the centre of a ball.
template <class T>
struct GroundPoints {
  static constexpr int most = 6;
  Vec3<T> center[most];
  typename T::Mask valid[most];
  FacetGap<T> below[most];  // of round shapes
};

/// The plane through heights to four sides of a shape: it stands on what looks down to that.
template <class T>
PlacedShape<T> mean_plane(const HeightTable<ScalarOf<T>>& field, const PlacedShape<T>& placed, const Vec3<T>& center,
                          T reach) {
  using S = ScalarOf<T>;
  const T way = T(S(0.7)) * reach, rate = T(S(0.5)) / way;
  const auto height = [&](T x, T y) LOCKSTEP_INLINED {
    return facet_below(field, placed, {center.x + x, center.y + y, center.z}).height;
  };
  const T right = height(way, T(0)), left = height(-way, T(0)), back = height(T(0), way), front = height(T(0), -way);
  const T slope_x = (right - left) * rate, slope_y = (back - front) * rate;
  const Vec3<T> up{-slope_x, -slope_y, T(1)}, along{T(1), T(0), slope_x};
  const Vec3<T> normal = scaled(up, T(1) / sqrt(dot(up, up))), x = scaled(along, T(1) / sqrt(dot(along, along))),
                y = cross(normal, x);
  PlacedShape<T> plane;
  plane.center = {center.x, center.y, T(S(0.25)) * ((right + left) + (back + front))};
  for (int r = 0; r < 3; ++r)
    plane.rotation(r, 0) = x[r], plane.rotation(r, 1) = y[r], plane.rotation(r, 2) = normal[r];
  return plane;
}

/// A lying cylinder has points before and behind its lowest line, too, where a wheel meets a step.
template <class T>
void points_of_rim(const PlacedShape<T>& plane, const PlacedShape<T>& cylinder, GroundPoints<T>& ground) {
  using S = ScalarOf<T>;
  constexpr double diagonal = 0.70710678118654752;
  const Vec3<T> axis = cylinder.axis(2), n = plane.axis(2);
  const auto stands = less(T(S(diagonal)), absolute(dot(n, axis)));
  const Vec3<T> across = cross(axis, n);
  const T length = larger(dot(across, across), T(S(1e-20)));
  const Vec3<T> ahead = scaled(across, cylinder.size[0] / sqrt(length)), down = cross(axis, ahead);
  for (int k = 0; k < 4; ++k) {
    const Vec3<T> rim = scaled(fma(ahead, T(S(k < 2 ? 1 : -1)), down), T(S(diagonal)));
    const Vec3<T> lying = fma(axis, (k % 2 == 0 ? cylinder.size[1] : -cylinder.size[1]), rim) + cylinder.center;
    ground.center[2 + k] = k < 2 ? select<T>(stands, ground.center[2 + k], lying) : lying;
    ground.valid[2 + k] = k < 2 ? ~T::none() : ~stands;
  }
}

/// Once for all pairs of a contact. `seen` is the shape in the field's frame.
template <class T>
void find_ground_points(const HeightTable<ScalarOf<T>>& field, const PlacedShape<T>& placed, const Core<T>& core,
                        const PlacedShape<T>& seen, T reach, T slack, GroundPoints<T>& ground) {
  using S = ScalarOf<T>;
  for (int k = 0; k < GroundPoints<T>::most; ++k) ground.center[k] = seen.center, ground.valid[k] = ~T::none();
  if (core.kind == ShapeKind::sphere) return;
  if (core.kind == ShapeKind::capsule) {
    for (int k = 0; k < 4; ++k) ground.center[k] = fma(seen.axis(2), k < 2 ? -seen.size[1] : seen.size[1], seen.center);
    return;
  }
  const PlacedShape<T> plane = mean_plane(field, placed, seen.center, reach);
  Patch<T> patch;
  const T none = T(0);
  switch (core.kind) {
    case ShapeKind::box: half_space_box(plane, seen, none, patch); break;
    case ShapeKind::cylinder: half_space_cylinder(plane, seen, none, patch); break;
    case ShapeKind::ellipsoid: half_space_ellipsoid(plane, seen, none, patch); break;
    default: half_space_hull(plane, core, seen, slack, patch); break;
  }
  const int points = core.kind == ShapeKind::ellipsoid ? 1 : 4;
  for (int k = 0; k < points; ++k) {
    // The middle of the gap, back to the shape, and into it by its radius.
    const T back = fma(T(S(0.5)), patch.gap[k], radius_of(core));
    ground.center[k] = fma(patch.normal, back, patch.point[k]), ground.valid[k] = patch.valid[k];
  }
  if (core.kind == ShapeKind::cylinder) points_of_rim(plane, seen, ground);
}

/// The triangles to four sides of a ball: of those that rise above the plane of the contact below and look another
/// way, or are nearer, the nearest. An edge in that plane is none, or a ball would stumble over the edges of a level
/// ground.
template <class T>
FacetGap<T> gap_beside(const HeightTable<ScalarOf<T>>& field, const PlacedShape<T>& placed, const Vec3<T>& center,
                       T radius, const FacetGap<T>& below) {
  using S = ScalarOf<T>;
  constexpr double same = 0.995, least_rise = 1e-3;  // a cosine, 6 degrees; of the radius
  const T least = T(S(least_rise)) * radius;
  FacetGap<T> best = below;
  best.gap = T(S(1e30)), best.valid = T::none();
  for (int side = 0; side < 4; ++side) {
    const T way = side % 2 == 0 ? radius : -radius;
    Vec3<T> at = center;
    at[side / 2] = at[side / 2] + way;
    const FacetGap<T> own = gap_toward(field, placed, at, center, radius);
    const auto rises = less(least, dot(below.normal, own.nearest - below.nearest));
    const auto differs = less(dot(own.normal, below.normal), T(S(same))) | less(own.gap, below.gap - least);
    const auto taken = own.valid & below.above & own.above & rises & differs & less(own.gap, best.gap);
    best.normal = select<T>(taken, own.normal, best.normal);
    best.gap = select(taken, own.gap, best.gap), best.number = select(taken, own.number, best.number);
    best.valid = best.valid | taken;
  }
  return best;
}

/// Of one pair. Points of round shapes have two: the triangle below, and one beside.
template <class T>
void touch_height_field(const HeightTable<ScalarOf<T>>& field, const PlacedShape<T>& placed, const Core<T>& core,
                        int point, GroundPoints<T>& ground, Patch<T>& patch) {
  using S = ScalarOf<T>;
  const bool is_round = core.kind == ShapeKind::sphere || core.kind == ShapeKind::capsule;
  const Vec3<T>& center = ground.center[point];
  const T radius = radius_of(core);
  FacetGap<T> found;
  if (is_round && point % 2 == 1)
    found = gap_beside(field, placed, center, radius, ground.below[point - 1]);
  else if (is_round)
    found = ground.below[point] = gap_toward(field, placed, center, center, radius);
  else {
    const Facet<T> facet = facet_below(field, placed, center);
    found.normal = facet.normal, found.number = facet.number, found.valid = facet.inside;
    found.gap = dot(facet.normal, center - facet.corner[0]) - radius;
  }
  patch.normal = multiply(placed.rotation, found.normal);
  patch.gap[0] = found.gap;
  const Vec3<T> at = fma(found.normal, -fma(T(S(0.5)), found.gap, radius), center);
  patch.point[0] = multiply_add(placed.rotation, at, placed.center);
  patch.valid[0] = found.valid & ground.valid[point];
  // Impulses that are carried turn with the tangents, too.
  const T tangent = tangents_along(placed, patch);
  patch.face[0] = fma(T(S(3)), found.number, tangent);
}

}  // namespace lockstep::kernels
