// Loops: the frames that each holds together, and what moves them against each other. SPDX-License-Identifier:
// Apache-2.0
#pragma once

#include "columns.h"
#include "lockstep/enums.h"

namespace lockstep {

/// A frame of a loop is given in a link and placed in that link's body, or in the world.
struct LoopStructure {
  LoopKind kind;
  int first, second;  ///< bodies; -1: the world
  int row;            ///< its first row; those of the origins stand before those of the directions
  int translations, rotations;
  int column, columns;  ///< in LoopTables::columns
  int value;            ///< its first entry of J, row by row
  bool soft;            ///< its compliance is stated
  bool moves;           ///< each environment has a frame of its own, which may be moved between steps
  inline __attribute__((always_inline)) int rows() const { return translations + rotations; }
};
template <class S>
struct HeldLoop : LoopStructure {
  S first_rotation[9], first_offset[3];  ///< frame to body, or to the world
  S second_rotation[9], second_offset[3];
  S link_rotation[9], link_offset[3];  ///< first link to its body, or to the world
  S turn[9];                           ///< from a frame with z along the axis to the frame
  S rate, cfm, cfm_per_response;       ///< as those of RowSoftness
  S force, torque;                     ///< limits over a step, N s and N m s

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.first_rotation, to.first_rotation), visit(from.first_offset, to.first_offset);
    visit(from.second_rotation, to.second_rotation), visit(from.second_offset, to.second_offset);
    visit(from.link_rotation, to.link_rotation), visit(from.link_offset, to.link_offset);
    visit(from.turn, to.turn);
    visit(from.rate, to.rate), visit(from.cfm, to.cfm), visit(from.cfm_per_response, to.cfm_per_response);
    visit(from.force, to.force), visit(from.torque, to.torque);
  }
};

struct LoopTableStructure {
  Span<PairColumn> columns;  ///< of the solver's velocities
  Span<ColumnPart> parts;
  Span<int> bodies;  ///< that carry a loop's frames, parents before children
  int rows = 0, values = 0;
};
template <class S>
struct LoopTables : LoopTableStructure {
  Span<HeldLoop<S>> loops;
  inline __attribute__((always_inline)) bool used() const { return loops.count > 0; }

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.loops, to.loops);
  }
};

}  // namespace lockstep
