// Arrays of the contacts: pairs, slots, and what a step remembers of them. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diagnostic_arrays.h"

namespace lockstep::kernels {

/// The law of contact (M105) of one slot at one velocity: impulse along normal and tangents, and how fast it falls with
/// the velocity, -d impulse / d u, as nn, n1, n2, 11, 12, 22.
template <class T>
struct ContactForce {
  T impulse[3];
  T gain[6];
  typename T::Mask sticks, slides;  // lanes; elsewhere the slot is off
};

/// The rest of the law (M171) where a slot resists turning: impulses about the normal and the tangents, over the radii
/// of their rows, and what -d impulse / d u has more.
template <class T>
struct TurningForce {
  Vec3<T> impulse;
  Vec3<T> asked;           // y_T of these rows
  T asked_along[2];        // y_T along the tangents
  T across, along, alone;  // of y_T with the normal; of y_T y_T^T; of 1
};

/// A collider in the world. Half-spaces are solid below the plane z = 0 of their own frame; capsules lie along z. A
/// height field has cells per metre along x and y, and its largest height, in place of sizes.
template <class T>
struct PlacedShape {
  Mat3<T> rotation;
  Vec3<T> center;
  T size[3];  // half the edges of a box; radius and half the length of a cylinder or capsule; radius of a sphere or
              // hull

  LOCKSTEP_INLINE Vec3<T> axis(int k) const { return column_of(rotation, k); }
};

/// A collider in a step, and how its body moves, in the world.
template <class T>
struct MovingCollider {
  PlacedShape<T> shape;
  Vec3<T> place;  // of its body, whose origin has the velocity `linear`
  Vec3<T> angular, linear;
  T reach;                      // radius of a sphere about its centre that holds it
  T half[3];                    // half the edges of a box about its centre, along its axes, that holds it
  T scale[3];                   // of a hull, where sizes differ
  T stretch, span, other_span;  // (M161)

  LOCKSTEP_INLINE Vec3<T> velocity_at(const Vec3<T>& point) const { return cross_add(angular, point - place, linear); }
};

/// One contact point. Vectors are in the frame of the pair: normal and tangents, from its reference point. What the
/// rounds read stands together.
template <class T>
struct ContactSlot {
  typename T::Mask live;  // lanes in which it may act
  typename T::Mask given;
  Vec3<T> arm;
  T target;      // b' of this solve
  T stiffness;   // 1 / R
  T push;        // normal impulse that this solve starts from: of the step before, in a second solve
  T normal;      // N of (M115), where the normal impulse is given
  T carried[2];  // tangential impulse that this solve starts from
  T drift[2];    // tangential speed that takes the pair's drift back (M111)
  T speed[3];    // u
  T change[3];   // of u by the Newton step
  ContactForce<T> force, trial;

  T bias;                       // b of (M104)
  T slip;                       // speed along the surface that the normal target allows for, times the friction (M105)
  T slip_before, found_before;  // slip of the pass before, and the one that its solution had (M114)
  T free[3];                    // u of the step without contacts
  T gap;
  T face;                    // of this step
  T kept_face;               // of the memory
  T memory[2];               // tangential impulse of the step before (state)
  T pressed;                 // normal impulse of the step before (state)
  T slow;                    // speed of a push-out that may stay (M109)
  T load;                    // normal impulse of the step before, where it goes on
  T landing;                 // share of the step after which it lands (M124), if it bounces within a leapfrog
  T restored;                // f of (M109), in lanes that bounce: share of the impulse that comes back
  T stopping;                // normal impulse that has stopped what bounces (M109)
  typename T::Mask goes_on;  // lanes in which it has pressed in the step before
  typename T::Mask bounces;
  typename T::Mask relaxes;  // lanes that have had a second solve
  T visit[2];                // of a sweep: impulse along the normal and along a tangent for a speed that is missing
  T across[2];               // speeds along the tangents that answer a unit normal impulse
};

/// Torsional and rolling friction of a slot (M171): what ContactSlot has for tangents, for rotations about the normal
/// and the tangents, times the radii of their rows.
template <class T>
struct TurningFriction {
  T stiffness;  // of all rows but the normal, 1 / R_T
  Vec3<T> carried, drift, speed, change, free;
  Vec3<T> across;  // as ContactSlot::across
  TurningForce<T> force, trial;
  Vec3<T> memory;  // impulses of the step before (state)
};

/// What a convex pair remembers: its normal in the first shape's frame, and corners, see contacts/gjk.h. All 0 where
/// the colliders were not near (state).
template <class T>
struct ConvexMemory {
  Vec3<T> normal;
  Vec3<T> corners;
};

/// What two colliders of a pair have in common.
template <class T>
struct ContactPatch {
  typename T::Mask near;  // lanes in which they may touch
  int live[most_slots];   // its slots that are live in some listed lane
  int live_count;
  Vec3<T> axes[3];  // normal and tangents in the world
  Vec3<T> point;    // the reference point in the world
  Vec3<T> center;   // of the second collider in the world
  Vec3<T> place;    // the same in the first collider's frame
  Mat3<T> turn;     // the second collider's axes in the first one's, as columns
  Mat3<T> frame;    // the first collider's axes in the world, as columns
  // Where the step before would have put the second collider if velocities moved it exactly (state).
  Vec3<T> expected_place, expected_axis, expected_other_axis;
  Vec3<T> kept_normal, kept_tangent;  // axes of the memory in the world (state)
  // By how much it is elsewhere, in the frame of the contact, about its centre (M111); what of it may be rounding.
  Vec3<T> drift_turning, drift_moving, kept_turning, kept_moving;
  T friction, restitution;
};

/// What the rounds of a call of step() have done, summed over its steps: what Quantity::solve_counts shows.
template <class T>
struct SolveCounts {
  T steps;     // in which contacts were looked for, or rows were solved
  T near;      // pairs of which a slot was live
  T live;      // slots that could act
  T pressing;  // slots that pressed
  T solves, passes, rounds, trials;
  T tile_live, tile_rounds, tile_trials;  // as many as the tile went through

  template <class Act>
  LOCKSTEP_INLINE void each(Act&& act) {
    T* const numbers[solve_count_rows] = {&steps,  &near,   &live,      &pressing,    &solves,     &passes,
                                          &rounds, &trials, &tile_live, &tile_rounds, &tile_trials};
    for (T* number : numbers) act(*number);
  }
  /// What is of the lane, as it was before what these lanes have not taken part in.
  LOCKSTEP_INLINE void restore(typename T::Mask lanes, const SolveCounts& before) {
    T SolveCounts::*const own[] = {&SolveCounts::steps,    &SolveCounts::near,   &SolveCounts::live,
                                   &SolveCounts::pressing, &SolveCounts::solves, &SolveCounts::passes,
                                   &SolveCounts::rounds,   &SolveCounts::trials};
    for (T SolveCounts::*const number : own) this->*number = select(lanes, before.*number, this->*number);
  }
};

template <class T>
struct Contacts {
  Motion<T> motion;
  MovingCollider<T>* collider;  // [colliders]
  T* own_place;                 // [4 * colliders] where places differ: Parameter::collider_place
  T* own_size;                  // [3 * colliders] where sizes differ: as PlacedShape::size; of a hull, its scale
  ContactPatch<T>* patch;       // [pairs]
  int* near_pairs;              // [pairs] those with a slot that is live in some lane, in the plan's order
  int near_count = 0;
  int set_aside = 0;              // near_count, while a solve is made without contacts
  typename T::Mask listed_lanes;  // those whose slots loops visit
  bool lists_all = true;          // lanes are listed
  int* listed_pairs;              // [pairs] those with a slot that is live in some listed lane
  int listed_count = 0;
  ContactSlot<T>* slot;                  // [slots]
  TurningFriction<T>* turning_friction;  // [slots of pairs that resist turning]
  ConvexMemory<T>* convex;               // [convex pairs] (state)
  Vec3<T>* turning;                      // [columns] relative angular velocity, by velocity of the solver
  Vec3<T>* moving;                       // [columns] relative velocity of the reference point
  Vec3<T>* parted;           // [columns] what of it is due to the gap between the points of two moving bodies
  T* previous;               // [solver] velocities at the start of the step before (state)
  T* piece;                  // [bounds of one velocity] contacts/pieces.h (state)
  T* saturation;             // [limited servos] the same (state)
  T length;                  // of the step that the memory is of, where steps may be taken in halves (state)
  T unfinished;              // steps at the cap since the last reset (state)
  typename T::Mask kept;     // lanes that remember their contacts
  typename T::Mask known;    // of these, lanes that begin where the last step has ended
  typename T::Mask held;     // lanes that are solved with contacts at once (solve_contacts.h)
  typename T::Mask goes_on;  // lanes in which a contact that has pressed goes on
  T work;                    // that push-outs have done in the step, for the audit (M126)

  template <class Take>
  void arrays(const Tables<ScalarOf<T>>& t, Take& take) {
    const auto& c = t.contacts;
    const int n = t.rounds.columns.n;
    motion.arrays(t, take);
    take("contacts.collider", collider, c.colliders.count);
    take("contacts.own_place", own_place, c.places(t));
    take("contacts.own_size", own_size, t.declares(Parameter::collider_size) ? 3 * c.colliders.count : 0);
    take("contacts.patch", patch, c.pairs.count);
    take("contacts.near_pairs", near_pairs, c.pairs.count);
    take("contacts.listed_pairs", listed_pairs, c.pairs.count);
    take("contacts.slot", slot, c.slots);
    take("contacts.turning_friction", turning_friction, c.turning_frictions);
    take("contacts.convex", convex, c.convex);
    take("contacts.turning", turning, c.columns.count);
    take("contacts.moving", moving, c.columns.count);
    take("contacts.parted", parted, c.columns.count);
    take("contacts.previous", previous, n);
    take("contacts.piece", piece, t.bounds.single);
    take("contacts.saturation", saturation, t.limited_servos.count);
  }
};

}  // namespace lockstep::kernels
