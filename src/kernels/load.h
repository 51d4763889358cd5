// First stage: reads the state of a tile from the batch. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/contacts/memory.h"
#include "kernels/couplings/consistent.h"
#include "kernels/couplings/functions.h"
#include "kernels/couplings/tendons.h"
#include "kernels/couplings/turns.h"
#include "kernels/dynamics/balls.h"
#include "kernels/tile/lay_out.h"
#include "records.h"

namespace lockstep::kernels {

/// Adds the moments of a link whose centre of mass or inertia differs per environment (M82).
template <class T>
void add_link(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int l, T mass,
              PseudoInertia<T>& sum) {
  using S = ScalarOf<T>;
  const LinkPlace<S>& place = t.link[l];
  T spread[6];  // xx, yy, zz, yz, xz, xy about the centre of mass, in the link's axes
  if (const S* own = batch.field(Parameter::inertia)) {
    T tensor[6];  // xx, yy, zz, xy, xz, yz
    for (int k = 0; k < 6; ++k) tensor[k] = T::load(own + (6 * l + k) * batch.stride);
    const T half_trace = T(S(0.5)) * (tensor[0] + tensor[1] + tensor[2]);
    for (int k = 0; k < 3; ++k) spread[k] = half_trace - tensor[k], spread[3 + k] = -tensor[5 - k];
  } else {
    const T scale = t.declares(Parameter::mass) ? mass : T(1);
    for (int k = 0; k < 6; ++k) spread[k] = scale * T(place.spread[k]);
  }
  const Vec3<T> center = center_of_link<T>(t, batch, l);
  const auto entry = [&](int i, int j) { return i == j ? spread[i] : spread[6 - i - j]; };
  const auto turned = [&](int i, int j) {
    T result = mass * center[i] * center[j];
    for (int k = 0; k < 3; ++k)
      for (int m = 0; m < 3; ++m)
        result = fma(T(place.rotation[3 * i + k] * place.rotation[3 * j + m]), entry(k, m), result);
    return result;
  };
  for (int k = 0; k < 3; ++k) sum.moment[k] = fma(mass, center[k], sum.moment[k]);
  for (int k = 0; k < 3; ++k) {
    sum.second[k] += turned(k, k);
    sum.second[3 + k] += turned((k + 1) % 3, (k + 2) % 3);
  }
}

/// Inertias per environment. A body is the sum of its links; a link's inertia scales with its mass unless it is given.
template <class T>
void own_inertias(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  for (int b = 0; b < t.bodies; ++b)
    x.bodies.inertia[b] = {T(0), Vec3<T>::zero(), {T(0), T(0), T(0), T(0), T(0), T(0)}};
  for (int l = 0; l < t.links; ++l) {
    const LinkPlace<ScalarOf<T>>& place = t.link[l];
    if (place.body < 0) continue;
    const T mass = field<T>(batch, Parameter::mass, t.link_mass.data).at(l, l);
    PseudoInertia<T>& sum = x.bodies.inertia[place.body];
    sum.mass += mass;
    if (t.declares(Parameter::center_of_mass) || t.declares(Parameter::inertia)) {
      add_link(t, batch, l, mass, sum);
      continue;
    }
    for (int k = 0; k < 3; ++k) sum.moment[k] = fma(mass, T(place.unit_moment[k]), sum.moment[k]);
    for (int k = 0; k < 6; ++k) sum.second[k] = fma(mass, T(place.unit_second[k]), sum.second[k]);
  }
}

template <class T>
LOCKSTEP_INLINE void own_offsets(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  for (int c = 0; c < t.couplings; ++c)
    x.couplings.offset[c] = T::load(batch.field(Parameter::offset) + c * batch.stride);
}

/// (M10) Moves what lies on the axes of revolute joints to the parents: mass m, first moment h and second moment z
/// along the axis e at the origin r.
template <class T>
void move_masses_inwards(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int b = 0; b < t.bodies; ++b) x.bodies.base_inertia[b] = x.bodies.inertia[b];
  for (int b = t.bodies - 1; b >= 0; --b) {
    const Body<ScalarOf<T>>& body = t.body[b];
    if (body.root || body.prismatic) continue;
    PseudoInertia<T>& own = x.bodies.base_inertia[b];
    const int k = body.axis;
    const T mass = own.mass;
    T h = own.moment[k], z = own.second[k];
    own.mass = T(0);
    if (body.ball >= 0)
      h = z = T(0);  // it turns about a point alone
    else
      own.moment[k] = own.second[k] = T(0);
    if (body.parent < 0) continue;
    PseudoInertia<T>& parent = x.bodies.base_inertia[body.parent];
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
LOCKSTEP_INLINE void load(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x,
                          const TileShape& shape) {
  T *const q = x.state.q, *const v = x.state.v;
  for (int j = 0; j < shape.joints; ++j) {
    const std::ptrdiff_t row = shape.dof[j] * batch.stride;
    q[j] = T::load(batch.position + row);
    v[shape.velocity[j]] = T::load(batch.velocity + row);
    // Prefetch the next tile: these are more rows than the processor prefetches by itself. (Where two tiles are stepped
    // in turn, the second one comes too late, but such a step is so long that it does not matter.)
    __builtin_prefetch(batch.position + row + T::lanes);
    __builtin_prefetch(batch.velocity + row + T::lanes);
    __builtin_prefetch(batch.effort + row + T::lanes);
  }
  for (int i = 0; i < 7 * shape.roots; ++i) x.state.pose[i] = T::load(batch.root_pose + i * batch.stride);
  for (int r = 0; r < shape.roots; ++r)
    for (int i = 0; i < 6; ++i)
      v[shape.root[r].velocity + i] = T::load(batch.root_velocity + (6 * r + i) * batch.stride);
  x.frozen = x.too_fast = x.servos.decided = T::none();
  if (t.audited) *x.audit.state = {T::load(batch.audit), T::load(batch.audit + batch.stride), T(0), T(0), T::none()};
  std::uint32_t faults = 0;
  for (int i = 0; i < T::lanes; ++i) faults |= static_cast<std::uint32_t>(batch.fault[i]);
  for (int i = 0; faults != 0 && i < T::lanes; ++i) x.frozen.set_lane(i, batch.fault[i] != Fault{});

  for (int k = 0; shape.record_diagnostics && k < 4; ++k) x.diagnostics.energy[k] = T(0);
  const auto own = [&](Parameter parameter) {
    return ((shape.per_environment >> static_cast<unsigned>(parameter)) & 1u) != 0;
  };
  if (own(Parameter::gear_ratio)) own_ratios(t, batch, x);
  if (own(Parameter::offset)) own_offsets(t, batch, x);
  if (t.turning.count > 0) load_turns(t, batch, x);
  if (t.contacts.used()) load_contacts(t, batch, x);  // compares what was stored, so before tendons are placed
  if (own(Parameter::mass) || own(Parameter::center_of_mass) || own(Parameter::inertia)) {
    own_inertias(t, batch, x);
    move_masses_inwards(t, x);
  }
  if (own(Parameter::function)) own_functions(t, batch, x);
  if (t.functions.used()) place_loaded(t, x);
  if (t.tendons.count > 0) keep_tendons(t, x), place_tendons(t, x);
  if (t.balls.count > 0) wrap_balls(t, x.state.q);
  if (t.spatial.used()) place_spatial_tendons(t, x, x.state);
  set_consistent(t, x, all_consistent(t, x, shape));
  if (t.records_calls()) load_records(t, batch, x);
  if (t.counts_solves()) x.counts.each([](T& number) LOCKSTEP_INLINED { number = T(0); });
}

template <class T>
void load(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  load(t, batch, x, tile_shape(t));
}

}  // namespace lockstep::kernels
