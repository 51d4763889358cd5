// Colliders, the pairs of them that may touch, and what a pair's contacts move. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "columns.h"

namespace lockstep {

/// Which function finds the contacts of a pair, by the kinds of its colliders in this order.
enum class PairKind : int {
  half_space_box,
  half_space_capsule,
  half_space_sphere,
  box_box,
  box_capsule,
  box_sphere,
  capsule_capsule,
  capsule_sphere,
  sphere_sphere
};

/// The slots that a pair of this kind has: no pair can have more contacts.
constexpr int slots_of(PairKind kind) {
  switch (kind) {
    case PairKind::half_space_box:
    case PairKind::box_box: return 4;
    case PairKind::half_space_capsule:
    case PairKind::box_capsule:
    case PairKind::capsule_capsule: return 2;
    default: return 1;
  }
}

constexpr int most_slots = 4;  ///< of a pair

struct ColliderStructure {
  int body;        ///< -1: it stands in the world
  bool unlimited;  ///< a half-space
};
template <class S>
struct ColliderPlace : ColliderStructure {
  S rotation[9];  ///< collider coordinates to body coordinates, or to the world's, row-major
  S offset[3];
  S size[3];  ///< as in kernels/contacts/shapes.h
  S reach;    ///< radius of a sphere about its centre that holds it; 0 for a half-space

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.rotation, to.rotation), visit(from.offset, to.offset), visit(from.size, to.size);
    visit(from.reach, to.reach);
  }
};

/// Two colliders that may touch, in the order of PairKind.
struct TouchingStructure {
  PairKind kind;
  int first, second;  ///< colliders
  int slot, slots;
  int column, columns;  ///< in ContactStructure::columns
  int entry;            ///< in ContactStructure::entries: of A_r, by column and column up to that one
  bool soft;            ///< its compliance is stated, so an overlap has a force of its own
};
template <class S>
struct TouchingPair : TouchingStructure {
  S friction, restitution;
  S rate, cfm, cfm_per_response;  ///< as those of RowSoftness

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.friction, to.friction), visit(from.restitution, to.restitution);
    visit(from.rate, to.rate), visit(from.cfm, to.cfm), visit(from.cfm_per_response, to.cfm_per_response);
  }
};

struct ContactStructure {
  Span<PairColumn> columns;
  Span<ColumnPart> parts;
  Span<int> entries;
  int slots = 0;
  int passes = 0, rounds = 0;
  bool bounces = false;  ///< some pair has a restitution
};
template <class S>
struct ContactTables : ContactStructure {
  Span<ColliderPlace<S>> colliders;
  Span<TouchingPair<S>> pairs;
  S tolerance = 0;  ///< of a solve
  inline __attribute__((always_inline)) bool used() const { return pairs.count > 0; }
  /// Rows of a batch that remember contacts (kernels/contacts/memory.h): of slots, of pairs, the solver's velocities,
  /// the pieces of bounds and servos, the length of the step if that may differ, the state that they belong to, and a
  /// count.
  static constexpr int rows_of_slot = 4, rows_of_pair = 15;
  template <class Structure>
  inline __attribute__((always_inline)) int remembered(const Structure& t) const {
    return used() ? remembered_state(t) + t.joints + t.velocities + 7 * t.roots.count + 1 : 0;
  }
  /// The first row of the state.
  template <class Structure>
  inline __attribute__((always_inline)) int remembered_state(const Structure& t) const {
    return rows_of_slot * slots + rows_of_pair * pairs.count + t.solver.n + t.bounds.single + t.limited_servos.count +
           (t.guarded ? 1 : 0);
  }

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.colliders, to.colliders), visit(from.pairs, to.pairs), visit(from.tolerance, to.tolerance);
  }
};

}  // namespace lockstep
