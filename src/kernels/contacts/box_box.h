// Two boxes: four slots, the corners of what one face covers of another. SPDX-License-Identifier: Apache-2.0
//
// The separating axis with the least overlap is a face of either box or a pair of edges (Gottschalk 1996). Of a face:
// its own corners, and the edges of the face opposite clipped by it, are twelve candidates; each slot takes the one
// that is farthest along its diagonal of the face. The deepest candidate is always among the slots, up to rounding. A
// pair of edges touches in one point: (M110). Boxes that are apart may have no candidate: their nearest points then are
// the one slot (M156).
#pragma once

#include "gjk.h"
#include "slots.h"

namespace lockstep::kernels {

/// The axis that separates most, or overlaps least.
template <class T>
struct SeparatingAxis {
  T separation;
  T number;        // 0 to 2: faces of the first box, 3 to 5: of the second, 6 + 3 i + j: edges i and j
  Vec3<T> normal;  // in the first box's frame, from the first to the second
};

/// Faces win over later ones, and over edges, by a little: rounding must not choose.
template <class T>
SeparatingAxis<T> separating_axis(const PlacedShape<T>& first, const PlacedShape<T>& second, const Mat3<T>& turn,
                                  const Vec3<T>& between) {
  using S = ScalarOf<T>;
  const T *const a = first.size, *const b = second.size;
  const T least_a = smaller(a[0], smaller(a[1], a[2])), least_b = smaller(b[0], smaller(b[1], b[2]));
  const T hysteresis = T(S(1e-3)) * smaller(least_a, least_b),
          of_edges = smaller(T(S(1e-3)) * (least_a + least_b), T(S(10)) * hysteresis);
  SeparatingAxis<T> best{T(S(-1e30)), T(0), Vec3<T>::zero()};
  const auto take = [&](T separation, T ahead, int number, const Vec3<T>& n, typename T::Mask may) LOCKSTEP_INLINED {
    const auto wins = may & less(best.separation + ahead, separation);
    best.separation = select(wins, separation, best.separation);
    best.number = select(wins, T(S(number)), best.number);
    best.normal = select<T>(wins, n, best.normal);
  };

  // Faces of the first box.
  for (int i = 0; i < 3; ++i) {
    T reach = a[i];
    for (int j = 0; j < 3; ++j) reach = fma(b[j], absolute(turn(i, j)), reach);
    Vec3<T> n = Vec3<T>::zero();
    n[i] = sign_of(between[i]);
    take(absolute(between[i]) - reach, i == 0 ? T(0) : hysteresis, i, n, ~T::none());
  }

  // Faces of the second box.
  for (int j = 0; j < 3; ++j) {
    const Vec3<T> axis{turn(0, j), turn(1, j), turn(2, j)};
    const T along = dot(between, axis);
    T reach = b[j];
    for (int i = 0; i < 3; ++i) reach = fma(a[i], absolute(turn(i, j)), reach);
    take(absolute(along) - reach, hysteresis, 3 + j, scaled(axis, sign_of(along)), ~T::none());
  }

  // Pairs of edges, but for those that are nearly parallel.
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      const T squared = fma(turn(i1, j), turn(i1, j), turn(i2, j) * turn(i2, j));
      const auto crossed = less(T(S(1e-4)), squared);
      const T inverse = T(1) / sqrt(select(crossed, squared, T(1)));
      Vec3<T> n = Vec3<T>::zero();
      n[i1] = -turn(i2, j) * inverse, n[i2] = turn(i1, j) * inverse;
      const T along = fma(between[i1], n[i1], between[i2] * n[i2]);
      const T reach = inverse * (fma(a[i1], absolute(turn(i2, j)), a[i2] * absolute(turn(i1, j))) +
                                 fma(b[j1], absolute(turn(i, j2)), b[j2] * absolute(turn(i, j1))));
      take(absolute(along) - reach, of_edges, 6 + 3 * i + j, scaled(n, sign_of(along)), crossed);
    }
  return best;
}

/// One box seen from the frame of a face: x and y in the face, z outwards.
template <class T>
struct FaceOpposite {
  Vec3<T> middle, edge, other_edge;  // the face that looks most against it, and half its edges
};

/// A point that may become a slot.
template <class T>
struct Candidates {
  static constexpr int count = 12;
  T x[count], y[count], z[count];
  typename T::Mask valid[count];
};

/// The ends of the four edges of `face` within |x| <= u, |y| <= v, then the corners of that rectangle that it covers.
template <class T>
void find_candidates(const FaceOpposite<T>& face, T u, T v, T margin, Candidates<T>& found) {
  using S = ScalarOf<T>;
  const T tolerance = T(S(1e-6)) * (u + v), zero = T(0), one = T(1);

  // The ends of each edge, clipped to the rectangle.
  for (int e = 0; e < 4; ++e) {
    const bool along_first = e % 2 == 0;
    const Vec3<T> way = along_first ? face.edge : face.other_edge, side = along_first ? face.other_edge : face.edge;
    const Vec3<T> middle = fma(side, T(S(e < 2 ? 1 : -1)), face.middle);
    T low = -one, high = one;
    typename T::Mask crosses = ~T::none();
    const auto clip = [&](T center, T step, T half) LOCKSTEP_INLINED {
      const auto flat = less(absolute(step), T(S(1e-7)) * half);
      const T inverse = one / select(flat, one, step);
      const T a = (-half - center) * inverse, b = (half - center) * inverse;
      low = select(flat, low, larger(low, smaller(a, b)));
      high = select(flat, high, smaller(high, larger(a, b)));
      crosses = crosses & (~flat | less(absolute(center), half + tolerance));
    };
    clip(middle.x, way.x, u);
    clip(middle.y, way.y, v);
    crosses = crosses & ~less(high, low);
    for (int end = 0; end < 2; ++end) {
      const int c = 2 * e + end;
      const T t = end == 0 ? low : high;
      found.x[c] = fma(way.x, t, middle.x), found.y[c] = fma(way.y, t, middle.y), found.z[c] = fma(way.z, t, middle.z);
      found.valid[c] = crosses & less(found.z[c], margin);
    }
  }

  // The corners of the rectangle, as shares p and q of the face's half edges.
  const T area = face.edge.x * face.other_edge.y - face.edge.y * face.other_edge.x;
  const auto flat = less(absolute(area), T(S(1e-12)));
  const T inverse = one / select(flat, one, area);
  // How far p and q may exceed 1 by rounding. A corner that both faces share would be lost if each found it outside.
  const auto reach = [&](const Vec3<T>& edge) LOCKSTEP_INLINED {
    return fma(tolerance * absolute(inverse), absolute(edge.x) + absolute(edge.y), one);
  };
  const T most_p = reach(face.other_edge), most_q = reach(face.edge);
  for (int corner = 0; corner < 4; ++corner) {
    const int c = 8 + corner;
    const T x = corner % 2 == 0 ? -u : u, y = corner < 2 ? -v : v;
    const T dx = x - face.middle.x, dy = y - face.middle.y;
    const T p = (dx * face.other_edge.y - dy * face.other_edge.x) * inverse,
            q = (face.edge.x * dy - face.edge.y * dx) * inverse;
    found.x[c] = x, found.y[c] = y;
    found.z[c] = fma(p, face.edge.z, fma(q, face.other_edge.z, face.middle.z));
    found.valid[c] = ~flat & ~less(most_p, absolute(p)) & ~less(most_q, absolute(q)) & less(found.z[c], margin);
    found.z[c] = select(flat, zero, found.z[c]);
  }
}

/// Where two edges are nearest. `axis` is the direction of the first one, n the normal.
template <class T>
void touch_edges(const PlacedShape<T>& first, const PlacedShape<T>& second, const Mat3<T>& turn, const Vec3<T>& between,
                 const SeparatingAxis<T>& found, Vec3<T>& point, Vec3<T>& axis) {
  using S = ScalarOf<T>;
  const Vec3<T> n = found.normal;
  Vec3<T> a = Vec3<T>::zero(), b = between, e = Vec3<T>::zero(), f = Vec3<T>::zero();
  T half = T(0), other_half = T(0);

  // The middles a, b of the two edges, their directions e, f and half lengths: the edges that face each other.
  for (int i = 0; i < 3; ++i) {
    typename T::Mask own = T::none(), other = T::none();
    for (int j = 0; j < 3; ++j) {
      const T one = T(S(6 + 3 * i + j)), two = T(S(6 + 3 * j + i));
      own = own | ~(less(found.number, one) | less(one, found.number));
      other = other | ~(less(found.number, two) | less(two, found.number));
    }
    const Vec3<T> axis_b{turn(0, i), turn(1, i), turn(2, i)};
    a[i] = select(own, T(0), sign_of(n[i]) * first.size[i]);
    e[i] = select(own, T(1), T(0));
    half = select(own, first.size[i], half);
    b = fma(axis_b, select(other, T(0), -sign_of(dot(n, axis_b)) * second.size[i]), b);
    f = select<T>(other, axis_b, f);
    other_half = select(other, second.size[i], other_half);
  }

  // The nearest points of two segments, and the middle between them.
  const Vec3<T> d = b - a;
  const T c = dot(e, f), along = dot(e, d), other_along = dot(f, d);
  const T sine = larger(fnma(c, c, T(1)), T(S(1e-6)));
  const T s = within(fnma(c, other_along, along) / sine, half);
  const T t = within(fma(c, s, -other_along), other_half);
  const Vec3<T> on_a = fma(e, s, a), on_b = fma(f, t, b);
  point = scaled(on_a + on_b, T(S(0.5)));
  axis = e;
}

/// The nearest points, into slot 0, in the lanes `lost`.
template <class T>
void touch_nearest(const PlacedShape<T>& first, const PlacedShape<T>& second, const Mat3<T>& turn,
                   const Vec3<T>& between, const TouchingPair<ScalarOf<T>>& numbers, T margin, typename T::Mask lost,
                   Patch<T>& patch) {
  using S = ScalarOf<T>;
  constexpr S number = 998;  // no face has it
  const HullTable<S> none{};
  const auto core = [&](const PlacedShape<T>& box) LOCKSTEP_INLINED {
    return Core<T>{ShapeKind::box, {box.size[0], box.size[1], box.size[2]}, &none, nullptr};
  };
  const CorePair<T> pair{core(first), core(second), turn, between, T(numbers.size)};
  Nearest<T> found{Vec3<T>::zero(), T(S(1e30)), Vec3<T>::zero(), Vec3<T>::zero()};
  separate(pair, T(numbers.apart), margin, lost, T::none(), found);
  Patch<T> own;
  own.normal = multiply(first.rotation, found.normal);
  tangents_along(first, own);
  patch.normal = select<T>(lost, own.normal, patch.normal);
  patch.tangent = select<T>(lost, own.tangent, patch.tangent);
  patch.other_tangent = select<T>(lost, own.other_tangent, patch.other_tangent);
  const Vec3<T> at =
      fma(own.normal, T(S(0.5)) * found.separation, multiply_add(first.rotation, found.on_first, first.center));
  patch.point[0] = select<T>(lost, at, patch.point[0]);
  patch.gap[0] = select(lost, found.separation, patch.gap[0]);
  patch.face[0] = select(lost, T(number), patch.face[0]);
  patch.valid[0] = patch.valid[0] | lost;
}

/// Of the lanes `near`.
template <class T>
void box_box(const PlacedShape<T>& first, const PlacedShape<T>& second, const TouchingPair<ScalarOf<T>>& numbers,
             typename T::Mask near, T margin, Patch<T>& patch) {
  using S = ScalarOf<T>;

  // What separates: a face of either box, or a pair of edges.
  const Vec3<T> between = multiply_transposed(first.rotation, second.center - first.center);
  Mat3<T> turn;  // the second's axes in the first's frame, as columns
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) turn(i, j) = dot(first.axis(i), second.axis(j));
  const SeparatingAxis<T> found = separating_axis(first, second, turn, between);
  const auto edges = less(T(S(5.5)), found.number);
  const auto of_second = less(T(S(2.5)), found.number) & ~edges;

  // The box of the reference face and the other one, in the world's axes, from the first's centre.
  const Vec3<T> apart = second.center - first.center;
  Vec3<T> own[3], other[3];
  T own_size[3], other_size[3];
  for (int k = 0; k < 3; ++k) {
    own[k] = select<T>(of_second, second.axis(k), first.axis(k));
    other[k] = select<T>(of_second, first.axis(k), second.axis(k));
    own_size[k] = select(of_second, second.size[k], first.size[k]);
    other_size[k] = select(of_second, first.size[k], second.size[k]);
  }
  const Vec3<T> way = select<T>(of_second, scaled(apart, T(-1)), apart);  // to the other box

  // The frame of the reference face: n outwards, ex and ey along its edges, u and v half of these.
  const T number = found.number - select(of_second, T(3), T(0));
  const auto is_first = less(number, T(S(0.5))), is_last = less(T(S(1.5)), number);
  const auto turned = [&](const auto& a, const auto& b, const auto& c) LOCKSTEP_INLINED {
    if constexpr (sizeof(a) == sizeof(T))
      return select(is_first, a, select(is_last, c, b));
    else
      return select<T>(is_first, a, select<T>(is_last, c, b));
  };
  Vec3<T> n = turned(own[0], own[1], own[2]);
  const T side = sign_of(dot(n, way)), reach = turned(own_size[0], own_size[1], own_size[2]);
  n = scaled(n, side);
  const Vec3<T> ex = turned(own[1], own[2], own[0]), ey = turned(own[2], own[0], own[1]);
  const T u = turned(own_size[1], own_size[2], own_size[0]), v = turned(own_size[2], own_size[0], own_size[1]);

  // The other box's face that looks most against it.
  T most = T(-1), against = T(0);
  for (int k = 0; k < 3; ++k) {
    const T along = absolute(dot(n, other[k]));
    const auto more = less(most, along);
    most = select(more, along, most), against = select(more, T(S(k)), against);
  }
  const auto zeroth = less(against, T(S(0.5))), second_axis = less(T(S(1.5)), against);
  const auto chosen = [&](const Vec3<T>& a, const Vec3<T>& b, const Vec3<T>& c)
                          LOCKSTEP_INLINED { return select<T>(zeroth, a, select<T>(second_axis, c, b)); };
  Vec3<T> edge[3];
  for (int k = 0; k < 3; ++k) edge[k] = scaled(other[k], other_size[k]);
  const Vec3<T> outwards = chosen(edge[0], edge[1], edge[2]);
  const Vec3<T> middle = fma(outwards, -sign_of(dot(n, outwards)), way);

  // That face from the frame of the reference face, and the slots.
  const auto seen = [&](const Vec3<T>& p) LOCKSTEP_INLINED { return Vec3<T>{dot(ex, p), dot(ey, p), dot(n, p)}; };
  FaceOpposite<T> face{seen(middle), seen(chosen(edge[1], edge[2], edge[0])), seen(chosen(edge[2], edge[0], edge[1]))};
  face.middle.z = face.middle.z - reach;
  Candidates<T> candidates;
  find_candidates(face, u, v, margin, candidates);
  T x[4], y[4], z[4];
  typename T::Mask valid[4], replaced[4];
  choose_slots(candidates, Candidates<T>::count, T(S(1e-5)) * (u + v), T(S(1e-6)) * (u + v), x, y, z, valid, replaced);

  // A pair of edges touches in slot 0 alone. Each lane takes the normal and the tangents of its own case.
  Vec3<T> crossing, axis;
  touch_edges(first, second, turn, between, found, crossing, axis);
  const T flip = select(of_second, T(-1), T(1));
  const Vec3<T> edge_normal = multiply(first.rotation, found.normal), edge_tangent = multiply(first.rotation, axis);
  patch.normal = select<T>(edges, edge_normal, scaled(n, flip));
  // x, y and the flipped normal are left-handed where the side is negative or the reference is the second box.
  patch.tangent = select<T>(edges, edge_tangent, ex);
  patch.other_tangent = cross(patch.normal, patch.tangent);

  // Points are half way between the faces. patch.face names what separates, and slots that the deepest point took.
  const Vec3<T> from = select<T>(of_second, second.center, first.center);
  const T code = fma(T(S(2)), found.number, select(less(side, T(0)), T(1), T(0)));
  for (int slot = 0; slot < 4; ++slot) {
    const T height = fma(T(S(0.5)), z[slot], reach);
    const Vec3<T> on_face = fma(ex, x[slot], fma(ey, y[slot], fma(n, height, from)));
    const Vec3<T> at =
        slot == 0 ? select<T>(edges, multiply_add(first.rotation, crossing, first.center), on_face) : on_face;
    patch.point[slot] = at;
    patch.gap[slot] = slot == 0 ? select(edges, found.separation, z[slot]) : z[slot];
    patch.face[slot] = code + select(replaced[slot], T(100), T(0));
    patch.valid[slot] = slot == 0 ? edges | valid[slot] : valid[slot] & ~edges;
  }
  const auto lost =
      near & ~(patch.valid[0] | patch.valid[1] | patch.valid[2] | patch.valid[3]) & less(found.separation, margin);
  if (any(lost)) touch_nearest(first, second, turn, between, numbers, margin, lost, patch);
}

}  // namespace lockstep::kernels
