// Spatial tendons: how long they are, and S there. SPDX-License-Identifier: Apache-2.0
//
// Section 43. A segment's direction turns with its ends, so each integrator asks for S wherever it computes the mass
// matrix.
#pragma once

#include "kernels/dynamics/motion.h"
#include "kernels/dynamics/relative_columns.h"

namespace lockstep::kernels {

constexpr double least_segment = 1e-12;  ///< m, of one with a direction
constexpr double most_corrected = 0.1;   ///< rad, of joints that correct a length in one step

/// A segment in the world.
template <class T>
struct SegmentLine {
  Vec3<T> along;   // unit, or 0 where the ends meet
  Vec3<T> apart;   // velocity of the second end against the first one
  Vec3<T> second;  // where it ends
  T length, inverse;
};

/// A point of a body, or of the world, and its velocity there.
template <class T>
LOCKSTEP_INLINE void point_of_body(const Motion<T>& m, int body, const Vec3<T>& own, Vec3<T>& place,
                                   Vec3<T>& velocity) {
  place = own, velocity = Vec3<T>::zero();
  if (body < 0) return;
  place = multiply_add(m.world[body], own, m.place[body]);
  velocity = multiply(m.world[body], cross_add(m.angular[body], own, m.linear[body]));
}

template <class T>
LOCKSTEP_INLINE SegmentLine<T> line_of(const Segment<ScalarOf<T>>& segment, const Motion<T>& m) {
  using S = ScalarOf<T>;
  SegmentLine<T> line;
  Vec3<T> first, velocity;
  point_of_body(m, segment.first_body, Vec3<T>::constant(segment.first_point), first, velocity);
  point_of_body(m, segment.second_body, Vec3<T>::constant(segment.second_point), line.second, line.apart);
  line.apart = line.apart - velocity;
  const Vec3<T> between = line.second - first;
  line.length = sqrt(dot(between, between));
  const auto has_direction = less(T(S(least_segment)), line.length);
  line.inverse = select(has_direction, T(1) / select(has_direction, line.length, T(1)), T(0));
  line.along = scaled(between, line.inverse);
  return line;
}

/// (M178): lengths and their rates, with the bodies as they move by `m`.
template <class T>
void spatial_lengths(const Tables<ScalarOf<T>>& t, const Motion<T>& m, State<T>& state) {
  for (int i = 0; i < t.spatial.tendons.count; ++i) {
    const SpatialTendon& tendon = t.spatial.tendons[i];
    T length = T(0), rate = T(0);
    for (int s = tendon.first; s < tendon.last; ++s) {
      const Segment<ScalarOf<T>>& segment = t.spatial.segments[s];
      const SegmentLine<T> line = line_of(segment, m);
      length = fma(T(segment.share), line.length, length);
      rate = fma(T(segment.share), dot(line.along, line.apart), rate);
    }
    state.q[tendon.joint] = length;
    state.v[t.velocity_of(tendon.joint)] = rate;
  }
}

/// Puts spatial tendons where the bodies of `state` have them.
template <class T>
void place_spatial_tendons(const Tables<ScalarOf<T>>& t, Tile<T>& x, State<T>& state) {
  const State<T> own = x.state;
  x.state = state;
  motions(t, x, x.spatial.motion);
  x.state = own;
  spatial_lengths(t, x.spatial.motion, state);
}

/// (M181): whether the step would move tendon i in this way.
template <class T>
LOCKSTEP_INLINE typename T::Mask leaps(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int i) {
  const int j = t.spatial.tendons[i].joint, k = t.velocity_of(j);
  const T before = x.state.q[j], after = x.next.q[j];
  const T speed = larger(absolute(x.state.v[k]), absolute(x.next.v[k]));
  return less(T(ScalarOf<T>(0.5)) * larger(before, after), fnma(T(t.step), speed, absolute(after - before)));
}

/// (M180), for tendon i with its row of S.
template <class T>
LOCKSTEP_INLINE T reach_of_correction(const Tables<ScalarOf<T>>& t, const SpatialTendon& tendon, const Tile<T>& x) {
  using S = ScalarOf<T>;
  const Reduction<S>& r = t.reduction;
  const T length = larger(x.state.q[tendon.joint], T(S(least_segment)));
  T squares = T(0), most = T(0);
  for (int k = r.start[tendon.follower]; k < r.start[tendon.follower + 1]; ++k)
    squares = fma(x.couplings.share[k], x.couplings.share[k], squares);
  for (int s = tendon.first; s < tendon.last; ++s)
    for (int c = t.spatial.segments[s].first_column; c < t.spatial.segments[s].last_column; ++c) {
      const SegmentColumn& column = t.spatial.columns[c];
      const T share = absolute(x.couplings.share[column.share]);
      most = larger(most, slides(t, t.spatial.parts[column.first]) ? share / length : share);
    }
  const auto moves = less(T(0), most);
  return select(moves, T(S(most_corrected)) * squares / select(moves, most, T(1)), T(0));
}

/// (M179) and (M180): their rows of S at x.state, where this puts them, too. Needs kinematics(), and S of all other
/// followers.
template <class T>
void spatial_shares(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Reduction<ScalarOf<T>>& r = t.reduction;
  const Motion<T>& m = x.spatial.motion;
  move_bodies(t, x, x.spatial.motion);
  spatial_lengths(t, m, x.state);
  for (int i = 0; i < t.spatial.tendons.count; ++i) {
    const SpatialTendon& tendon = t.spatial.tendons[i];
    for (int k = r.start[tendon.follower]; k < r.start[tendon.follower + 1]; ++k) x.couplings.share[k] = T(0);
    for (int s = tendon.first; s < tendon.last; ++s) {
      const Segment<ScalarOf<T>>& segment = t.spatial.segments[s];
      const SegmentLine<T> line = line_of(segment, m);
      const Vec3<T> along = scaled(line.along, T(segment.share));
      for (int c = segment.first_column; c < segment.last_column; ++c) {
        const SegmentColumn& column = t.spatial.columns[c];
        Vec3<T> moving = Vec3<T>::zero();
        for (int p = column.first; p < column.last; ++p) {
          const ColumnPart& part = t.spatial.parts[p];
          const PartAxis<T> own = axis_of_part(t, part, m, x);
          // A turn of the first body about its end moves the second one along nothing.
          moving = own.slides ? moving + own.axis : cross_add(own.axis, line.second - m.place[part.body], moving);
        }
        x.couplings.share[column.share] += dot(along, moving);
      }
    }
    x.spatial.reach[i] = reach_of_correction(t, tendon, x);
  }
}

}  // namespace lockstep::kernels
