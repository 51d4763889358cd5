// Colliders, the pairs of them that may touch, and what a pair's contacts move. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "columns.h"
#include "lockstep/enums.h"

namespace lockstep {

/// Which function finds the contacts of a pair, by the kinds of its colliders in this order.
enum class PairKind : int {
  half_space_box,
  half_space_hull,
  half_space_cylinder,
  half_space_capsule,
  half_space_ellipsoid,
  half_space_sphere,
  height_field,  ///< of any kind: one point of it
  box_box,
  box_capsule,
  box_sphere,
  capsule_capsule,
  capsule_sphere,
  sphere_sphere,
  convex_faces,  ///< of any kinds that may touch in a face
  convex_line,   ///< the second is a capsule
  convex_point   ///< one of them is round
};

/// The slots that a pair of this kind has: no pair can have more contacts.
constexpr int slots_of(PairKind kind) {
  switch (kind) {
    case PairKind::half_space_box:
    case PairKind::half_space_hull:
    case PairKind::half_space_cylinder:
    case PairKind::box_box:
    case PairKind::convex_faces: return 4;
    case PairKind::half_space_capsule:
    case PairKind::box_capsule:
    case PairKind::capsule_capsule:
    case PairKind::convex_line: return 2;
    default: return 1;
  }
}

/// The pairs of one contact: a height field touches points, each with a normal of its own.
constexpr int points_of(PairKind kind, ShapeKind second) {
  if (kind != PairKind::height_field) return 1;
  switch (second) {
    case ShapeKind::sphere: return 2;
    case ShapeKind::ellipsoid: return 1;
    case ShapeKind::cylinder: return 6;
    default: return 4;
  }
}

/// Whether the pair remembers how its shapes were apart: kernels/contacts/gjk.h.
constexpr bool is_convex(PairKind kind) { return kind >= PairKind::convex_faces; }

constexpr int most_slots = 4;  ///< of a pair

constexpr double most_growth = 10.0;  ///< of a collider's size

constexpr int most_face_corners = 8;  ///< of a hull's face: compile() leaves out the others

/// A convex polytope about an origin inside it. Corners of faces are in order around it, and padded with the last one.
template <class S>
struct HullTable {
  int corners = 0, faces = 0, face_corners = 0;  ///< the latter: of the face that has most
  const S* corner[3] = {};                       ///< x, y, z
  const S* normal[3] = {};                       ///< of each face, outwards
  const S* face_corner[most_face_corners] = {};  ///< the number of a corner, of each face
};

/// Where its numbers are in ContactTables::shape_numbers: corners x, y, z, normals x, y, z, then corners of faces.
struct HullStructure {
  int corners, faces, face_corners;
  int first;
};

/// Heights on a grid, and over each point of it the largest one that a collider above it can reach.
template <class S>
struct HeightTable {
  int columns = 0, rows = 0;          ///< along x, along y
  const S *heights = {}, *most = {};  ///< [rows * columns], a row with all columns first
};

/// Where its numbers are in ContactTables::shape_numbers: heights, then the largest ones.
struct HeightStructure {
  int columns, rows;
  int first;
};

struct ColliderStructure {
  int body;  ///< -1: it stands in the world
  ShapeKind kind;
  int table = -1;        ///< in ContactStructure::hulls, or in height_fields
  bool scanned = false;  ///< stands still, and Quantity::height_scan sees it
  /// It has a place of its own, and its link's axes are not those of the body or the world that carries it: rotation
  /// and offset are those in the link.
  bool in_link = false;
};
template <class S>
struct ColliderPlace : ColliderStructure {
  S rotation[9];  ///< collider coordinates to body coordinates, or to the world's, row-major
  S offset[3];
  S link_rotation[9];  ///< if `in_link`: the link's coordinates to those of the body, or of the world
  S link_offset[3];
  S size[3];  ///< as in kernels/tile/contact_arrays.h
  S reach;    ///< radius of a sphere about its centre that holds it; 0 for a half-space
  S half[3];  ///< half the edges of a box about its centre, along its axes, that holds it; 0 for a half-space

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.rotation, to.rotation), visit(from.offset, to.offset), visit(from.size, to.size);
    visit(from.link_rotation, to.link_rotation), visit(from.link_offset, to.link_offset);
    visit(from.reach, to.reach), visit(from.half, to.half);
  }
};

/// Two colliders that may touch, in the order of PairKind. Contacts with a height field are a pair for each point.
struct TouchingStructure {
  PairKind kind;
  int first, second;  ///< colliders
  int contact;        ///< in Plan::contacts()
  int point = 0;      ///< of those that touch a height field
  int slot, slots;
  int column, columns;   ///< in ContactStructure::columns
  int entry;             ///< in ContactStructure::entries: of A_r, by column and column up to that one
  int memory = -1;       ///< in Contacts::convex
  bool soft;             ///< its compliance is stated, so an overlap has a force of its own
  bool bounces;          ///< may have a restitution
  bool turns;            ///< its solve sees how it turns: with several slots, or with friction that resists it
  int turning_friction;  ///< of its first slot that resists turning, -1 if none does
  bool by_boxes;         ///< costs enough for boxes about its colliders to be looked at first
};
template <class S>
struct TouchingPair : TouchingStructure {
  S friction, restitution;
  S torsion_radius, rolling_radius;  ///< (M171): of friction about the normal and the tangents, m
  S rate, cfm, cfm_per_response;     ///< as those of RowSoftness
  S apart, size;                     ///< see (M156), and the reach of both, m
  S middle;                          ///< m: no overlap is deeper before the middles have passed each other
  S slack;                           ///< m: slots keep their corners until another one is deeper by this

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.friction, to.friction), visit(from.restitution, to.restitution);
    visit(from.torsion_radius, to.torsion_radius), visit(from.rolling_radius, to.rolling_radius);
    visit(from.rate, to.rate), visit(from.cfm, to.cfm), visit(from.cfm_per_response, to.cfm_per_response);
    visit(from.apart, to.apart), visit(from.size, to.size), visit(from.middle, to.middle);
    visit(from.slack, to.slack);
  }
};

/// Of a contact, as in Plan::contacts(): its pairs, which all have the same colliders.
struct PairRange {
  int first, last;
};

struct ContactStructure {
  Span<PairRange> contacts;
  Span<PairColumn> columns;
  Span<ColumnPart> parts;
  Span<int> entries;
  Span<HullStructure> hulls;
  Span<HeightStructure> height_fields;
  int slots = 0;
  int convex = 0;             ///< pairs that are convex
  int turning_frictions = 0;  ///< slots of pairs that resist turning
  int passes = 0, rounds = 0;
  bool bounces = false;  ///< some pair has a restitution
};
template <class S>
struct ContactTables : ContactStructure {
  Span<ColliderPlace<S>> colliders;
  Span<TouchingPair<S>> pairs;
  Span<S> shape_numbers;
  S tolerance = 0;  ///< of a solve
  inline __attribute__((always_inline)) bool used() const { return pairs.count > 0; }
  /// Rows of a batch that remember contacts (kernels/contacts/memory.h): of slots, of pairs, the solver's velocities,
  /// the pieces of bounds and servos, the length of the step if that may differ, the state that they belong to, and a
  /// count.
  static constexpr int rows_of_slot = 4, rows_of_turning = 3, rows_of_pair = 15, rows_of_convex = 6;
  template <class Structure>
  inline __attribute__((always_inline)) int remembered(const Structure& t) const {
    return used() ? remembered_state(t) + t.joints + t.velocities + 7 * t.roots.count + places(t) + 1 : 0;
  }
  /// The first row of the state.
  template <class Structure>
  inline __attribute__((always_inline)) int remembered_state(const Structure& t) const {
    return rows_of_slot * slots + rows_of_turning * turning_frictions + rows_of_pair * pairs.count +
           rows_of_convex * convex + t.solver.n + t.bounds.single + t.limited_servos.count + (t.guarded ? 1 : 0);
  }

  /// Rows of where colliders stand, if that may differ.
  template <class Structure>
  inline __attribute__((always_inline)) int places(const Structure& t) const {
    return t.declares(Parameter::collider_place) ? 4 * colliders.count : 0;
  }

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.colliders, to.colliders), visit(from.pairs, to.pairs), visit(from.tolerance, to.tolerance);
    visit(from.shape_numbers, to.shape_numbers);
  }
};

template <class S>
inline __attribute__((always_inline)) HullTable<S> hull_of(const ContactTables<S>& t, int hull) {
  const HullStructure& at = t.hulls[hull];
  HullTable<S> table{at.corners, at.faces, at.face_corners};
  const S* next = &t.shape_numbers[at.first];
  for (int k = 0; k < 3; ++k, next += at.corners) table.corner[k] = next;
  for (int k = 0; k < 3; ++k, next += at.faces) table.normal[k] = next;
  for (int c = 0; c < at.face_corners; ++c, next += at.faces) table.face_corner[c] = next;
  return table;
}

template <class S>
inline __attribute__((always_inline)) HeightTable<S> height_field_of(const ContactTables<S>& t, int field) {
  const HeightStructure& at = t.height_fields[field];
  const S* const heights = &t.shape_numbers[at.first];
  return {at.columns, at.rows, heights, heights + at.columns * at.rows};
}

}  // namespace lockstep
