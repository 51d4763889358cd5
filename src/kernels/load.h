// First stage: the tile's state out of the batch's rows. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "frame.h"
#include "gear_ratios.h"
#include "in_place.h"
#include "lay_out.h"

namespace lockstep::kernels {

/// Masses per environment: a body is the sum of its links, each by the kilogram.
template <class T>
void own_masses(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  for (int b = 0; b < t.bodies; ++b) x.inertia[b] = {T(0), Vec3<T>::zero(), {T(0), T(0), T(0), T(0), T(0), T(0)}};
  for (int l = 0; l < t.links; ++l) {
    const LinkPlace<ScalarOf<T>>& place = t.link[l];
    if (place.body < 0) continue;
    const T mass = T::load(lanes.field[5] + l * lanes.stride);
    PseudoInertia<T>& sum = x.inertia[place.body];
    sum.mass += mass;
    for (int k = 0; k < 3; ++k) sum.moment[k] = fma(mass, T(place.unit_moment[k]), sum.moment[k]);
    for (int k = 0; k < 6; ++k) sum.second[k] = fma(mass, T(place.unit_second[k]), sum.second[k]);
  }
}

/// (M10) What lies on revolute joints' axes moves inwards: mass m, first moment h and second moment z along the axis e
/// at the origin r.
template <class T>
void move_masses_inwards(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int b = 0; b < t.bodies; ++b) x.felt[b] = x.inertia[b];
  for (int b = t.bodies - 1; b >= 0; --b) {
    const Body<ScalarOf<T>>& body = t.body[b];
    if (body.root || body.prismatic) continue;
    PseudoInertia<T>& felt = x.felt[b];
    const int k = body.axis;
    const T mass = felt.mass, h = felt.moment[k], z = felt.second[k];
    felt.mass = felt.moment[k] = felt.second[k] = T(0);
    if (body.parent < 0) continue;
    PseudoInertia<T>& parent = x.felt[body.parent];
    const Vec3<T> r = Vec3<T>::constant(body.offset), e = Vec3<T>::constant(body.rotation + 3 * k);
    parent.mass += mass;
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, l = (i + 2) % 3;
      parent.moment[i] += fma(mass, r[i], h * e[i]);
      parent.second[i] += fma(fma(mass, r[i], (h + h) * e[i]), r[i], z * e[i] * e[i]);
      parent.second[3 + i] += fma(fma(mass, r[j], h * e[j]), r[l], fma(h, r[j], z * e[j]) * e[l]);
    }
  }
}

template <class T>
LOCKSTEP_INLINE void load(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x, const Outline& o) {
  T *const q = x.q, *const v = o.floating ? x.v + 6 : x.v;
  for (int j = 0; j < o.joints; ++j) {
    const std::ptrdiff_t row = o.joint_row[j] * lanes.stride;
    q[j] = T::load(lanes.position + row);
    v[j] = T::load(lanes.velocity + row);
    // The next tile's as well: these are more rows than a processor sees coming by itself. (Where two tiles are stepped in
    // turn the second one's come too late, in a step so long that it does not matter.)
    __builtin_prefetch(lanes.position + row + T::lanes);
    __builtin_prefetch(lanes.velocity + row + T::lanes);
    __builtin_prefetch(lanes.effort + row + T::lanes);
  }
  for (int i = 0; o.floating && i < 7; ++i) x.root_pose[i] = T::load(lanes.root_pose + i * lanes.stride);
  for (int i = 0; o.floating && i < 6; ++i) x.v[i] = T::load(lanes.root_velocity + i * lanes.stride);
  x.frozen = T::none();
  std::uint32_t faults = 0;
  for (int i = 0; i < T::lanes; ++i) faults |= static_cast<std::uint32_t>(lanes.fault[i]);
  for (int i = 0; faults != 0 && i < T::lanes; ++i) x.frozen.set_lane(i, lanes.fault[i] != Fault{});

  for (int k = 0; o.record_diagnostics && k < 4; ++k) x.energy[k] = T(0);
  const auto own = [&](int parameter) { return ((o.per_environment >> parameter) & 1u) != 0; };
  if (own(0)) own_ratios(t, lanes, x);
  for (int c = 0; own(1) && c < t.couplings; ++c) x.offset[c] = T::load(lanes.field[1] + c * lanes.stride);
  if (own(5)) {
    own_masses(t, lanes, x);
    move_masses_inwards(t, x);
  }
  settle(t, x, all_in_place(t, x, o));
}

template <class T>
void load(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  load(t, lanes, x, outline(t));
}

}  // namespace lockstep::kernels
