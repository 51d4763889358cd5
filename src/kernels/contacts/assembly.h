// J z, J^T impulse and J^T G J of contacts, pair by pair. SPDX-License-Identifier: Apache-2.0
//
// (M108). A pair moves as one: its slots see the relative twist of two colliders, and their impulses add up to one
// wrench. So the velocities of the solver meet six numbers of a pair, or three if it has one slot, not three for each
// slot.
#pragma once

#include "shapes.h"

namespace lockstep::kernels {

/// Relative angular velocity, and velocity of the pair's reference point, in the frame of its contacts.
template <class T>
struct RelativeTwist {
  Vec3<T> turning, moving;
};

/// The slots of a pair that are live in some listed lane.
template <class T>
struct LiveSlots {
  ContactSlot<T>* slots;
  const ContactPatch<T>& patch;

  struct Iterator {
    ContactSlot<T>* slots;
    const int* at;
    LOCKSTEP_INLINE ContactSlot<T>& operator*() const { return slots[*at]; }
    LOCKSTEP_INLINE void operator++() { ++at; }
    LOCKSTEP_INLINE bool operator!=(const Iterator& other) const { return at != other.at; }
  };
  LOCKSTEP_INLINE Iterator begin() const { return {slots, patch.live}; }
  LOCKSTEP_INLINE Iterator end() const { return {slots, patch.live + patch.live_count}; }
};

/// From now on loops over slots visit those that are live in some of these lanes. A slot adds nothing to a lane in
/// which it is not live, so no lane can tell what is listed for others.
template <class T>
void list_live_slots(const Tables<ScalarOf<T>>& t, typename T::Mask lanes, Tile<T>& x) {
  x.contacts.listed_lanes = lanes;
  x.contacts.lists_all = !any(~lanes);
  x.contacts.listed_count = 0;
  for (int i = 0; i < x.contacts.near_count; ++i) {
    const int p = x.contacts.near_pairs[i];
    const auto& pair = t.contacts.pairs[p];
    ContactPatch<T>& patch = x.contacts.patch[p];
    patch.live_count = 0;
    for (int s = 0; s < pair.slots; ++s)
      if (any(x.contacts.slot[pair.slot + s].live & lanes)) patch.live[patch.live_count++] = s;
    if (patch.live_count > 0) x.contacts.listed_pairs[x.contacts.listed_count++] = p;
  }
}

/// act(pair, patch, its live slots) for the pairs with one. The numbers of other slots are those of any step.
template <class T, class Act>
LOCKSTEP_INLINE void each_near(const Tables<ScalarOf<T>>& t, Tile<T>& x, Act&& act) {
  for (int i = 0; i < x.contacts.listed_count; ++i) {
    const int p = x.contacts.listed_pairs[i];
    ContactPatch<T>& patch = x.contacts.patch[p];
    act(t.contacts.pairs[p], patch, LiveSlots<T>{x.contacts.slot + t.contacts.pairs[p].slot, patch});
  }
}

/// act(pair, patch, slot) for each of their live slots.
template <class T, class Act>
LOCKSTEP_INLINE void each_slot(const Tables<ScalarOf<T>>& t, Tile<T>& x, Act&& act) {
  each_near(t, x, [&](const auto& pair, const ContactPatch<T>& patch, const LiveSlots<T>& slots) LOCKSTEP_INLINED {
    for (ContactSlot<T>& slot : slots) act(pair, patch, slot);
  });
}

/// Torsional and rolling friction of a slot; null where its pair has none.
template <class T>
LOCKSTEP_INLINE TurningFriction<T>* turning_of(const TouchingPair<ScalarOf<T>>& pair, const ContactSlot<T>& slot,
                                               const Tile<T>& x) {
  if (pair.turning_friction < 0) return nullptr;
  return x.contacts.turning_friction + pair.turning_friction + (&slot - (x.contacts.slot + pair.slot));
}

/// act(slot, its friction) for all slots that resist turning.
template <class T, class Act>
LOCKSTEP_INLINE void each_turning(const Tables<ScalarOf<T>>& t, Tile<T>& x, Act&& act) {
  if (t.contacts.turning_frictions == 0) return;
  for (int p = 0; p < t.contacts.pairs.count; ++p) {
    const auto& pair = t.contacts.pairs[p];
    for (int s = 0; pair.turning_friction >= 0 && s < pair.slots; ++s)
      act(x.contacts.slot[pair.slot + s], x.contacts.turning_friction[pair.turning_friction + s]);
  }
}

/// Of the velocities z. A pair with one slot has its point as the reference: `whole` alone asks for its turning, and
/// friction that resists it.
template <class T>
LOCKSTEP_INLINE RelativeTwist<T> twist_of(const Tables<ScalarOf<T>>& t, const TouchingPair<ScalarOf<T>>& pair,
                                          const Tile<T>& x, const T* z, bool whole = false) {
  RelativeTwist<T> twist{Vec3<T>::zero(), Vec3<T>::zero()};
  for (int k = pair.column; k < pair.column + pair.columns; ++k) {
    const T speed = z[t.contacts.columns[k].velocity];
    twist.moving = fma(x.contacts.moving[k], speed, twist.moving);
    if (whole || pair.turns) twist.turning = fma(x.contacts.turning[k], speed, twist.turning);
  }
  return twist;
}

/// u of a slot: normal speed, positive where the colliders part, and speeds along the tangents.
template <class T>
LOCKSTEP_INLINE void slot_speed(const ContactSlot<T>& slot, const RelativeTwist<T>& twist, T (&u)[3]) {
  const Vec3<T> v = cross_add(twist.turning, slot.arm, twist.moving);
  for (int i = 0; i < 3; ++i) u[i] = v[i];
}

/// Of the rows that resist turning: by how much a rotation moves the rim of a disc of their radius.
template <class T>
LOCKSTEP_INLINE Vec3<T> by_radii(const TouchingPair<ScalarOf<T>>& pair, const Vec3<T>& v) {
  return {T(pair.torsion_radius) * v.x, T(pair.rolling_radius) * v.y, T(pair.rolling_radius) * v.z};
}

/// J z of all slots, into the member `to` of each: `speed` or `change`.
template <class T>
void slot_speeds(const Tables<ScalarOf<T>>& t, const T* z, T (ContactSlot<T>::*to)[3], Tile<T>& x) {
  each_near(t, x, [&](const auto& pair, const ContactPatch<T>&, const LiveSlots<T>& slots) LOCKSTEP_INLINED {
    const RelativeTwist<T> twist = twist_of(t, pair, x, z);
    for (ContactSlot<T>& slot : slots) {
      slot_speed(slot, twist, slot.*to);
      if (TurningFriction<T>* const turning = turning_of(pair, slot, x))
        (to == &ContactSlot<T>::change ? turning->change : turning->speed) = by_radii(pair, twist.turning);
    }
  });
}

/// J^T impulse of all slots.
template <class T>
void momentum_of_contacts(const Tables<ScalarOf<T>>& t, T* momentum, Tile<T>& x) {
  for (int z = 0; z < t.rounds.columns.n; ++z) momentum[z] = T(0);
  each_near(t, x, [&](const auto& pair, const ContactPatch<T>&, const LiveSlots<T>& slots) LOCKSTEP_INLINED {
    Vec3<T> force = Vec3<T>::zero(), moment = force;
    bool acts = false;
    for (const ContactSlot<T>& slot : slots) {
      if (!any((slot.force.sticks | slot.force.slides) & x.contacts.listed_lanes)) continue;
      acts = true;
      const T* const impulse = slot.force.impulse;
      const Vec3<T> f{impulse[0], impulse[1], impulse[2]};
      force = force + f;
      moment = cross_add(slot.arm, f, moment);
      if (const TurningFriction<T>* const turning = turning_of(pair, slot, x))
        moment = moment + by_radii(pair, turning->force.impulse);
    }
    if (!acts) return;
    for (int k = pair.column; k < pair.column + pair.columns; ++k) {
      T& sum = momentum[t.contacts.columns[k].velocity];
      sum += dot(x.contacts.moving[k], force);
      if (pair.turns) sum += dot(x.contacts.turning[k], moment);
    }
  });
}

/// How a pair's wrench falls with its twist: -d (moment, force) / d (turning, moving).
template <class T>
struct PairGain {
  Mat3<T> moving, across, turning;  // force by moving; force by turning; moment by turning

  LOCKSTEP_INLINE void add(const ContactSlot<T>& slot) {
    const T* const g = slot.force.gain;
    const Vec3<T>& r = slot.arm;
    const Vec3<T> rows[3] = {{g[0], g[1], g[2]}, {g[1], g[3], g[4]}, {g[2], g[4], g[5]}};
    Mat3<T> by_turning;  // G B, B w = w x r
    for (int i = 0; i < 3; ++i) {
      const Vec3<T> row = cross(r, rows[i]);
      for (int j = 0; j < 3; ++j) {
        moving(i, j) += rows[i][j];
        by_turning(i, j) = row[j];
        across(i, j) += row[j];
      }
    }
    for (int j = 0; j < 3; ++j) {
      const Vec3<T> column = cross(r, column_of(by_turning, j));
      for (int i = 0; i < 3; ++i) turning(i, j) += column[i];
    }
  }
  /// The rows that resist turning, and their products with the others (M171).
  LOCKSTEP_INLINE void add(const TouchingPair<ScalarOf<T>>& pair, const Vec3<T>& arm, const TurningForce<T>& force) {
    const Vec3<T> asked = by_radii(pair, force.asked);
    const Vec3<T> others{force.across, force.along * force.asked_along[0], force.along * force.asked_along[1]};
    const Vec3<T> about = cross_add(arm, others, scaled(asked, force.along));
    const Vec3<T> by_arm = cross(arm, others);
    const Vec3<T> squared = by_radii(pair, by_radii(pair, Vec3<T>{force.alone, force.alone, force.alone}));
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        across(i, j) = fma(others[i], asked[j], across(i, j));
        turning(i, j) = fma(about[i], asked[j], fma(asked[i], by_arm[j], turning(i, j)));
      }
      turning(i, i) += squared[i];
    }
  }
  LOCKSTEP_INLINE static PairGain zero() {
    const Vec3<T> none = Vec3<T>::zero();
    return {{none, none, none}, {none, none, none}, {none, none, none}};
  }
};

/// Adds J^T G J to the packed `matrix`.
template <class T>
void add_gains(const Tables<ScalarOf<T>>& t, T* matrix, Tile<T>& x) {
  each_near(t, x, [&](const auto& pair, const ContactPatch<T>&, const LiveSlots<T>& slots) LOCKSTEP_INLINED {
    PairGain<T> gain = PairGain<T>::zero();
    bool acts = false;
    for (const ContactSlot<T>& slot : slots) {
      if (!any((slot.force.sticks | slot.force.slides) & x.contacts.listed_lanes)) continue;
      acts = true;
      gain.add(slot);
      if (const TurningFriction<T>* const turning = turning_of(pair, slot, x)) gain.add(pair, slot.arm, turning->force);
    }
    if (!acts) return;
    const bool turns = pair.turns;
    const int* entry = t.contacts.entries.data + pair.entry;
    const Vec3<T>*const turning = x.contacts.turning + pair.column, *const moving = x.contacts.moving + pair.column;
    for (int k = 0; k < pair.columns; ++k) {
      Vec3<T> force = multiply(gain.moving, moving[k]), moment = Vec3<T>::zero();
      if (turns) {
        force = multiply_add(gain.across, turning[k], force);
        moment = multiply(gain.turning, turning[k]) + multiply_transposed(gain.across, moving[k]);
      }
      for (int l = 0; l <= k; ++l, ++entry) {
        matrix[*entry] += dot(moving[l], force);
        if (turns) matrix[*entry] += dot(turning[l], moment);
      }
    }
  });
}

}  // namespace lockstep::kernels
