// From all velocities to the solver's, and how A is reduced or factored without being computed.
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "rows.h"

namespace lockstep {

struct Collected {  ///< a product of S^T v: a follower's velocity, times an entry of S
  int velocity, value;
};

struct Momentum {  ///< an entry of A, times a follower's number
  int entry, follower;
};

/// Entries of A_r that are sums of the same number of products.
struct ProductGroup {
  int first, last, count;
};

/// Two branches of the tree meet: the content of one place is added to that of another.
struct Merge {
  int from, to;
};

/// How A_r is computed without A (M41). The columns of M S pass inwards from body to body; joints that move with one
/// velocity share a column. Each column has a place until it has passed its last body. Lists are by body, and empty for
/// trees of another InertiaKind.
struct CompositeColumns {
  struct Row {
    int place, entry, factor;
  };  ///< a column, and the entry to which its component along the joint is added
  struct Square {
    int entry, factor;
  };  ///< an entry to which the joint's own inertia is added
  struct Unit {
    int place, factor;
    bool first;
  };  ///< a column to which the joint's own column is added; `first`: nothing is there yet
  struct Factor {
    int left, right, times;
  };  ///< entries of S, -1 for 1
  struct Correction {
    int place;
    bool first;
  };  ///< the same for the column of the followers' corrections, if the position phase has a solution of its own
  int places = 0;
  Span<SupportRun> velocities;  ///< solver velocities of these trees
  Span<Factor> factors;
  Span<int> merge_start, row_start, pull_start, square_start, pulled_start, unit_start, passed_start;
  Span<Merge> merges;  ///< of columns of the same velocity
  Span<Row> rows;      ///< at the root, the factor is one of the root's velocities
  Span<Row> pulls;     ///< as rows, times the correction
  Span<Square> squares;
  Span<Square> pulled;  ///< as squares, times the correction
  Span<Unit> units;
  Span<Correction> correction;  ///< by body
  Span<int> passed;             ///< places of the columns that go on to the parent
};

/// A vector that passes inwards over articulated bodies, and the place of its wrench.
struct Carried {
  int place, vector;
};

/// A body that vectors pass. Those from `begin` on start there, those from `known` on come from bodies farther out.
struct Visit {
  int body;
  int merge_first, merge_last;  ///< in Articulated::merges, of the same vector; the last is one past the end
  int begin, known, last;       ///< in Articulated::carried
};

/// Visits from the leaves to the roots, including floating roots.
struct Path {
  int first, last;
};

/// How A is factored without being computed (M22 to M25), for trees with articulated bodies.
struct Articulated {
  Span<int> velocity;  ///< by body: the solver velocity of its joint, or the first of a floating root
  Span<Visit> visits;
  Span<Carried> carried;
  Span<Merge> merges;
  int places = 0;
  Path all = {0, 0};   ///< of one vector over all bodies; inertias use the same places
  Path rows = {0, 0};  ///< of the rows of Tables::rows
  Span<Path> bounds;   ///< by row of Bounds::rows
  Columns root;        ///< structure of a floating root's own block; the blocks of all roots follow each other
  inline __attribute__((always_inline)) bool used() const { return visits.count > 0; }
};

/// A follower with one leader: both joints, their coupling, the leader's term in it, and the entry of S.
struct Pair {
  int follower, leader, coupling, term, value;
};

/// A follower whose angle is its leader's or minus that when it is consistent. It takes sine and cosine from there.
struct Mirror {
  int body, leader;
  bool opposed;
};

/// The velocities in terms of the solver's velocities: v = S z, A_r = S^T A S. Either followers are eliminated (M39),
/// for `reduced`, or constraint velocities replace theirs (M77). Without followers, only the order of velocities
/// differs from that of A, for the fill of folded couplings (M95). Empty if A itself is factored.
struct ReductionStructure {
  int followers = 0;
  bool removes_by_force = false;  ///< bias forces remove followers' velocity error within a step
  CompositeColumns composite;
  inline __attribute__((always_inline)) bool used() const { return followers > 0 || independent.count > 0; }
  inline __attribute__((always_inline)) bool has_constraint_velocities() const { return constraint_velocity.count > 0; }
  inline __attribute__((always_inline)) bool eliminates() const {
    return followers > 0 && constraint_velocity.count == 0;
  }
  /// The velocity that solver velocity z is, unless it is a constraint velocity.
  inline __attribute__((always_inline)) int velocity_of(int z) const { return used() ? independent[z] : z; }
  /// A_r is computed from the entries of A, at least for some trees.
  inline __attribute__((always_inline)) bool by_entries() const { return product_entry.count > 0; }
  Span<int> constraint_velocity;    ///< by follower: the solver velocity that is its coupling's constraint velocity
  Span<int> measured_coupling;      ///< by follower: that coupling
  Span<int> follower;               ///< joint, by follower
  Span<int> follower_of;            ///< by joint: its number among the followers, -1 if independent
  Span<int> independent;            ///< velocity, by solver velocity
  Span<int> exact;                  ///< by follower: whether it always is where it belongs (M138), (M178)
  Span<int> start, column, leader;  ///< the followers' rows of S, sparse: solver velocity, and its joint, -1 for none
  Span<int> placing;                ///< couplings in an order in which each can place its follower (M76)
  Span<int> placed;                 ///< by follower: whether one of these places it
  bool all_placed = false;
  bool consistent_is_shorter = false;  ///< a step is shorter if all placed followers are consistent
  Span<Pair> pairs;                    ///< if all followers have one leader each
  Span<Mirror> mirrors;                ///< by ascending body
  Span<int> collect_start;             ///< by solver velocity: S^T, as followers' velocities and entries of S
  Span<Collected> collected;
  Span<int> momentum_start;  ///< by velocity: the followers with which it shares entries of A
  Span<Momentum> momentum;
  Span<int> inverse_start, inverse_coupling;  ///< inverse of J's follower columns, by follower
  Span<ProductGroup> product_groups;
  Span<int> product_entry;                ///< of A_r, in the order of their groups
  Span<int> product_start;                ///< in the same order
  Span<int> product_source;               ///< entry of A
  Span<int> product_left, product_right;  ///< the two entries of S that it is multiplied by; -1 stands for 1
  // With gear ratios per environment, or functions, this Gauss-Jordan elimination computes S for each lane: the rows of
  // followers of couplings, which stand before those of spatial tendons.
  struct Elimination {
    int factor, pivot, first, last;
  };  ///< one row minus factor/pivot times the pivot's row
  struct Update {
    int target, source;
  };
  int entries = 0;
  Span<Elimination> eliminations;
  Span<Update> updates;
  Span<int> pivot;        ///< by follower: entry of its pivot
  Span<int> value_entry;  ///< by value, which is minus this entry over the pivot
  Span<int> inverse_entry;
};

/// An initial entry of the elimination: the coefficient of a coupling's term, or `value` if `term` is -1.
struct FillStructure {
  int entry, term;
};
template <class S>
struct Fill : FillStructure {
  S value;

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.value, to.value);
  }
};

template <class S>
struct Reduction : ReductionStructure {
  Span<S> value;  ///< entries of S
  Span<S> inverse_value;
  Span<S> rate;  ///< erp / dt by coupling
  Span<S> product_value;
  Span<Fill<S>> fills;

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.value, to.value), visit(from.inverse_value, to.inverse_value), visit(from.rate, to.rate);
    visit(from.product_value, to.product_value), visit(from.fills, to.fills);
  }
};

}  // namespace lockstep
