// The rows of loops: what they miss, J, and the acceleration that J has of its own. SPDX-License-Identifier: Apache-2.0
//
// Section 30: (M130) and (M132).
#pragma once

#include "kernels/dynamics/motion.h"
#include "kernels/dynamics/relative_columns.h"

namespace lockstep::kernels {

/// A frame in the world.
template <class T>
struct WorldFrame {
  Mat3<T> rotation;
  Vec3<T> origin;
};

template <class T>
LOCKSTEP_INLINE WorldFrame<T> in_world(const Motion<T>& m, int body, const Mat3<T>& rotation, const Vec3<T>& offset) {
  if (body < 0) return {rotation, offset};
  return {product(m.world[body], rotation), multiply_add(m.world[body], offset, m.place[body])};
}

/// The first frame, which Parameter::loop_frame may give.
template <class T>
WorldFrame<T> first_frame(const StatePointers<ScalarOf<T>>& batch, const HeldLoop<ScalarOf<T>>& loop, int l,
                          const Motion<T>& m) {
  const ScalarOf<T>* const own = batch.field(Parameter::loop_frame);
  if (!own)
    return in_world(m, loop.first, Mat3<T>::constant(loop.first_rotation), Vec3<T>::constant(loop.first_offset));
  T number[7];
  for (int k = 0; k < 7; ++k) number[k] = T::load(own + (7 * l + k) * batch.stride);
  T squared = T(0);
  for (int k = 3; k < 7; ++k) squared = fma(number[k], number[k], squared);
  const T inverse = T(1) / sqrt(squared);
  for (int k = 3; k < 7; ++k) number[k] *= inverse;
  const Mat3<T> link = Mat3<T>::constant(loop.link_rotation),
                pose = product(rotation_of_quaternion(number + 3), Mat3<T>::constant(loop.turn));
  const Vec3<T> offset = multiply_add(link, {number[0], number[1], number[2]}, Vec3<T>::constant(loop.link_offset));
  return in_world(m, loop.first, product(link, pose), offset);
}

/// 2 sin(angle / 2) along the axis of the turn from the first frame to the second, in the first frame's axes. Of a
/// hinge, it is the shortest turn between the z axes.
template <class T>
LOCKSTEP_INLINE Vec3<T> turn_between(LoopKind kind, const Mat3<T>& first, const Mat3<T>& second) {
  using S = ScalarOf<T>;
  const T least = T(S(1e-12));
  const auto turn = [&](int r, int c) LOCKSTEP_INLINED { return dot(column_of(first, r), column_of(second, c)); };
  if (kind == LoopKind::hinge) {
    const T scale = sqrt(T(2) / larger(T(1) + turn(2, 2), least));
    return {-turn(1, 2) * scale, turn(0, 2) * scale, T(0)};
  }
  const T trace = turn(0, 0) + turn(1, 1) + turn(2, 2), scale = T(1) / sqrt(larger(T(1) + trace, least));
  return {(turn(2, 1) - turn(1, 2)) * scale, (turn(0, 2) - turn(2, 0)) * scale, (turn(1, 0) - turn(0, 1)) * scale};
}

/// (M130): C of all loops, where the bodies are by `m`.
template <class T>
void loop_gaps(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Motion<T>& m, Tile<T>& x) {
  for (int l = 0; l < t.loops.loops.count; ++l) {
    const HeldLoop<ScalarOf<T>>& loop = t.loops.loops[l];
    LoopFrames<T>& frames = x.loops.frames[l];
    const WorldFrame<T> first = first_frame(batch, loop, l, m),
                        second = in_world(m, loop.second, Mat3<T>::constant(loop.second_rotation),
                                          Vec3<T>::constant(loop.second_offset));
    const Vec3<T> between = second.origin - first.origin;
    T* const gap = x.loops.gap + loop.row;
    for (int i = 0; i < 3; ++i) frames.axes[i] = column_of(first.rotation, i);
    for (int i = 0; i < loop.translations; ++i) gap[i] = dot(frames.axes[i], between);
    if (loop.rotations > 0) {
      const Vec3<T> turn = turn_between(loop.kind, first.rotation, second.rotation);
      for (int i = 0; i < loop.rotations; ++i) gap[loop.translations + i] = turn[i];
    }
    frames.point = second.origin;
    frames.size = absolute(first.origin[0]) + absolute(first.origin[1]) + absolute(first.origin[2]) + T(1);
  }
}

/// J at these frames, by row and velocity of the solver.
template <class T>
void loop_columns(const Tables<ScalarOf<T>>& t, const Motion<T>& m, Tile<T>& x) {
  for (int l = 0; l < t.loops.loops.count; ++l) {
    const HeldLoop<ScalarOf<T>>& loop = t.loops.loops[l];
    const LoopFrames<T>& frames = x.loops.frames[l];
    for (int k = 0; k < loop.columns; ++k) {
      const PairColumn& column = t.loops.columns[loop.column + k];
      Vec3<T> turning = Vec3<T>::zero(), moving = turning;
      for (int p = column.first; p < column.last; ++p) {
        const ColumnPart& part = t.loops.parts[p];
        const PartAxis<T> own = axis_of_part(t, part, m, x);
        if (own.slides) {
          moving = moving + own.axis;
        } else {
          turning = turning + own.axis;
          moving = cross_add(own.axis, frames.point - m.place[part.body], moving);
        }
      }
      x.loops.turned[loop.column + k] = dot(turning, turning);
      x.loops.moved[loop.column + k] = dot(moving, moving);
      T* value = x.loops.value + loop.value + k;
      for (int i = 0; i < loop.translations; ++i, value += loop.columns) *value = dot(frames.axes[i], moving);
      for (int i = 0; i < loop.rotations; ++i, value += loop.columns) *value = dot(frames.axes[i], turning);
    }
  }
}

/// Of a joint, while no velocity of the solver changes: that of a follower that is a function, (M139).
template <class T>
LOCKSTEP_INLINE T own_acceleration(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int joint) {
  const int f = t.reduction.follower_of[joint];
  return f < 0 ? T(0) : x.functions.acceleration[f] * T(t.body[t.joint_body[joint]].sign);
}

/// How the bodies accelerate in the world if no velocity of the solver changes.
template <class T>
void accelerations(const Tables<ScalarOf<T>>& t, const Motion<T>& m, Tile<T>& x) {
  const Vec3<T> zero = Vec3<T>::zero();
  if (t.functions.used()) curved_accelerations(t, x);
  for (int i = 0; i < t.loops.bodies.count; ++i) {
    const int b = t.loops.bodies[i];
    const Body<ScalarOf<T>>& body = t.body[b];
    if (body.root)  // its twist is constant in the world
      x.loops.turning[b] = x.loops.moving[b] = zero;
    else if (t.functions.used())
      accelerate_body(t, m, x, b, scaled(column_of(m.world[b], body.axis), own_acceleration(t, x, body.joint)),
                      x.loops.turning, x.loops.moving);
    else
      accelerate_body(t, m, x, b, zero, x.loops.turning, x.loops.moving);
  }
}

/// How a point of a body moves, and the body.
template <class T>
struct PointMotion {
  Vec3<T> angular, linear, turning, moving;  // velocities and accelerations in the world
};

template <class T>
LOCKSTEP_INLINE PointMotion<T> motion_at(const Motion<T>& m, const Tile<T>& x, int body, const Vec3<T>& point) {
  const Vec3<T> zero = Vec3<T>::zero();
  if (body < 0) return {zero, zero, zero, zero};
  const Vec3<T> arm = point - m.place[body], angular = multiply(m.world[body], m.angular[body]),
                turning = x.loops.turning[body], carried = cross(angular, arm);
  return {angular, multiply_add(m.world[body], m.linear[body], carried), turning,
          cross_add(turning, arm, cross_add(angular, carried, x.loops.moving[body]))};
}

/// (M132): J' v at x.state.v, in these lanes.
template <class T>
void loop_bias(const Tables<ScalarOf<T>>& t, const Motion<T>& m, typename T::Mask lanes, Tile<T>& x) {
  accelerations(t, m, x);
  for (int l = 0; l < t.loops.loops.count; ++l) {
    const HeldLoop<ScalarOf<T>>& loop = t.loops.loops[l];
    const LoopFrames<T>& frames = x.loops.frames[l];
    const PointMotion<T> first = motion_at(m, x, loop.first, frames.point),
                         second = motion_at(m, x, loop.second, frames.point);
    const Vec3<T> moves = second.linear - first.linear, carried = cross(first.angular, moves);
    const Vec3<T> moving = fma(carried, T(-2), second.moving - first.moving),
                  turning = (second.turning - first.turning) - cross(first.angular, second.angular);
    T* bias = x.loops.bias + loop.row;
    for (int i = 0; i < loop.translations; ++i, ++bias) *bias = select(lanes, dot(frames.axes[i], moving), *bias);
    for (int i = 0; i < loop.rotations; ++i, ++bias) *bias = select(lanes, dot(frames.axes[i], turning), *bias);
  }
}

/// All rows at x.state. Needs kinematics().
template <class T>
void find_loops(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  move_bodies(t, x, x.loops.motion);
  loop_gaps(t, batch, x.loops.motion, x);
  loop_columns(t, x.loops.motion, x);
  loop_bias(t, x.loops.motion, ~T::none(), x);
}

}  // namespace lockstep::kernels
