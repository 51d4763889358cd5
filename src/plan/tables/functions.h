// Followers that are functions of one joint. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "spans.h"

namespace lockstep {

enum class FunctionKind : int { polynomial, table, harmonic };

/// The function of a coupling. Its numbers stand one after the other: coefficients; followers' positions at the points
/// of a table; mean, cosine and sine.
struct FunctionPlace {
  FunctionKind kind;
  int coupling, leader;  ///< the joint that it is a function of
  int term;              ///< the leader's term of the coupling
  int first, count;      ///< its numbers: in FunctionTables::number, and rows of Parameter::function
  int constant;          ///< in FunctionTables::constant: the leader's positions of a table, or the rate of a harmonic
  int piece;             ///< the first number of a table's pieces, in FunctionTables::piece
};

struct FunctionStructure {
  Span<FunctionPlace> places;
  Span<int> of_coupling;  ///< by coupling: in `places`, -1 if it is linear
  Span<int> placing;      ///< couplings that place a curved follower, in an order in which each can (M138)
  Span<int> curved;       ///< by coupling: whether it is one of these
  inline __attribute__((always_inline)) bool used() const { return places.count > 0; }
};
template <class S>
struct FunctionTables : FunctionStructure {
  Span<S> number, constant;
  Span<S> piece;  ///< of tables: four numbers by point

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.number, to.number), visit(from.constant, to.constant), visit(from.piece, to.piece);
  }
};

}  // namespace lockstep
