// A box and a capsule: one slot, or two where the capsule lies on a face. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "shapes.h"

namespace lockstep::kernels {

/// In the box's frame the capsule's axis is c + t a. Its squared distance from the box is convex in t, and its
/// derivative g(t) = a . (p - clamped p) is piecewise linear, with breaks where p crosses a plane of a face. So the
/// nearest point lies between the last break with g <= 0 and the first with g >= 0, where g is linear. Breaks with g =
/// 0 bound a part that is nearest everywhere, above a face or inside; its middle is taken. An axis that passes through
/// the box leaves it through the face that takes least. On a face, or nearly so, the slots are the ends of the part
/// above that face.
template <class T>
void box_capsule(const PlacedShape<T>& box, const PlacedShape<T>& capsule, T, Patch<T>& patch) {
  using S = ScalarOf<T>;
  const Vec3<T> c = multiply_transposed(box.rotation, capsule.center - box.center),
                a = multiply_transposed(box.rotation, capsule.axis(2));
  const T half = capsule.size[1], radius = capsule.size[0];

  // From the box to the axis at t.
  const auto away = [&](T t) LOCKSTEP_INLINED {
    Vec3<T> d;
    for (int k = 0; k < 3; ++k) {
      const T p = fma(a[k], t, c[k]);
      d[k] = p - within(p, box.size[k]);
    }
    return d;
  };

  // The last break with g <= 0 and the first with g >= 0, and the zero of g between them.
  T low = -half, high = half, slope_low = dot(a, away(low)), slope_high = dot(a, away(high));
  const T start = slope_low, end = slope_high;
  for (int k = 0; k < 3; ++k)
    for (int side = -1; side <= 1; side += 2) {
      const auto flat = less(absolute(a[k]), T(S(1e-9)));
      const T t = within((fma(T(S(side)), box.size[k], -c[k])) / select(flat, T(1), a[k]), half);
      const T slope = dot(a, away(t));
      const auto before = ~less(T(0), slope) & less(low, t), after = ~less(slope, T(0)) & less(t, high);
      low = select(before, t, low), slope_low = select(before, slope, slope_low);
      high = select(after, t, high), slope_high = select(after, slope, slope_high);
    }
  const T width = slope_high - slope_low;
  const auto rises = less(T(0), width);
  T nearest = fma(high - low, select(rises, -slope_low / select(rises, width, T(1)), T(S(0.5))), low);
  nearest = select(less(T(0), start), -half, select(less(end, T(0)), half, nearest));

  // How far the nearest point is from the box: 0 if it is inside.
  const Vec3<T> d = away(nearest);
  const T squared = dot(d, d), distance = sqrt(squared);
  const auto outside = less(T(S(1e-18)), squared);

  // The face that the whole axis leaves with least: its separation (M110).
  Vec3<T> out = Vec3<T>::zero();
  T depth = T(S(-1e30)), face = T(0);
  for (int k = 0; k < 3; ++k) {
    const T side = sign_of(c[k]);
    const T beyond_face = absolute(c[k]) - fma(half, absolute(a[k]), box.size[k]);
    const auto nearer = less(depth, beyond_face);
    for (int l = 0; l < 3; ++l) out[l] = select(nearer, l == k ? side : T(0), out[l]);
    face = select(nearer, T(S(2 * k)) + select(less(side, T(0)), T(1), T(0)), face);
    depth = select(nearer, beyond_face, depth);
  }

  // The normal: to the nearest point, or that of a face if the point is inside or on the face.
  const Vec3<T> direct = scaled(d, T(1) / select(outside, distance, T(1)));
  for (int k = 0; k < 3; ++k) {  // a nearest point above a face, up to rounding, is on that face
    const auto on_face = outside & less(T(S(0.999999)), absolute(direct[k]));
    for (int l = 0; l < 3; ++l) out[l] = select(on_face, l == k ? sign_of(direct[k]) : T(0), out[l]);
    face = select(on_face, T(S(2 * k)) + select(less(direct[k], T(0)), T(1), T(0)), face);
  }
  const auto lies =
      ~outside | less(T(S(0.999999)), larger(larger(absolute(direct.x), absolute(direct.y)), absolute(direct.z)));
  const Vec3<T> n = select<T>(lies, out, direct);
  patch.normal = multiply(box.rotation, n);
  const T axis = tangents_along(box, patch);

  // The part of the axis above the face.
  T from = -half, to = half;
  for (int k = 0; k < 3; ++k) {
    const auto across = less(absolute(n[k]), T(S(0.5))), flat = less(absolute(a[k]), T(S(1e-9)));
    const T inverse = T(1) / select(flat, T(1), a[k]);
    const T one = (-box.size[k] - c[k]) * inverse, other = (box.size[k] - c[k]) * inverse;
    from = select(across & ~flat, larger(from, smaller(one, other)), from);
    to = select(across & ~flat, smaller(to, larger(one, other)), to);
  }

  // The slots: the ends of that part, or the nearest point alone.
  const auto above = lies & less(from, to);
  from = smaller(from, nearest), to = larger(to, nearest);
  for (int slot = 0; slot < 2; ++slot) {
    const T t = select(above, slot == 0 ? from : to, nearest);
    Vec3<T> p;
    T height = T(0);
    for (int k = 0; k < 3; ++k) {
      p[k] = fma(a[k], t, c[k]);
      height = fma(n[k], p[k], height);
      height = fnma(absolute(n[k]), select(lies, box.size[k], T(0)), height);
    }
    patch.gap[slot] = select(lies, height, distance) - radius;
    const Vec3<T> at = fma(n, -fma(T(S(0.5)), patch.gap[slot], radius), p);
    patch.point[slot] = multiply_add(box.rotation, at, box.center);
    patch.face[slot] = select(lies, face + T(S(3)), axis);
  }
  patch.valid[0] = ~T::none();
  patch.valid[1] = above;
}

}  // namespace lockstep::kernels
