// The Newton rounds that solve bounds, kept couplings and contacts together. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "spans.h"

namespace lockstep {

/// A servo with an effort limit, where it acts on one velocity of the rounds.
struct LimitedServo {
  int velocity;
  int share;     ///< entry of S, -1 for 1
  int follower;  ///< -1 if the joint is independent
};

/// Which rows yield where not all can hold: the last of these first (section 27).
enum class Rank : int { coupling, limit, loop, drive };
constexpr int ranks = 4;

/// A row over several velocities: a coupling that is kept, a bound, or a row of a loop.
struct RowSlot {
  int bounded;      ///< row of Bounds::rows, -1 for others
  int coupling;     ///< row of Tables::rows, -1 for others
  int loop;         ///< row of LoopTables, -1 for others
  int first, last;  ///< in Rounds::term; the last is one past the end
  int value;        ///< place of the first term's value among those of its rows
  int entry;        ///< in Rounds::term_entry: by term, and term up to that one
  Rank rank;
};

struct CopiedEntry {
  int from, to;
};

/// A joint with damping, a spring or a servo, and the velocities of the rounds that it moves with.
struct ImplicitJoint {
  int joint;
  int first, last;  ///< in Rounds::implicit_term; the last is one past the end
  int entry;        ///< in Rounds::implicit_entry: by term, and term up to that one
};
struct ImplicitTerm {
  int velocity;
  int share;  ///< entry of S, -1 for 1
};

constexpr int drive_effort_rows = 3;     ///< numbers of a dof that a batch records of its drive
constexpr int contact_history_rows = 9;  ///< numbers of a pair that a batch records over calls
constexpr int kept_contact_rows = 4;     ///< those of them that go on from call to call
constexpr int solve_count_rows = 11;     ///< numbers of an environment's solves that a batch keeps

/// The matrix of a round is A_r with what slots and contacts fill in, so its velocities are numbered by a tree of their
/// own. Bounds alone fill in nothing and keep the numbers of the solver.
struct Rounds {
  Columns columns;
  bool renumbered = false;
  Span<int> place;                 ///< by velocity of the solver: its number in the rounds
  Span<CopiedEntry> from_reduced;  ///< entries of A_r
  Span<CopiedEntry> from_bodies;   ///< entries of A, for trees with articulated bodies
  Span<int> velocity;              ///< by row of Bounds::rows that bounds one velocity
  Span<int> row_of;                ///< by velocity: that row, -1 if none
  Span<LimitedServo> servos;       ///< by limited servo
  Span<RowSlot> slots;
  Span<int> term;                ///< velocity
  Span<int> term_entry;          ///< of the matrix
  bool in_stages = false;        ///< the stages of a leapfrog hold the bounds
  bool at_midpoint = false;      ///< a leapfrog has contacts, or bounds that its stages cannot hold
  Span<ImplicitJoint> implicit;  ///< if `at_midpoint`
  Span<ImplicitTerm> implicit_term;
  Span<int> implicit_entry;      ///< of the matrix
  bool needs_responses = false;  ///< the softness of some slot refers to its response under A
  inline __attribute__((always_inline)) bool used() const { return columns.n > 0; }
};

}  // namespace lockstep
