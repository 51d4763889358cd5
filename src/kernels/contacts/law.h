// The law of contact: compliance, targets, the exact friction cone with memory. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "assembly.h"

namespace lockstep::kernels {

constexpr double push_out = 3.0;        // (M104), m/s: the largest speed at which an overlap is removed
constexpr double fastest_return = 0.1;  // (M111), m/s: of what has drifted
constexpr double least_bounce = 0.05;   // m/s: slower impacts do not bounce
constexpr double relaxed_above = 0.01;  // m/s: overlaps that are removed faster leave no speed behind (M109)

/// From the second collider's centre to the slot, in the frame of the contact.
template <class T>
LOCKSTEP_INLINE Vec3<T> from_center(const ContactPatch<T>& patch, const ContactSlot<T>& slot) {
  const Vec3<T> apart = patch.point - patch.center;
  return slot.arm + Vec3<T>{dot(patch.axes[0], apart), dot(patch.axes[1], apart), dot(patch.axes[2], apart)};
}

/// How far the pair's points answer a unit impulse if each velocity answers by itself: the sum over its columns of
/// |J|^2 / A_kk, for (M104). With J = m + w x r it is a quadratic function of the arm r.
template <class T>
struct PairResponse {
  T constant = T(0);                   // of |m|^2
  Vec3<T> linear = Vec3<T>::zero();    // of m x w
  Vec3<T> squares = Vec3<T>::zero();   // of |w|^2 - w w^T: the diagonal
  Vec3<T> products = Vec3<T>::zero();  // its yz, zx, xy

  PairResponse(const Tables<ScalarOf<T>>& t, const TouchingPair<ScalarOf<T>>& pair, const Tile<T>& x) {
    for (int k = pair.column; k < pair.column + pair.columns; ++k) {
      const T mobility = T(1) / x.held.matrix[t.solver.offset[t.contacts.columns[k].velocity]];
      const Vec3<T>& m = x.contacts.moving[k];
      constant = fma(mobility, dot(m, m), constant);
      if (pair.slots == 1) continue;
      const Vec3<T>&w = x.contacts.turning[k], scaled_w = scaled(w, mobility);
      linear = cross_add(m, scaled_w, linear);
      for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3, l = (i + 2) % 3;
        squares[i] = fma(scaled_w[j], w[j], fma(scaled_w[l], w[l], squares[i]));
        products[i] = fnma(scaled_w[j], w[l], products[i]);
      }
    }
  }
  LOCKSTEP_INLINE T at(const Vec3<T>& r) const {
    const T two = T(2);
    T sum = fma(two, dot(linear, r), constant);
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, l = (i + 2) % 3;
      sum = fma(r[i] * r[i], squares[i], fma(two * (r[j] * r[l]), products[i], sum));
    }
    return sum;
  }
};

/// (M104), (M109), (M111): compliance and target of the slot's normal, drift along its tangents. `start` is
/// the pair's twist at the start of the step; slot.speed is that without contacts, if the pair bounces. What bounces
/// within the step is thrown back over what it would go too far, at the speed that it arrives with: that of the end of
/// the free step, which keeps energies, unless forces change it by much.
template <class T>
void begin_slot(const Tables<ScalarOf<T>>& t, const TouchingPair<ScalarOf<T>>& pair, const ContactPatch<T>& patch,
                const RelativeTwist<T>& start, const PairResponse<T>& response, ContactSlot<T>& slot) {
  using S = ScalarOf<T>;
  const T zero = T(0);
  const T compliance = fma(T(pair.cfm_per_response / S(3)), response.at(slot.arm), T(pair.cfm));
  slot.stiffness = select(slot.live, T(1) / select(slot.live, compliance, T(1)), zero);
  const T overlap = larger(T(pair.rate) * slot.gap, T(S(-push_out)));
  slot.bias = select(less(zero, slot.gap), slot.gap * T(S(1) / t.dt), overlap);
  T u[3];
  slot_speed(slot, start, u);
  slot.bounces = T::none();
  if (pair.restitution > S(0)) {
    slot.bounces = slot.live & less(fma(T(t.dt), u[0], slot.gap), zero) & less(u[0], T(S(-least_bounce)));
    const T arrival = u[0] + within(slot.speed[0] - u[0], T(S(0.25)) * absolute(u[0]));
    const T reached = larger(slot.gap, zero) * T(S(1) / t.dt);
    slot.rebound = T(pair.restitution) * arrival;
    slot.bias = select(slot.bounces, fma(T(pair.restitution), smaller(arrival + reached, zero), reached), slot.bias);
  }
  slot.slip = patch.friction * sqrt(fma(u[1], u[1], u[2] * u[2]));
  slot.target = slot.bias + slot.slip;
  slot.push = zero;
  slot.relaxes = T::none();
  const Vec3<T> drift = cross_add(patch.drift_turning, from_center(patch, slot), patch.drift_moving);
  for (int i = 0; i < 2; ++i)
    slot.drift[i] = select(slot.goes_on, within(drift[i + 1] * T(S(1) / t.dt), T(S(fastest_return))), zero);
}

/// (M105), (M106): impulse and its derivative at the speed u. The projection on the friction cone of the impulse that
/// the compliance asks for: it sticks, slides or is off.
template <class T>
LOCKSTEP_INLINE void contact_force(const ContactSlot<T>& slot, T friction, const T (&u)[3], ContactForce<T>& force) {
  using S = ScalarOf<T>;
  const T zero = T(0), one = T(1), k = slot.stiffness;
  const T normal = fnma(u[0] + slot.target, k, slot.push);
  const T t1 = fnma(u[1] + slot.drift[0], k, slot.carried[0]), t2 = fnma(u[2] + slot.drift[1], k, slot.carried[1]);
  const T length = sqrt(fma(t1, t1, t2 * t2)), inverse = one / larger(length, T(S(1e-30)));
  const T reached = fma(friction, length, normal), share = one / fma(friction, friction, one);
  force.sticks = less(length, friction * normal) & slot.live;
  force.slides = less(zero, reached) & ~force.sticks & slot.live;
  const T sliding = reached * share;
  force.impulse[0] = select(force.sticks, normal, select(force.slides, sliding, zero));
  const T f = select(force.sticks, one, select(force.slides, friction * sliding * inverse, zero));
  force.impulse[1] = f * t1, force.impulse[2] = f * t2;
  const T across = select(force.slides, k * friction * share * inverse, zero);
  const T along = select(force.slides, k * (fma(friction, friction * share, -f)) * inverse * inverse, zero);
  force.gain[0] = k * select(force.sticks, one, select(force.slides, share, zero));
  force.gain[1] = across * t1, force.gain[2] = across * t2;
  force.gain[3] = fma(along * t1, t1, k * f);
  force.gain[4] = along * t1 * t2;
  force.gain[5] = fma(along * t2, t2, k * f);
}

/// G u
template <class T>
LOCKSTEP_INLINE void times_gain(const ContactForce<T>& force, const T (&u)[3], T (&product)[3]) {
  const T* const g = force.gain;
  product[0] = fma(g[0], u[0], fma(g[1], u[1], g[2] * u[2]));
  product[1] = fma(g[1], u[0], fma(g[3], u[1], g[4] * u[2]));
  product[2] = fma(g[2], u[0], fma(g[4], u[1], g[5] * u[2]));
}

}  // namespace lockstep::kernels
