// The law of contact: compliance, targets, the exact friction cone with memory. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "assembly.h"

namespace lockstep::kernels {

constexpr double push_out = 3.0;                    // (M104), m/s: the largest speed at which an overlap is removed
constexpr double least_response = 0.01;             // (M104): of a soft normal, in the mean of its three rows
constexpr double fastest_return = 0.1;              // (M111), m/s: of what has drifted
constexpr double least_bounce = 0.05;               // (M109), m/s: slower impacts do not bounce
constexpr double bounce_compliance = 1e-3;          // (M109), of the response: what bounces yields no more than this
constexpr double bounce_compliance_in_step = 1e-5;  // (M124)
constexpr double most_restored = 1.5;               // (M109)
constexpr double turning_compliance = 1e-3;         // (M172), of the response: of what resists turning, at most
constexpr double relaxed_above = 0.01;  // (M109), m/s: overlaps that are removed faster leave no speed behind
constexpr double carried_above = 0.01;  // (M116): of that speed, what carried impulses may leave

/// From the second collider's centre to the slot, in the frame of the contact.
template <class T>
LOCKSTEP_INLINE Vec3<T> from_center(const ContactPatch<T>& patch, const ContactSlot<T>& slot) {
  const Vec3<T> apart = patch.point - patch.center;
  return slot.arm + Vec3<T>{dot(patch.axes[0], apart), dot(patch.axes[1], apart), dot(patch.axes[2], apart)};
}

/// How far the pair's points answer a unit impulse if each velocity answers by itself, for (M104): the sum over its
/// columns of |J|^2 / A_kk, and the part of it along the normal. With J = m + w x r both are quadratic functions of the
/// arm r.
template <class T>
struct PairResponse {
  T constant = T(0);                   // of |m|^2
  Vec3<T> linear = Vec3<T>::zero();    // of m x w
  Vec3<T> squares = Vec3<T>::zero();   // of |w|^2 - w w^T: the diagonal
  Vec3<T> products = Vec3<T>::zero();  // its yz, zx, xy
  T normal_constant = T(0);            // of m_x^2
  T normal_linear[2] = {T(0), T(0)};   // of m_x times -w_z, w_y
  T normal_squares[2] = {T(0), T(0)};  // of w_z^2, w_y^2; their product is that of y and z above

  PairResponse(const Tables<ScalarOf<T>>& t, const TouchingPair<ScalarOf<T>>& pair, const Tile<T>& x) {
    for (int k = pair.column; k < pair.column + pair.columns; ++k) {
      const T mobility = T(1) / x.held.matrix[t.rounds.columns.offset[t.contacts.columns[k].velocity]];
      const Vec3<T>& m = x.contacts.moving[k];
      const T scaled_m = mobility * m.x;
      constant = fma(mobility, dot(m, m), constant);
      normal_constant = fma(scaled_m, m.x, normal_constant);
      if (!pair.turns) continue;
      const Vec3<T>&w = x.contacts.turning[k], scaled_w = scaled(w, mobility);
      linear = cross_add(m, scaled_w, linear);
      normal_linear[0] = fnma(scaled_m, w.z, normal_linear[0]);
      normal_linear[1] = fma(scaled_m, w.y, normal_linear[1]);
      normal_squares[0] = fma(scaled_w.z, w.z, normal_squares[0]);
      normal_squares[1] = fma(scaled_w.y, w.y, normal_squares[1]);
      for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3, l = (i + 2) % 3;
        squares[i] = fma(scaled_w[j], w[j], fma(scaled_w[l], w[l], squares[i]));
        products[i] = fnma(scaled_w[j], w[l], products[i]);
      }
    }
  }
  LOCKSTEP_INLINE T of_all_rows(const Vec3<T>& r) const {
    const T two = T(2);
    T sum = fma(two, dot(linear, r), constant);
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, l = (i + 2) % 3;
      sum = fma(r[i] * r[i], squares[i], fma(two * (r[j] * r[l]), products[i], sum));
    }
    return sum;
  }
  LOCKSTEP_INLINE T of_normal(const Vec3<T>& r) const {
    const T two = T(2);
    T sum = fma(two, fma(normal_linear[0], r.y, normal_linear[1] * r.z), normal_constant);
    sum = fma(r.y * r.y, normal_squares[0], fma(r.z * r.z, normal_squares[1], sum));
    return larger(fma(two * (r.y * r.z), products.x, sum), T(0));
  }
};

/// The speed along the surface that friction works against: with the drift that it takes back (M111), and with `turns`
/// where it resists turning (M171).
template <class T>
LOCKSTEP_INLINE T sliding_speed(const ContactSlot<T>& slot, const TurningFriction<T>* turning, const T (&u)[3],
                                const Vec3<T>& turns) {
  const T a = u[1] + slot.drift[0], b = u[2] + slot.drift[1];
  T squared = fma(a, a, b * b);
  if (turning) squared += dot(turns + turning->drift, turns + turning->drift);
  return sqrt(squared);
}
/// At slot.speed.
template <class T>
LOCKSTEP_INLINE T sliding_speed(const ContactSlot<T>& slot, const TurningFriction<T>* turning) {
  return sliding_speed(slot, turning, slot.speed, turning ? turning->speed : Vec3<T>::zero());
}

/// What a solve assumes of a slot before it knows: (M105). Friction above 1 holds nearly all that lands, and from a
/// slip that is too large a slot would be let through. A single pass keeps what it begins with.
template <class T>
LOCKSTEP_INLINE T first_slip(const Tables<ScalarOf<T>>& t, T friction, T speed) {
  return t.contacts.passes > 1 ? select(less(T(1), friction), T(0), friction * speed) : friction * speed;
}

/// (M109): whether a slot bounces, and the share of the impulse that comes back. Velocities of semi-implicit Euler are
/// those of the middle of their step. `u` is the normal speed at the start of the step, slot.free that of the step
/// without contacts.
template <class T>
LOCKSTEP_INLINE void begin_bounce(T e, ScalarOf<T> dt, T u, ContactSlot<T>& slot) {
  using S = ScalarOf<T>;
  const T zero = T(0), half = T(S(0.5)), h = T(dt), arrives = slot.free[0];
  slot.bounces = slot.live & less(fma(h, arrives, slot.gap), zero) & less(u, T(S(-least_bounce))) & less(zero, e);
  const T gain = arrives - u, middle = fma(half, gain, u);
  const T at_surface = sqrt(larger(fnma(T(S(2) / dt) * gain, slot.gap, middle * middle), zero));
  const T leaves = fma(e, at_surface, -half * gain);
  const T share = smaller(leaves / larger(absolute(arrives), T(S(1e-6))), T(S(most_restored)));
  slot.restored = select(slot.bounces & less(half * absolute(gain), e * at_surface), share, zero);
}

/// (M124): the same in a leapfrog, whose velocities are those of the ends of a step. What approaches and does not land
/// in this step is off, unless what moves it takes it through all the same: slot.speed is the way from the midpoint to
/// the step's end, over the step. What would be deeper than `middle` at the next midpoint lands at the end of this
/// step. `slot.bias` becomes minus the speed that brings it to where it flies after its landing.
template <class T>
LOCKSTEP_INLINE void begin_bounce_in_step(T e, ScalarOf<T> dt, ScalarOf<T> middle, T u, ContactSlot<T>& slot) {
  using S = ScalarOf<T>;
  const T zero = T(0), one = T(1), half = T(S(0.5)), h = T(dt), free = slot.free[0];
  const T gain = free - u, start = larger(fnma(half * h, u, slot.gap), zero);
  const T arrives = sqrt(larger(fnma(T(S(2) / dt) * gain, start, u * u), zero)), back = e * arrives;
  const auto approaches = slot.live & less(u, T(S(-least_bounce))) & less(-gain, back) & less(zero, e);
  slot.bounces = approaches & (less(fma(half * h, free, slot.gap), zero) | less(fma(h, free, slot.gap), T(-middle)));
  slot.live = slot.live & (slot.bounces | ~approaches | less(fma(h, slot.speed[0], slot.gap), zero));
  slot.landing = smaller(start * T(S(2) / dt) / larger(arrives - u, T(S(1e-6))), one);
  const T left = one - slot.landing;
  const T leaves = fma(left, smaller(gain, zero), back);
  slot.restored = select(slot.bounces, smaller(leaves / larger(absolute(free), T(S(1e-6))), T(S(most_restored))), zero);
  slot.bias = fma(half, -fma(left, back + leaves, leaves), slot.gap * T(S(1) / dt));
}

/// (M104), (M109), (M111): compliance and target of the slot's normal, drift along its tangents. `start` is the pair's
/// twist at the start of the step; slot.free has the speeds without contacts, if the pair bounces.
template <class T>
void begin_slot(const Tables<ScalarOf<T>>& t, const TouchingPair<ScalarOf<T>>& pair, const ContactPatch<T>& patch,
                const RelativeTwist<T>& start, const PairResponse<T>& response, ContactSlot<T>& slot,
                TurningFriction<T>* turning) {
  using S = ScalarOf<T>;
  const T zero = T(0), one = T(1);

  // Whether the slot bounces: (M109), or (M124) within a leapfrog.
  T u[3];
  slot_speed(slot, start, u);
  slot.bounces = slot.given = slot.relaxes = T::none();
  slot.restored = slot.stopping = slot.normal = slot.push = zero;
  if (pair.bounces)
    t.solves_midpoint ? begin_bounce_in_step(patch.restitution, t.dt, pair.middle, u[0], slot)
                      : begin_bounce(patch.restitution, t.dt, u[0], slot);

  // What answers in no row at all cannot be pushed: such a slot is off.
  const T all_rows = response.of_all_rows(slot.arm), normal = response.of_normal(slot.arm);
  const T mean = T(S(1) / S(3)) * all_rows;
  const T stated = pair.soft ? larger(normal, T(S(least_response)) * mean) : mean;
  T compliance = fma(T(pair.cfm_per_response), stated, T(pair.cfm));
  const S least = S(t.solves_midpoint ? bounce_compliance_in_step : bounce_compliance);
  compliance = select(slot.bounces, smaller(compliance, T(least) * mean), compliance);
  slot.live = slot.live & less(zero, compliance);
  slot.bounces = slot.bounces & slot.live;
  slot.stiffness = select(slot.live, one / select(slot.live, compliance, one), zero);
  if (turning) {
    const T hard = T(S(turning_compliance)) * mean;
    turning->stiffness = larger(slot.stiffness, select(slot.live, one / select(slot.live, hard, one), zero));
  }

  // b of (M104), with the cap on the speed that removes an overlap.
  const T share = smaller(T(3) * sqrt(normal / larger(all_rows, T(S(1e-30)))), one);
  slot.slow = T(S(relaxed_above)) * share;
  const T overlap = T(pair.rate) * slot.gap, capped = larger(overlap, T(S(-push_out)) * share);
  const T pushed = pair.soft ? select(slot.bounces, capped, overlap) : capped;
  const T bias = select(less(zero, slot.gap), slot.gap * T(S(1) / t.dt), pushed);
  slot.bias = t.solves_midpoint ? select(slot.bounces, slot.bias, bias) : bias;

  // A soft contact's memory is a spring along the surface. It holds no more than the normal spring allows.
  if (pair.soft) {
    const T most = patch.friction * larger(-slot.bias, zero) * slot.stiffness;
    T squared = fma(slot.carried[0], slot.carried[0], slot.carried[1] * slot.carried[1]);
    if (turning) squared += dot(turning->carried, turning->carried);
    const T part = smaller(most / larger(sqrt(squared), T(S(1e-30))), one);
    for (int i = 0; i < 2; ++i) slot.carried[i] = part * slot.carried[i];
    if (turning) turning->carried = scaled(turning->carried, part);
  }

  // What goes on from the step before: load and drift (M111). The slip of (M105) begins with the speed `u`.
  slot.load = select(slot.goes_on, slot.pressed, zero);
  const Vec3<T> drift = cross_add(patch.drift_turning, from_center(patch, slot), patch.drift_moving);
  const auto taken_back = [&](T way) LOCKSTEP_INLINED {
    return select(slot.goes_on & ~slot.bounces, within(way * T(S(1) / t.dt), T(S(fastest_return))), zero);
  };
  for (int i = 0; i < 2; ++i) slot.drift[i] = taken_back(drift[i + 1]);
  Vec3<T> turns = Vec3<T>::zero();
  if (turning) {
    const Vec3<T> way = by_radii(pair, patch.drift_turning);
    turning->drift = {taken_back(way.x), taken_back(way.y), taken_back(way.z)};
    turns = by_radii(pair, start.turning);
  }
  slot.slip = slot.slip_before = slot.found_before =
      first_slip(t, patch.friction, sliding_speed(slot, turning, u, turns));
  slot.target = slot.bias + slot.slip;
}

/// (M105), (M106): impulse and its derivative at the speed u. The projection on the friction cone of the impulse that
/// the compliance asks for: it sticks, slides or is off. Where the normal impulse is given (M115), friction is the
/// projection on a disc. Where the slot resists turning, `turning` has the rest of it, and the cone is (M171): `turns`
/// are the speeds of those rows.
template <class T>
LOCKSTEP_INLINE void contact_force(const ContactSlot<T>& slot, const TurningFriction<T>* turning, T friction,
                                   const T (&u)[3], const Vec3<T>& turns, ContactForce<T>& force,
                                   TurningForce<T>* turning_force) {
  using S = ScalarOf<T>;
  const T zero = T(0), one = T(1), k_n = slot.stiffness;
  T k = k_n, pull = friction;  // of the tangents; the friction times R_T / R

  // y of (M105), and how long its tangential part is.
  const T asked = fnma(u[0] + slot.target, k, slot.push);
  if (turning) k = turning->stiffness, pull = select(slot.live, friction * k_n / select(slot.live, k, one), zero);
  const T t1 = fnma(u[1] + slot.drift[0], k, slot.carried[0]), t2 = fnma(u[2] + slot.drift[1], k, slot.carried[1]);
  T squared = fma(t1, t1, t2 * t2);
  if (turning) {
    turning_force->asked = turning->carried - scaled(turns + turning->drift, k);
    squared += dot(turning_force->asked, turning_force->asked);
  }
  const T length = sqrt(squared), inverse = one / larger(length, T(S(1e-30)));

  // Which part of the cone, and the impulse there.
  const T share = select(slot.given, zero, one / fma(pull, friction, one));
  const T normal = select(slot.given, slot.normal, asked);
  const T reached = fma(pull, length, normal);
  const T sliding = select(slot.given, slot.normal, reached * share);
  force.sticks = less(length, friction * normal) & slot.live;
  force.slides = less(zero, select(slot.given, slot.normal, reached)) & ~force.sticks & slot.live;
  force.impulse[0] = select(force.sticks, normal, select(force.slides, sliding, zero));
  const T f = select(force.sticks, one, select(force.slides, friction * sliding * inverse, zero));
  force.impulse[1] = f * t1, force.impulse[2] = f * t2;

  // (M106), as nn, n1, n2, 11, 12, 22.
  const T across = select(force.slides, k_n * friction * share * inverse, zero);
  const T along = select(force.slides, k * (fma(pull, friction * share, -f)) * inverse * inverse, zero);
  force.gain[0] = k_n * select(force.sticks & ~slot.given, one, select(force.slides, share, zero));
  force.gain[1] = across * t1, force.gain[2] = across * t2;
  force.gain[3] = fma(along * t1, t1, k * f);
  force.gain[4] = along * t1 * t2;
  force.gain[5] = fma(along * t2, t2, k * f);
  if (!turning) return;
  turning_force->impulse = scaled(turning_force->asked, f);
  turning_force->asked_along[0] = t1, turning_force->asked_along[1] = t2;
  turning_force->across = across, turning_force->along = along, turning_force->alone = k * f;
}
/// At slot.speed, into slot.force.
template <class T>
LOCKSTEP_INLINE void contact_force(T friction, ContactSlot<T>& slot, TurningFriction<T>* turning) {
  contact_force(slot, turning, friction, slot.speed, turning ? turning->speed : Vec3<T>::zero(), slot.force,
                turning ? &turning->force : nullptr);
}

/// G u
template <class T>
LOCKSTEP_INLINE void times_gain(const ContactForce<T>& force, const T (&u)[3], T (&product)[3]) {
  const T* const g = force.gain;
  product[0] = fma(g[0], u[0], fma(g[1], u[1], g[2] * u[2]));
  product[1] = fma(g[1], u[0], fma(g[3], u[1], g[4] * u[2]));
  product[2] = fma(g[2], u[0], fma(g[4], u[1], g[5] * u[2]));
}

/// Adds what rows have that resist turning, with their speeds `turns`. Returns their own part.
template <class T>
LOCKSTEP_INLINE Vec3<T> add_turning_gain(const TurningForce<T>& force, const T (&u)[3], const Vec3<T>& turns,
                                         T (&product)[3]) {
  const T* const asked = force.asked_along;
  const T own = dot(force.asked, turns), along = fma(asked[0], u[1], fma(asked[1], u[2], own));
  product[0] = fma(force.across, own, product[0]);
  for (int i = 0; i < 2; ++i) product[1 + i] = fma(force.along * asked[i], own, product[1 + i]);
  return fma(force.asked, fma(force.across, u[0], force.along * along), scaled(turns, force.alone));
}

}  // namespace lockstep::kernels
