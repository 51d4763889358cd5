// Rows of couplings and of bounds. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "model/softness_kind.h"
#include "spans.h"

namespace lockstep {

struct SupportRange {
  int index;  ///< a velocity that the row's impulse moves
  int end;    ///< one past the last such velocity in the subtree of `index`
};

/// Consecutive velocities, or rows, that a row's impulse moves.
struct SupportRun {
  int first, last;  ///< `last` is one past the end
};

/// Consecutive rows that move almost the same velocities. Their responses are computed side by side.
struct RowGroup {
  static constexpr int most = 8;
  int first, count;
  bool articulated;                 ///< it moves trees with articulated bodies
  int support_first, support_last;  ///< in Rows::group_support: velocities that any of them moves
  int run_first, run_last;          ///< in Rows::group_runs
};

/// A block of K: entries between one or two rows and up to four rows that do not come after them.
struct RowBlock {
  static constexpr int most_rows = 2, most_columns = 4;
  int row, rows, column, columns;       ///< the first row and column, and how many of each
  int run_first, run_last;              ///< in Rows::block_runs: velocities that both sides may move
  int entry[most_rows][most_columns];   ///< place in K; -1 if the pair has none or belongs to another block
  int mirror[most_rows][most_columns];  ///< place of the mirrored entry, which is the same in packed storage
};

/// A summand of a row's term: the term of a coupling, times an entry of S. -1 stands for 1 in both.
struct Contribution {
  int term, value;
};

/// The softness of a row: compliance cfm + cfm_per_response * r, bias rate * C. Computed from Softness and the step.
struct RowSoftnessStructure {
  SoftnessKind kind;  ///< how to read the numbers of a softness field
  bool soft;          ///< its compliance does not count as 0
};
template <class S>
struct RowSoftness : RowSoftnessStructure {
  S rate, cfm, cfm_per_response;

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.rate, to.rate), visit(from.cfm, to.cfm), visit(from.cfm_per_response, to.cfm_per_response);
  }
};

/// Rows: linear functions of the solver's velocities.
struct RowStructure {
  int count = 0;
  Span<int> coupling;               ///< by row; -1 where the row is a joint's
  Span<int> term_start;             ///< by row, count + 1
  Span<int> term_index;             ///< solver velocity
  Span<int> contribution_start;     ///< by term, terms + 1
  Span<Contribution> contribution;  ///< summands of term_value, where S differs
  Span<int> support_start;          ///< by row, count + 1
  Span<SupportRange> support;       ///< ascending
  Span<int> run_start;              ///< by row, count + 1
  Span<SupportRun> runs;            ///< the velocities of `support` as runs
  Span<SupportRun> moved, unmoved;  ///< velocities that some row moves, and the others
  Span<RowGroup> groups;
  Span<SupportRange> group_support;
  Span<SupportRun> group_runs;
  Span<RowBlock> blocks;  ///< sorted by row
  Span<SupportRun> block_runs;
  bool dense = false;           ///< every entry of K is in a block
  Span<int> known;              ///< by solver velocity: the hard row whose constraint velocity it is, -1 if none (M79);
                                ///< empty if the method does not use this
  bool all_known = false;       ///< the constraint velocity of every row is known
  bool known_suffice = false;   ///< besides, `direct` needs no impulses of rows
  Span<int> neighbour_start;    ///< by row, count + 1
  Span<SupportRun> neighbours;  ///< rows that the row's impulse moves, if K is not factored
  int response_entries = 0;     ///< size of K's storage
  Columns columns;              ///< structure of K, for the methods that factor it
};
template <class S>
struct Rows : RowStructure {
  Span<S> term_value;
  Span<RowSoftness<S>> softness;  ///< by row

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.term_value, to.term_value), visit(from.softness, to.softness);
  }
};

/// What a bounded row holds: the hard bounds of a joint (or of all joints that move with one velocity), a soft limit, a
/// soft kinematic drive, a coupling with a force limit, a hard kinematic drive beside other rows, a servo with an
/// effort limit, or the range of a ball joint.
enum class BoundKind : int { joint, soft_limit, soft_drive, coupling, drive, servo, ball_range };

/// The hard bounds of a joint, as bits.
enum JointBound : int {
  has_range = 1,
  has_speed_limit = 2,
  has_friction = 4,
  has_kinematic_drive = 8,
  has_restitution = 16
};

/// A joint whose bounds a row holds.
struct Member {
  int joint, follower;  ///< follower: -1 if the joint is independent
  int share;            ///< entry of S; -1 stands for 1
};

/// A joint whose limits every step checks.
struct Watched {
  int joint;
  bool bounces;          ///< it has a restitution
  bool ranged, has_way;  ///< its position has limits, its velocity has one
};

/// Bounded rows: rows with an interval or a box (M54).
struct BoundStructure {
  Span<BoundKind> kind;    ///< by row
  Span<int> member_start;  ///< by row, rows + 1
  Span<Member> member;
  bool may_depend = false;  ///< the directions of hard rows may be linearly dependent
  int single = 0;           ///< where the plan has rounds: the first rows, which bound one velocity each
  Span<int> kinematic;      ///< by row: whether it holds a hard kinematic drive
  bool always = false;      ///< some row is active in every step: friction, a drive, a force limit, a limited servo
  Span<int> has;            ///< by joint: JointBound
  Span<int> undamped_row;   ///< by row, as Tables::undamped_row
  Span<Watched> watched;    ///< the joints with limits
};
template <class S>
struct Bounds : BoundStructure {
  Rows<S> rows;          ///< directions of the rows, and the softness of soft ones
  Span<S> member_share;  ///< the values of S
  // by joint; entries of bounds that a joint does not have are not read
  Span<S> lower, upper, limit_rate, restitution, speed_limit, friction, drive_rate;
  Span<S> sub_step_rate;  ///< limit_rate in the sub-steps of tgs
  Span<S> force_limit;    ///< by coupling
  Span<S> soft_rate;      ///< by row, for the whole step; the softness in `rows` is for a sub-step of tgs

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.rows, to.rows), visit(from.member_share, to.member_share);
    visit(from.lower, to.lower), visit(from.upper, to.upper), visit(from.limit_rate, to.limit_rate);
    visit(from.restitution, to.restitution), visit(from.speed_limit, to.speed_limit), visit(from.friction, to.friction);
    visit(from.drive_rate, to.drive_rate), visit(from.sub_step_rate, to.sub_step_rate);
    visit(from.force_limit, to.force_limit), visit(from.soft_rate, to.soft_rate);
  }
};

/// A row of the diagnostics, as users know it.
struct Reported {
  enum Kind : int { coupling, loop, position_limit, velocity_limit, friction, kinematic_drive, effort_limit };
  int kind;
  int index;    ///< coupling, loop or joint
  int row;      ///< row of Tables::rows, -1 if none
  int bounded;  ///< row of Bounds, -1 if none
  int member;   ///< of a coupling: 1 if it is hard; of an effort limit: the place among the limited servos; else -1
};

}  // namespace lockstep
