// How far two convex shapes are apart, or how deep they overlap. SPDX-License-Identifier: Apache-2.0
//
// The algorithm of Gilbert, Johnson and Keerthi (1988) finds the nearest points of shapes that are apart. The second
// one is moved out along the normal of the step before until it is, and the way is given back (M156). So there is no
// second algorithm for overlaps, and the separation is exact along the normal that is returned.
#pragma once

#include "support.h"

namespace lockstep::kernels {

/// Two cores, seen from the first one's frame.
template <class T>
struct CorePair {
  Core<T> first, second;
  Mat3<T> turn;   // the second's axes, as columns
  Vec3<T> place;  // of its origin
  T size;         // of both together, for tolerances
};

/// The normal points from the first to the second, and has length 1. Corners of the simplex are 256 b + a, by pair.
template <class T>
struct Nearest {
  Vec3<T> normal;
  T separation;
  Vec3<T> on_first;  // the point of the first core that is nearest
  Vec3<T> corners;
};

/// A point of the second core less one of the first.
template <class T>
struct DifferencePoint {
  Vec3<T> at, on_first;
  T corners;
};

template <class T>
LOCKSTEP_INLINE DifferencePoint<T> select(typename T::Mask m, const DifferencePoint<T>& yes,
                                          const DifferencePoint<T>& no) {
  return {select<T>(m, yes.at, no.at), select<T>(m, yes.on_first, no.on_first), select(m, yes.corners, no.corners)};
}

/// The difference that is least along d: the second core's point farthest against d, less the first's along it.
template <class T>
DifferencePoint<T> least_difference(const CorePair<T>& pair, const Vec3<T>& d) {
  using S = ScalarOf<T>;
  const SupportPoint<T> a = support(pair.first, d);
  const SupportPoint<T> b = support(pair.second, scaled(multiply_transposed(pair.turn, d), T(S(-1))));
  return {multiply_add(pair.turn, b.point, pair.place) - a.point, a.point, fma(b.number, T(S(256)), a.number)};
}

template <class T>
DifferencePoint<T> difference_of(const CorePair<T>& pair, T corners) {
  using S = ScalarOf<T>;
  const T number = truncated(corners * T(S(1.0 / 256.0)));
  const Vec3<T> a = corner_of(pair.first, fnma(number, T(S(256)), corners)), b = corner_of(pair.second, number);
  return {multiply_add(pair.turn, b, pair.place) - a, a, corners};
}

/// Up to three points of the difference, and the point of their hull that is nearest to the origin.
template <class T>
struct Simplex {
  DifferencePoint<T> point[3];  // copies where there are fewer
  T share[3];
  Vec3<T> nearest;
  T squared;
};

/// The nearest point of w with one or two of p, as a simplex whose first point is w. Faces that are nearly flat are
/// left out: their edges are taken.
template <class T>
Simplex<T> nearest_with(const DifferencePoint<T>& w, const DifferencePoint<T> (&p)[3]) {
  using S = ScalarOf<T>;
  const T zero = T(0), one = T(1);
  Simplex<T> best{{w, w, w}, {one, zero, zero}, w.at, dot(w.at, w.at)};
  T first = T(S(-1)), second = first;  // which of p it takes
  Vec3<T> edge[3];
  T squared[3];
  const auto take = [&](const Vec3<T>& at, typename T::Mask may, int i, int j, T s, T t) LOCKSTEP_INLINED {
    const T distance = dot(at, at);
    const auto nearer = may & less(distance, best.squared);
    best.nearest = select<T>(nearer, at, best.nearest);
    best.squared = select(nearer, distance, best.squared);
    best.share[1] = select(nearer, s, best.share[1]), best.share[2] = select(nearer, t, best.share[2]);
    first = select(nearer, T(S(i)), first), second = select(nearer, T(S(j)), second);
  };
  for (int i = 0; i < 3; ++i) {
    edge[i] = p[i].at - w.at;
    squared[i] = dot(edge[i], edge[i]);
    const auto has_length = less(zero, squared[i]);
    const T t = select(has_length, -dot(w.at, edge[i]) / select(has_length, squared[i], one), zero);
    const T inside = smaller(larger(t, zero), one);
    take(fma(edge[i], inside, w.at), has_length, i, i, inside, zero);
  }
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3;
    const Vec3<T> n = cross(edge[i], edge[j]);
    const T area = dot(n, n);
    const auto wide = less(T(S(1e-10)) * squared[i] * squared[j], area);
    const T inverse = one / select(wide, area, one);
    const T s = dot(cross(edge[j], w.at), n) * inverse, t = dot(cross(w.at, edge[i]), n) * inverse;
    const auto inside = wide & less(zero, s) & less(zero, t) & less(s + t, one);
    take(scaled(n, dot(w.at, n) * inverse), inside, i, j, s, t);
  }
  for (int i = 0; i < 3; ++i) {
    const auto is = [&](T number)
                        LOCKSTEP_INLINED { return less(T(S(i - 0.5)), number) & less(number, T(S(i + 0.5))); };
    best.point[1] = select<T>(is(first), p[i], best.point[1]);
    best.point[2] = select<T>(is(second), p[i], best.point[2]);
  }
  best.share[0] = one - best.share[1] - best.share[2];
  return best;
}

template <class T>
LOCKSTEP_INLINE Simplex<T> select(typename T::Mask m, const Simplex<T>& yes, const Simplex<T>& no) {
  Simplex<T> chosen;
  for (int i = 0; i < 3; ++i) {
    chosen.point[i] = select<T>(m, yes.point[i], no.point[i]);
    chosen.share[i] = select(m, yes.share[i], no.share[i]);
  }
  chosen.nearest = select<T>(m, yes.nearest, no.nearest);
  chosen.squared = select(m, yes.squared, no.squared);
  return chosen;
}

/// Of cores that are apart, in the lanes `open`; others keep what `found` has. Begins at the corners that `found` has,
/// or, of cores without, along its normal. A lane whose cores are more than `most` apart stops when it knows that.
template <class T>
void nearest_apart(const CorePair<T>& pair, T most, typename T::Mask open, Nearest<T>& found) {
  using S = ScalarOf<T>;
  constexpr int most_rounds = 32, most_restarts = 2;
  Simplex<T> simplex;
  if (has_corners(pair.first) && has_corners(pair.second)) {
    DifferencePoint<T> start[3];
    for (int i = 0; i < 3; ++i) start[i] = difference_of(pair, found.corners[i]);
    simplex = nearest_with(start[0], start);
  } else {
    const DifferencePoint<T> start = least_difference(pair, found.normal);
    simplex = {{start, start, start}, {T(1), T(0), T(0)}, start.at, dot(start.at, start.at)};
  }

  found.separation = select(open, T(S(-1e30)), found.separation);
  T restarts = T(0);
  for (int round = 0; round < most_rounds && any(open); ++round) {
    // What the direction of the nearest point so far separates. The best direction is the result.
    const T length = sqrt(simplex.squared);
    const auto has_length = less(T(0), length);
    const T inverse = T(1) / select(has_length, length, T(1));
    const DifferencePoint<T> w = least_difference(pair, simplex.nearest);
    const T separation = dot(simplex.nearest, w.at) * inverse;
    const auto better = open & has_length & less(found.separation, separation);
    found.separation = select(better, separation, found.separation);
    found.normal = select<T>(better, scaled(simplex.nearest, inverse), found.normal);
    Vec3<T> on_first = Vec3<T>::zero();
    for (int i = 0; i < 3; ++i) on_first = fma(simplex.point[i].on_first, simplex.share[i], on_first);
    found.on_first = select<T>(better, on_first, found.on_first);
    for (int i = 0; i < 3; ++i) found.corners[i] = select(better, simplex.point[i].corners, found.corners[i]);

    const T tolerance =
        fma(T(S(sizeof(S) == 4 ? 1e-5 : 1e-11)), length, T(S(sizeof(S) == 4 ? 4e-7 : 1e-14)) * pair.size);
    open = open & less(tolerance, length - found.separation) & ~less(most, found.separation);
    if (!any(open)) break;

    // Where rounding stops the fall, begin anew with the latest point.
    const Simplex<T> next = nearest_with(w, simplex.point);
    const auto falls = less(next.squared, simplex.squared);
    const auto again = open & ~falls;
    const Simplex<T> alone{{w, w, w}, {T(1), T(0), T(0)}, w.at, dot(w.at, w.at)};
    restarts = select(again, restarts + T(1), restarts);
    open = open & less(restarts, T(S(most_restarts + 0.5)));
    simplex = select<T>(open & falls, next, select<T>(open, alone, simplex));
  }
}

/// (M156) of cores that may overlap. `normal` and `corners` of `found` are those of the step before in the lanes that
/// are `kept`; others begin along the line of the origins. Needs origins inside the cores.
template <class T>
void separate(const CorePair<T>& pair, T apart, T most, typename T::Mask lanes, typename T::Mask kept,
              Nearest<T>& found) {
  using S = ScalarOf<T>;
  constexpr int most_passes = 8;
  constexpr S deep = 10, turned = S(0.8);  // of `apart`; the cosine of a turn that one step does not make
  const T length = sqrt(dot(pair.place, pair.place));
  const auto has_length = less(T(0), length);
  const Vec3<T> between =
      select<T>(has_length, scaled(pair.place, T(1) / select(has_length, length, T(1))), Vec3<T>{T(0), T(0), T(1)});
  found.normal = select<T>(kept, found.normal, between);
  T along = dot(found.normal, least_difference(pair, found.normal).at);

  // After a jump, the normal of the step before may be that of another side.
  const auto may_be_lost = lanes & kept & less(along, T(-deep) * apart);
  if (any(may_be_lost)) {
    const T other = dot(between, least_difference(pair, between).at);
    const auto is_lost = may_be_lost & less(along, other);
    kept = kept & ~is_lost;
    found.normal = select<T>(is_lost, between, found.normal);
    along = select(is_lost, other, along);
  }
  for (int i = 0; i < 3; ++i) found.corners[i] = select(kept, found.corners[i], T(0));

  auto open = lanes;
  for (int pass = 0; pass < most_passes && any(open); ++pass) {
    const Vec3<T> out = found.normal;
    const T way = larger(T(0), apart - along);
    CorePair<T> moved = pair;
    moved.place = fma(out, way, pair.place);
    Nearest<T> now = found;
    nearest_apart(moved, most, open, now);
    now.separation = fnma(way, dot(out, now.normal), now.separation);
    found.normal = select<T>(open, now.normal, found.normal);
    found.separation = select(open, now.separation, found.separation);
    found.on_first = select<T>(open, now.on_first, found.on_first);
    for (int i = 0; i < 3; ++i) found.corners[i] = select(open, now.corners[i], found.corners[i]);
    open = open & less(T(0), way) & ~(kept & less(T(turned), dot(out, now.normal)));
    if (any(open)) along = dot(found.normal, least_difference(pair, found.normal).at);
  }
}

}  // namespace lockstep::kernels
