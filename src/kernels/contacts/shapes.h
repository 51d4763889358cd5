// Shapes where they are, and the patch in which two of them touch. SPDX-License-Identifier: Apache-2.0
//
// Section 23. A function for each pair of shapes writes a Patch. It has no branch that depends on a lane. A slot keeps
// its meaning from step to step: the same corner of the same face, or the same end of a capsule.
#pragma once

#include "kernels/couplings/joint_terms.h"

namespace lockstep::kernels {

/// Where two shapes touch. The frame is right-handed; its normal points from the first shape to the second.
template <class T>
struct Patch {
  static constexpr int most = 4;
  Vec3<T> normal, tangent, other_tangent;
  Vec3<T> point[most];           // in the middle of the gap
  T gap[most];                   // negative where the shapes overlap
  T face[most];                  // a slot with another number than in the step before is another point
  typename T::Mask valid[most];  // lanes in which the slot holds a point
};

/// -1 or 1; 1 for 0.
template <class T>
LOCKSTEP_INLINE T sign_of(T a) {
  return select(less(a, T(0)), T(-1), T(1));
}

template <class T>
LOCKSTEP_INLINE Vec3<T> select(typename T::Mask m, const Vec3<T>& yes, const Vec3<T>& no) {
  return {select(m, yes.x, no.x), select(m, yes.y, no.y), select(m, yes.z, no.z)};
}

/// a clamped to [-most, most].
template <class T>
LOCKSTEP_INLINE T within(T a, T most) {
  return select(less(a, -most), -most, select(less(most, a), most, a));
}

/// Tangents along the shape's own axis that is most across the normal. Returns that axis, which the faces' numbers
/// need. A later axis wins only by more than rounding: on a face of a box, two axes are across the normal alike.
template <class T>
LOCKSTEP_INLINE T tangents_along(const PlacedShape<T>& shape, Patch<T>& patch) {
  const Vec3<T> n = patch.normal;
  Vec3<T> best = shape.axis(0);
  T least = absolute(dot(n, best)), number = T(0);
  for (int k = 1; k < 3; ++k) {
    const Vec3<T> e = shape.axis(k);
    const T along = absolute(dot(n, e));
    const auto less_along = less(along + T(ScalarOf<T>(1e-3)), least);
    best = select<T>(less_along, e, best);
    least = select(less_along, along, least);
    number = select(less_along, T(ScalarOf<T>(k)), number);
  }
  const Vec3<T> across = fma(n, -dot(n, best), best);
  patch.tangent = scaled(across, T(1) / sqrt(dot(across, across)));
  patch.other_tangent = cross(n, patch.tangent);
  return number;
}

/// The axes of a half-space as the frame of its contacts.
template <class T>
LOCKSTEP_INLINE void frame_of_plane(const PlacedShape<T>& plane, Patch<T>& patch) {
  patch.normal = plane.axis(2);
  patch.tangent = plane.axis(0);
  patch.other_tangent = plane.axis(1);
}

/// Two round shapes, by the centres at which they are nearest: the normal, tangents along the first shape's axes, and
/// slot 0. Where the centres coincide the normal is `fallback`.
template <class T>
LOCKSTEP_INLINE void touch_round(const PlacedShape<T>& first, Vec3<T> a, T radius_a, Vec3<T> b, T radius_b,
                                 Vec3<T> fallback, Patch<T>& patch) {
  const Vec3<T> d = b - a;
  const T squared = dot(d, d), distance = sqrt(squared);
  const auto apart = less(T(ScalarOf<T>(1e-18)), squared);
  patch.normal = select<T>(apart, scaled(d, T(1) / select(apart, distance, T(1))), fallback);
  patch.gap[0] = select(apart, distance, T(0)) - (radius_a + radius_b);
  patch.point[0] = fma(patch.normal, fma(T(ScalarOf<T>(0.5)), patch.gap[0], radius_a), a);
  patch.face[0] = tangents_along(first, patch);
  patch.valid[0] = ~T::none();
}

}  // namespace lockstep::kernels
