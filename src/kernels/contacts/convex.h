// Two convex shapes: up to four points of the face in which they touch, else the nearest points.
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "faces.h"
#include "gjk.h"
#include "slots.h"

namespace lockstep::kernels {

constexpr double flat_cosine = 1.0 - 2e-6;  // of a normal and a face's: 2 mrad

/// A face in the frame of the contact: x and y along the tangents, z along the normal, about the nearest point.
template <class T>
struct SeenFace {
  Vec3<T> corner[most_face_corners];
  int corners;
  Vec3<T> normal;
};

/// Points that may become slots; z is the gap.
template <class T>
struct SharedPoints {
  static constexpr int most = 3 * most_face_corners + 3;
  T x[most], y[most], z[most];
  typename T::Mask valid[most];
  int count = 0;

  LOCKSTEP_INLINE void add(T at_x, T at_y, T gap, typename T::Mask may) {
    x[count] = at_x, y[count] = at_y, z[count] = gap, valid[count] = may;
    ++count;
  }
};

/// The part of a segment inside a polygon that turns to the left about z, as shares of its length.
template <class T>
struct Part {
  T low, high;
  typename T::Mask valid;
};
template <class T>
Part<T> clip(const Vec3<T>& from, const Vec3<T>& to, const SeenFace<T>& polygon, T turns, T tolerance) {
  using S = ScalarOf<T>;
  Part<T> part{T(0), T(1), ~T::none()};
  const T dx = to.x - from.x, dy = to.y - from.y;
  for (int i = 0; i < polygon.corners; ++i) {
    const Vec3<T>&a = polygon.corner[i], &b = polygon.corner[i + 1 < polygon.corners ? i + 1 : 0];
    const T ex = (b.x - a.x) * turns, ey = (b.y - a.y) * turns;
    const T length = absolute(ex) + absolute(ey);
    const auto edge = less(tolerance, length);  // equal corners have none
    // Inside where e x (p - a) is not negative.
    const T start = fma(ex, from.y - a.y, -(ey * (from.x - a.x))), slope = fma(ex, dy, -(ey * dx));
    const auto flat = ~less(T(S(1e-7)) * length * (absolute(dx) + absolute(dy)), absolute(slope));
    const T at = -start / select(flat, T(1), slope);
    const auto enters = edge & ~flat & less(T(0), slope), leaves = edge & ~flat & less(slope, T(0));
    part.low = select(enters, larger(part.low, at), part.low);
    part.high = select(leaves, smaller(part.high, at), part.high);
    part.valid = part.valid & ~(edge & flat & less(start, -tolerance * length));
  }
  part.valid = part.valid & ~less(part.high, part.low);
  return part;
}

template <class T>
LOCKSTEP_INLINE typename T::Mask contains(const SeenFace<T>& polygon, T turns, T x, T y, T tolerance) {
  auto inside = ~T::none();
  for (int i = 0; i < polygon.corners; ++i) {
    const Vec3<T>&a = polygon.corner[i], &b = polygon.corner[i + 1 < polygon.corners ? i + 1 : 0];
    const T ex = (b.x - a.x) * turns, ey = (b.y - a.y) * turns;
    inside = inside & ~less(fma(ex, y - a.y, -(ey * (x - a.x))), -tolerance * (absolute(ex) + absolute(ey)));
  }
  return inside;
}

/// Twice the area, with its sign.
template <class T>
LOCKSTEP_INLINE T area_of(const SeenFace<T>& polygon) {
  T area = T(0);
  const Vec3<T>& o = polygon.corner[0];
  for (int i = 1; i + 1 < polygon.corners; ++i) {
    const Vec3<T>&a = polygon.corner[i], &b = polygon.corner[i + 1];
    area += fma(a.x - o.x, b.y - o.y, -((a.y - o.y) * (b.x - o.x)));
  }
  return area;
}

/// z of the face's plane at x and y; of a face that stands upright, of its first corner.
template <class T>
struct Plane {
  T x, y, z, slope_x, slope_y;
  typename T::Mask leans;  // too much: it has no height

  explicit Plane(const SeenFace<T>& face) {
    using S = ScalarOf<T>;
    x = face.corner[0].x, y = face.corner[0].y, z = face.corner[0].z;
    leans = less(absolute(face.normal.z), T(S(0.3)));  // or a tolerance beside the face would be a height
    const T inverse = T(1) / select(leans, T(1), face.normal.z);
    slope_x = -face.normal.x * inverse, slope_y = -face.normal.y * inverse;
  }
  LOCKSTEP_INLINE T height(T at_x, T at_y) const { return fma(slope_x, at_x - x, fma(slope_y, at_y - y, z)); }
};

/// Points where two faces lie on each other: the edges of each within the other, and where one is deepest.
template <class T>
void find_shared(const SeenFace<T>& first, const SeenFace<T>& second, T size, SharedPoints<T>& found) {
  using S = ScalarOf<T>;
  const T tolerance = T(S(1e-6)) * size;
  const T area = area_of(first), other_area = area_of(second), least = T(S(1e-6)) * size * size;
  const auto is_polygon = less(least, absolute(area)), is_other_polygon = less(least, absolute(other_area));
  const T turns = sign_of(area), other_turns = sign_of(other_area);
  const Plane<T> plane(first), other_plane(second);

  // Edges of the second within the first: their heights are exact, those of the first by its plane.
  for (int i = 0; i < second.corners; ++i) {
    const Vec3<T>&from = second.corner[i], &to = second.corner[i + 1 < second.corners ? i + 1 : 0];
    const Part<T> part = clip(from, to, first, turns, tolerance);
    for (int end = 0; end < 2; ++end) {
      const Vec3<T> at = fma(to - from, end == 0 ? part.low : part.high, from);
      found.add(at.x, at.y, at.z - plane.height(at.x, at.y), part.valid & is_polygon & ~plane.leans);
    }
  }

  // Corners of the first within the second; where the first is a line, its part within the second.
  for (int i = 0; i < first.corners; ++i) {
    const Vec3<T>& at = first.corner[i];
    found.add(
        at.x, at.y, other_plane.height(at.x, at.y) - at.z,
        contains(second, other_turns, at.x, at.y, tolerance) & is_polygon & is_other_polygon & ~other_plane.leans);
  }
  const Vec3<T>&from = first.corner[0], &to = first.corner[first.corners / 2];
  const Part<T> part = clip(from, to, second, other_turns, tolerance);
  for (int end = 0; end < 2; ++end) {
    const Vec3<T> at = fma(to - from, end == 0 ? part.low : part.high, from);
    found.add(at.x, at.y, other_plane.height(at.x, at.y) - at.z,
              part.valid & ~is_polygon & is_other_polygon & ~other_plane.leans);
  }
}

/// Slots in the frame of the contact; z is the gap.
template <class T>
struct FlatSlots {
  T x[4], y[4], z[4];
  typename T::Mask valid[4], replaced[4];

  FlatSlots() {
    for (int slot = 0; slot < 4; ++slot) {
      x[slot] = y[slot] = z[slot] = T(0);
      valid[slot] = replaced[slot] = T::none();
    }
  }
};

/// Two shapes whose faces, or face and line, look at each other in the lanes that are `flat`.
template <class T>
struct FlatPair {
  SeenFace<T> own, other;
  typename T::Mask flat, of_other;  // the second has the reference face
  T radii, margin, tolerance;
};

/// A capsule: the ends of what lies above the first's face, each in its own slot. The lower one is as deep as the
/// nearest points, `nearest` apart, where a steep capsule has its end a little beside the face.
template <class T>
void find_ends(const FlatPair<T>& pair, T nearest, FlatSlots<T>& slots) {
  const Vec3<T>&from = pair.other.corner[0], &to = pair.other.corner[1];
  const Part<T> part = clip(from, to, pair.own, sign_of(area_of(pair.own)), pair.tolerance);
  const Plane<T> plane(pair.own);
  for (int slot = 0; slot < 2; ++slot) {
    const Vec3<T> at = fma(to - from, slot == 0 ? part.low : part.high, from);
    slots.x[slot] = at.x, slots.y[slot] = at.y, slots.z[slot] = at.z - plane.height(at.x, at.y) - pair.radii;
  }
  const auto lower = less(slots.z[0], slots.z[1]);
  for (int slot = 0; slot < 2; ++slot) {
    const T least = smaller(slots.z[slot], nearest - pair.radii);
    slots.z[slot] = select(slot == 0 ? lower : ~lower, least, slots.z[slot]);
    slots.valid[slot] = pair.flat & part.valid & less(slots.z[slot], pair.margin);
  }
}

/// Up to four points that the faces share. `deep` is the deepest point of the shape that is not the reference, at the
/// separation `depth`. Where it is not above the reference face, the nearest points count, `nearest` apart: a
/// cylinder's cap is larger than its octagon.
template <class T>
void find_points(const FlatPair<T>& pair, const Vec3<T>& deep, T depth, T nearest, T size, T slack,
                 FlatSlots<T>& slots) {
  SharedPoints<T> shared;
  find_shared(pair.own, pair.other, size, shared);
  const auto over = [&](const SeenFace<T>& face) LOCKSTEP_INLINED {
    return contains(face, sign_of(area_of(face)), deep.x, deep.y, pair.tolerance);
  };
  const auto above = (pair.of_other & over(pair.other)) | (~pair.of_other & over(pair.own));
  shared.add(select(above, deep.x, T(0)), select(above, deep.y, T(0)), select(above, depth, nearest), ~T::none());
  for (int i = 0; i < shared.count; ++i) {
    shared.z[i] = shared.z[i] - pair.radii;
    shared.valid[i] = shared.valid[i] & pair.flat & less(shared.z[i], pair.margin);
  }
  choose_slots(shared, shared.count, T(ScalarOf<T>(0.1)) * slack, slack, slots.x, slots.y, slots.z, slots.valid,
               slots.replaced);
}

/// Of the lanes `near`; others have no slots. `kept` are the lanes whose memory is of the step before. A face decides
/// the normal where that is nearly its own, so resting normals have no noise; the first one's where both are. Else the
/// nearest points touch alone, in slot 0.
template <class T>
void touch_convex(const Core<T>& first, const Core<T>& second, const PlacedShape<T>& a, const PlacedShape<T>& b,
                  const TouchingPair<ScalarOf<T>>& numbers, T margin, typename T::Mask near, typename T::Mask kept,
                  ConvexMemory<T>& memory, Patch<T>& patch) {
  using S = ScalarOf<T>;
  constexpr S of_second = 1, replacing = 500, single = 999;
  const T size = T(numbers.size), radius = radius_of(first), other_radius = radius_of(second);

  // How far they are apart.
  CorePair<T> pair{first, second, {}, multiply_transposed(a.rotation, b.center - a.center), size};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) pair.turn(i, j) = dot(a.axis(i), b.axis(j));
  Nearest<T> found{memory.normal, T(S(1e30)), Vec3<T>::zero(), memory.corners};
  separate(pair, T(numbers.apart), margin + radius + other_radius, near, kept, found);
  memory.normal = select<T>(near, found.normal, Vec3<T>::zero());
  memory.corners = select<T>(near, found.corners, Vec3<T>::zero());

  // The faces that look at each other, and whether one of them is the reference.
  FlatPair<T> faces{{}, {}, T::none(), T::none(), radius + other_radius, margin, T(S(1e-6)) * size};
  Face<T> face, other_face;
  face.number = other_face.number = T(0);
  Vec3<T> n = found.normal;
  if ((has_faces(first) || has_faces(second)) && has_extent(first) && has_extent(second)) {
    face_of(first, n, face);
    face_of(second, scaled(multiply_transposed(pair.turn, n), T(S(-1))), other_face);
    const Vec3<T> against = scaled(multiply(pair.turn, other_face.normal), T(S(-1)));
    const T cosine = has_faces(first) ? dot(n, face.normal) : T(S(-1)),
            other_cosine = has_faces(second) ? dot(n, against) : T(S(-1));
    faces.of_other = less(cosine + T(S(1e-6)), other_cosine);
    faces.flat = near & less(T(S(flat_cosine)), larger(cosine, other_cosine));
    n = select<T>(faces.flat, select<T>(faces.of_other, against, face.normal), n);
  }
  patch.normal = multiply(a.rotation, n);
  tangents_along(a, patch);

  // What they share.
  FlatSlots<T> slots;
  T reference = T(0);  // height of the reference face's surface over the nearest point of the first core
  if (any(faces.flat)) {
    const Vec3<T> t = multiply_transposed(a.rotation, patch.tangent),
                  u = multiply_transposed(a.rotation, patch.other_tangent);
    const auto turned = [&](const Vec3<T>& v) LOCKSTEP_INLINED { return Vec3<T>{dot(t, v), dot(u, v), dot(n, v)}; };
    const auto seen = [&](const Vec3<T>& p) LOCKSTEP_INLINED { return turned(p - found.on_first); };
    faces.own.corners = face.corners, faces.own.normal = turned(face.normal);
    faces.other.corners = other_face.corners, faces.other.normal = turned(multiply(pair.turn, other_face.normal));
    for (int i = 0; i < face.corners; ++i) faces.own.corner[i] = seen(face.corner[i]);
    for (int i = 0; i < other_face.corners; ++i)
      faces.other.corner[i] = seen(multiply_add(pair.turn, other_face.corner[i], pair.place));
    const DifferencePoint<T> deepest = least_difference(pair, n);
    const T depth = dot(deepest.at, n);
    found.separation = select(faces.flat, larger(found.separation, depth), found.separation);
    if (second.kind == ShapeKind::capsule) {
      find_ends(faces, found.separation, slots);
    } else {
      find_points(faces, seen(select<T>(faces.of_other, deepest.on_first, deepest.on_first + deepest.at)), depth,
                  found.separation, size, T(numbers.slack), slots);
    }
    reference = select(faces.of_other, faces.other.corner[0].z - other_radius, faces.own.corner[0].z + radius);
  }

  // Points are half way between the surfaces.
  const T gap = found.separation - radius - other_radius;
  auto alone = near;
  for (int slot = 0; slot < 4; ++slot) alone = alone & ~slots.valid[slot];
  const Vec3<T> start = multiply_add(a.rotation, found.on_first, a.center);
  const T code = select(faces.of_other, fma(T(S(2)), other_face.number, T(of_second)), T(S(2)) * face.number);
  for (int slot = 0; slot < 4; ++slot) {
    const T half = T(S(0.5)) * slots.z[slot];
    patch.gap[slot] = slots.z[slot];
    patch.point[slot] = fma(patch.tangent, slots.x[slot],
                            fma(patch.other_tangent, slots.y[slot],
                                fma(patch.normal, reference + select(faces.of_other, -half, half), start)));
    patch.face[slot] = select(slots.replaced[slot], T(replacing + S(slot)), code);
    patch.valid[slot] = slots.valid[slot];
  }
  patch.gap[0] = select(alone, gap, patch.gap[0]);
  patch.point[0] = select<T>(alone, fma(patch.normal, fma(T(S(0.5)), gap, radius), start), patch.point[0]);
  patch.face[0] = select(alone, T(single), patch.face[0]);
  patch.valid[0] = patch.valid[0] | alone;
}

}  // namespace lockstep::kernels
