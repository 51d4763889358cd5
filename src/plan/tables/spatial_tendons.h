// Spatial tendons: segments between points of two bodies, and what moves these apart. SPDX-License-Identifier:
// Apache-2.0
#pragma once

#include "columns.h"

namespace lockstep {

/// The tendon's segments stand one after the other, and so do a segment's columns and a column's parts.
struct SpatialTendon {
  int joint, follower;  ///< its row of S is that of this follower
  int first, last;      ///< of SpatialTendonTables::segments; the last is one past the end
};
/// An entry of the tendon's row of S, and what it turns or moves of a segment's bodies.
struct SegmentColumn {
  int share;  ///< entry of S
  int first, last;
};

struct SegmentStructure {
  int first_body, second_body;  ///< -1: the world
  int first_column, last_column;
};
template <class S>
struct Segment : SegmentStructure {
  S first_point[3], second_point[3];  ///< in the body, or in the world
  S share;                            ///< of its length in the tendon's

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.first_point, to.first_point), visit(from.second_point, to.second_point);
    visit(from.share, to.share);
  }
};

struct SpatialTendonStructure {
  Span<SpatialTendon> tendons;
  Span<SegmentColumn> columns;
  Span<ColumnPart> parts;
  inline __attribute__((always_inline)) bool used() const { return tendons.count > 0; }
};
template <class S>
struct SpatialTendonTables : SpatialTendonStructure {
  Span<Segment<S>> segments;

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.segments, to.segments);
  }
};

}  // namespace lockstep
