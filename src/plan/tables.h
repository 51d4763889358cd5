// The tables that kernels read: flat, constant, shared by all environments. SPDX-License-Identifier: Apache-2.0
//
// A Program (program.h) owns them; kernels see only this header, which knows no container.
// Indices: `joint` counts the moving joints in the solver's depth-first order; `velocity` counts the
// generalised velocities, a floating root's six first, then the joints; `dof` counts the moving joints
// in the Model's order, which is that of the views.
//
// Where a struct has numbers of type S, its structure is a base of its own, and numbers() names each number once:
// narrow.cpp makes single precision of them and asserts that none is forgotten.
#pragma once

#include <cstdint>

#include "lockstep/enums.h"
#include "model/softness_kind.h"

namespace lockstep {

/// Stands for infinity in tables, where it can be scaled by any step size or gear ratio in single precision.
constexpr double unlimited = 1e25;

/// gamma of (M69): how much of a step its implicit stages go.
constexpr double alexander_gamma = 0.43586652150845899942;

template <class E>
struct Span {
  const E* data = nullptr;
  int count = 0;
  inline __attribute__((always_inline)) const E& operator[](int i) const { return data[i]; }
};

/// Structure of a sparse symmetric matrix H = L^T D L whose column j holds the rows j to j + size[j] - 1,
/// contiguous from offset[j]: an elimination tree numbered depth first, in which subtrees are ranges.
/// The mass matrix has that structure without fill-in (Featherstone 2008, section 6.5).
struct Columns {
  int n = 0;
  int entries = 0;
  Span<int> parent;     ///< -1 for a root of the tree
  Span<int> size;       ///< of the subtree, itself included
  Span<int> offset;     ///< of column j's diagonal
  Span<int> row_start;  ///< n + 1
  Span<int> row;        ///< entries of row i in the columns of its ancestors, the nearest first
};

/// One rigid body and the joint that carries it, in frames in which the joint's axis is a coordinate axis.
struct BodyStructure {
  int parent;  ///< body, -1 for the fixed world
  int axis;    ///< 0, 1, 2
  bool prismatic;
  bool rotated;   ///< there is a constant rotation before the joint's own
  bool root;      ///< the floating root: no joint
  int kind;       ///< of all these and of the offset: what kernels::with_joint() switches over
  bool first;     ///< of its parent's children it is the first to be added, from the leaves to the root
  bool leaf;      ///< it carries no others
  bool heavy;     ///< base_mass of it or of a body that it carries is not zero
  bool diagonal;  ///< base_second is, in every environment
};
template <class S>
struct Body : BodyStructure {
  S sign;                                       ///< the joint's axis is sign times the coordinate axis
  S rotation[9];                                ///< parent coordinates to joint coordinates at q = 0, row-major
  S offset[3];                                  ///< origin in the parent frame at q = 0
  S mass, moment[3], second[6];                 ///< pseudo-inertia about the origin, see simd/vec3.h
  S base_mass, base_moment[3], base_second[6];  ///< with what lies on joints' axes moved inwards (M10)

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.sign, to.sign), visit(from.rotation, to.rotation), visit(from.offset, to.offset);
    visit(from.mass, to.mass), visit(from.moment, to.moment), visit(from.second, to.second);
    visit(from.base_mass, to.base_mass), visit(from.base_moment, to.base_moment),
        visit(from.base_second, to.base_second);
  }
};

/// What is known of a joint and its body's offset when compiling. A revolute joint without a constant rotation has
/// 3 axis + one of the first three: the offset is along the next axis, the last one, or both.
enum BodyKind : int {
  next_axis,
  last_axis,
  both_axes,
  turned_joint = 9,
  sliding_joint = 10,
  turned_sliding_joint = 13
};

/// A link of the model in its body: where it is, and what a kilogram of it contributes.
struct LinkStructure {
  int body;  ///< -1: part of the fixed world
};
template <class S>
struct LinkPlace : LinkStructure {
  S rotation[9];  ///< link coordinates to body coordinates, row-major
  S offset[3];
  S unit_moment[3], unit_second[6];  ///< per kg, about the body's origin, or the fixed root's

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.rotation, to.rotation), visit(from.offset, to.offset);
    visit(from.unit_moment, to.unit_moment), visit(from.unit_second, to.unit_second);
  }
};

struct SupportRange {
  int index;  ///< a velocity that the row's impulse moves
  int end;    ///< one past the last such velocity in index's subtree
};

/// Consecutive velocities, or rows, that a row's impulse moves.
struct SupportRun {
  int first, last;  ///< last is one past
};

/// Consecutive rows that move much the same velocities: their responses are found side by side.
struct RowGroup {
  static constexpr int most = 8;
  int first, count;
  int support_first, support_last;  ///< in Rows::group_support: what any of them moves
  int run_first, run_last;          ///< in Rows::group_runs
};

/// Entries of K between one row, or two, and a few that are not behind the last of these.
struct RowBlock {
  static constexpr int most_rows = 2, most_columns = 4;
  int row, rows, column, columns;       ///< the first of either, and how many
  int run_first, run_last;              ///< in Rows::block_runs: velocities that may be moved by both
  int entry[most_rows][most_columns];   ///< where K stands, -1 for a pair that has none or is another block's
  int mirror[most_rows][most_columns];  ///< and its mirror image (the same for packed storage)
};

/// A share of a row's term: term of a coupling, times an entry of S; -1 stands for 1 in both.
struct Contribution {
  int term, value;
};

/// How soft a row is: cfm + cfm_per_response * r, and bias = rate * C. Made of Softness and the step.
struct RowSoftnessStructure {
  SoftnessKind kind;  ///< for fields that change the numbers per environment
};
template <class S>
struct RowSoftness : RowSoftnessStructure {
  S rate, cfm, cfm_per_response;

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.rate, to.rate), visit(from.cfm, to.cfm), visit(from.cfm_per_response, to.cfm_per_response);
  }
};

/// Linear functions of the solver's velocities: the couplings that are left to solve.
struct RowStructure {
  int count = 0;
  Span<int> coupling;               ///< by row; -1 where the row is a joint's
  Span<int> term_start;             ///< by row, count + 1
  Span<int> term_index;             ///< solver velocity
  Span<int> contribution_start;     ///< by term, terms + 1; what term_value is made of, for gear ratios
  Span<Contribution> contribution;  ///< that differ per environment
  Span<int> support_start;          ///< by row, count + 1
  Span<SupportRange> support;       ///< ascending
  Span<int> run_start;              ///< by row, count + 1
  Span<SupportRun> runs;            ///< the same velocities as runs
  Span<RowGroup> groups;
  Span<SupportRange> group_support;
  Span<SupportRun> group_runs;
  Span<RowBlock> blocks;  ///< by their rows
  Span<SupportRun> block_runs;
  bool dense = false;           ///< every entry of K is in a block
  Span<int> known;              ///< by solver velocity: the hard row whose constraint velocity it is, -1 if none,
                                ///< where rows leave their velocities behind (M79)
  bool all_known = false;       ///< of every row
  bool known_suffice = false;   ///< and direct asks for these velocities alone: nobody needs the rows' impulses
  Span<int> neighbour_start;    ///< by row, count + 1
  Span<SupportRun> neighbours;  ///< rows that its impulse moves, where K is not factored
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

/// What a bounded row is made of: the hard bounds of one joint (or of all that move with one velocity), or one of
/// the others.
enum class BoundKind : int { joint, soft_limit, soft_drive, coupling };

/// What a joint has, as bits.
enum JointBound : int {
  has_range = 1,
  has_speed_limit = 2,
  has_friction = 4,
  has_kinematic_drive = 8,
  has_restitution = 16
};

/// A joint whose bounds are in a row.
struct Member {
  int joint, follower;  ///< follower: -1 if it moves with a velocity of its own
  int share;            ///< entry of S, -1 stands for 1
};

/// A joint whose limits are looked at in every step.
struct WatchedStructure {
  int joint;
  bool bounces;
};
template <class S>
struct Watched : WatchedStructure {
  S lower, upper;
  S way;  ///< that it may go in a step, 0 where its speed has no limit

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.lower, to.lower), visit(from.upper, to.upper), visit(from.way, to.way);
  }
};

/// Rows with an interval or a box (M54).
struct BoundStructure {
  Span<BoundKind> kind;    ///< by row
  Span<int> member_start;  ///< by row, rows + 1
  Span<Member> member;
  bool may_depend = false;  ///< directions of hard intervals may depend on each other
  Span<int> kinematic;      ///< by row: it holds a hard kinematic drive
  bool always = false;      ///< some row is active in every step: friction, a kinematic drive, a force limit
  Span<int> has;            ///< by joint: JointBound
  Span<int> undamped_row;   ///< by row, as Tables::undamped_row
};
template <class S>
struct Bounds : BoundStructure {
  Rows<S> rows;              ///< directions, and the softness of those that have one
  Span<S> member_share;      ///< the values of S
  Span<Watched<S>> watched;  ///< the joints with limits
  // by joint; what a joint has not is not read
  Span<S> lower, upper, limit_rate, restitution, speed_limit, friction, drive_rate;
  Span<S> sub_step_rate;  ///< limit_rate in the sub-steps of tgs
  Span<S> force_limit;    ///< by coupling
  Span<S> soft_rate;      ///< by row, of the whole step; its softness in `rows` is that of a sub-step of tgs

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.rows, to.rows), visit(from.member_share, to.member_share), visit(from.watched, to.watched);
    visit(from.lower, to.lower), visit(from.upper, to.upper), visit(from.limit_rate, to.limit_rate);
    visit(from.restitution, to.restitution), visit(from.speed_limit, to.speed_limit), visit(from.friction, to.friction);
    visit(from.drive_rate, to.drive_rate), visit(from.sub_step_rate, to.sub_step_rate);
    visit(from.force_limit, to.force_limit), visit(from.soft_rate, to.soft_rate);
  }
};

/// A line of a report: a row as users know it.
struct Reported {
  enum Kind : int { coupling, position_limit, velocity_limit, friction, kinematic_drive, effort_limit };
  int kind;
  int index;    ///< coupling, or joint
  int row;      ///< of Rows for couplings, -1 if none; of Bounds for the others
  int bounded;  ///< row of Bounds, -1 if none
  int member;   ///< for couplings 1 if it is hard; for effort limits the place among the limited drives, or -1
};

struct Collected {  ///< by S^T: a follower's velocity, times an entry of S
  int velocity, value;
};

struct Momentum {  ///< an entry of A, times a follower's number
  int entry, follower;
};

/// Entries that are sums of the same number of products.
struct ProductGroup {
  int first, last, count;
};

/// Places whose contents come together.
struct Merge {
  int from, to;
};

/// How A_r is made without A (M41): columns of M S, which joints that share a velocity share, on their way inwards. A
/// column stands in a place until it has left the tree. Lists are by body. Used where there are places.
struct CompositeColumns {
  struct Row {
    int place, entry, factor;
  };  ///< the column's component along the joint, and the entry it goes to
  struct Square {
    int entry, factor;
  };  ///< where the inertia of the joint alone goes
  struct Unit {
    int place, factor;
    bool first;
  };  ///< where the joint's own column goes
  struct Factor {
    int left, right, times;
  };  ///< entries of S, -1 for 1
  // of followers, where positions are corrected by a solution of their own
  struct Correction {
    int place;
    bool first;
  };  ///< where the joint's own column goes, times its correction
  int places = 0;
  Span<Factor> factors;
  Span<int> merge_start, row_start, pull_start, square_start, pulled_start, unit_start, passed_start;
  Span<Merge> merges;  ///< of one velocity, out of two branches
  Span<Row> rows;      ///< the root's have one of its velocities for a factor
  Span<Row> pulls;     ///< the same, times the correction
  Span<Square> squares;
  Span<Square> pulled;  ///< the same, times the correction
  Span<Unit> units;
  Span<Correction> correction;  ///< by body
  Span<int> passed;             ///< places of what goes on to the parent
};

/// A vector on its way inwards over articulated bodies, and where the wrench that it has become stands.
struct Carried {
  int place, vector;
};

/// A body that they come to. Those from `begin` on begin there, those from `known` on come from bodies farther out.
struct Visit {
  int body;
  int merge_first, merge_last;  ///< the last is one past, in Articulated::merges: of one vector, out of two branches
  int begin, known, last;       ///< in Articulated::carried
};

/// Visits from the leaves to the root, a floating root's among them.
struct Path {
  int first, last;
};

/// How A is factored without being made, where that is less work (M22 to M25). Used where there are visits.
struct Articulated {
  Span<Visit> visits;
  Span<Carried> carried;
  Span<Merge> merges;
  int places = 0;
  Path all = {0, 0};   ///< of one vector over all bodies; inertias take the same places
  Path rows = {0, 0};  ///< of Tables::rows
  Span<Path> bounds;   ///< by row of Bounds::rows
  Columns root;        ///< structure of a floating root's own part
  inline __attribute__((always_inline)) bool used() const { return visits.count > 0; }
};

/// A follower of one leader: indices of joints, coupling, its coefficient and the entry of S.
struct Pair {
  int follower, leader, coupling, term, value;
};

/// A follower whose angle, where it is consistent, is its leader's or minus that: so are sine and cosine.
struct Mirror {
  int body, leader;
  bool opposed;
};

/// The velocities in terms of those that are solved for: v = S z, A_r = S^T A S. Either followers are eliminated (M39),
/// for `reduced`, or constraint velocities stand for them (M77); empty where A itself is factored.
struct ReductionStructure {
  int followers = 0;
  bool removes_by_force = false;  ///< bias forces remove followers' velocity error within a step
  CompositeColumns composite;
  inline __attribute__((always_inline)) bool has_constraint_velocities() const { return constraint_velocity.count > 0; }
  inline __attribute__((always_inline)) bool eliminates() const {
    return followers > 0 && constraint_velocity.count == 0;
  }
  /// A_r is made of A's entries.
  inline __attribute__((always_inline)) bool by_entries() const { return followers > 0 && composite.places == 0; }
  Span<int> constraint_velocity;       ///< by follower: the solver velocity that is its coupling's
  Span<int> measured_coupling;         ///< and that coupling
  Span<int> follower;                  ///< joint, by follower
  Span<int> follower_of;               ///< by joint: its number among the followers, -1 if independent
  Span<int> independent;               ///< velocity, by solver velocity
  Span<int> start, column, leader;     ///< rows of S that belong to followers, sparse: solver velocity, and its joint
  Span<int> placing;                   ///< couplings that place their followers (M76), behind those that they wait for
  bool consistent_is_shorter = false;  ///< a step is shorter where all followers are consistent
  Span<Pair> pairs;                    ///< if all followers have one leader each
  Span<Mirror> mirrors;                ///< by ascending body
  Span<int> collect_start;             ///< by solver velocity: S^T, as followers' velocities and entries of S
  Span<Collected> collected;
  Span<int> momentum_start;  ///< by velocity: the followers that it shares entries of A with
  Span<Momentum> momentum;
  Span<int> inverse_start, inverse_coupling;  ///< inverse of J's follower columns: error by follower
  Span<ProductGroup> product_groups;          ///< entries of A_r that are sums of so many products
  Span<int> product_entry;                    ///< of A_r, in the order of their groups
  Span<int> product_start;                    ///< in the same order
  Span<int> product_source;                   ///< entry of A
  Span<int> product_left, product_right;      ///< the two entries of S whose product it is; -1 stands for 1
  // With gear ratios per environment, S is found lane by lane by this Gauss-Jordan elimination.
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
  Span<int> value_entry;  ///< by value: entry that it is minus pivot's share of
  Span<int> inverse_entry;
};

/// An entry that the elimination begins with: a field's row, or the value where `gear` is -1.
struct FillStructure {
  int entry, gear;
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

struct TableStructure {
  Method method = Method::direct;
  Integrator integrator = Integrator::euler;
  int input_times = 1;  ///< so many of the step's times have targets and efforts of their own
  int iterations = 0, velocity_iterations = 0;
  bool floating = false;
  int bodies = 0, joints = 0, velocities = 0, couplings = 0, links = 0;
  Span<int> dof;                                ///< by joint
  Columns matrix;                               ///< structure of the mass matrix
  Columns solver;                               ///< structure of the matrix that is factored: of A or of A_r
  Span<int> servos;                             ///< joints that have a servo without an effort limit
  Span<int> limited_servos;                     ///< joints that have a servo with an effort limit
  Span<int> limited_efforts;                    ///< joints without a servo whose effort is limited, in order
  Span<int> term_start, term_joint, term_gear;  ///< couplings in joint space; gear: row of the gear_ratio field, -1 for
                                                ///< the leading 1
  Articulated articulated;
  Span<Reported> reported;  ///< only if diagnostics are recorded
  Span<int> follows;       ///< by coupling: 1 if it is redundant and takes no impulse; only if diagnostics are recorded
  Span<int> undamped_row;  ///< by row of `rows`: its row in `undamped`, -1 if none
  bool solve_twice = false;      ///< the position phase and the velocity phase have different solutions
  bool renewed = false;          ///< tgs: rows are renewed in every sub-step
  unsigned per_environment = 0;  ///< declared fields, bit by Parameter
  bool record_impulses = false;
  bool record_diagnostics = false;

  inline __attribute__((always_inline)) bool declares(Parameter parameter) const {
    return (per_environment >> static_cast<unsigned>(parameter)) & 1u;
  }
  /// A floating root's, which come first.
  inline __attribute__((always_inline)) int root_velocities() const { return velocities - joints; }
  inline __attribute__((always_inline)) int velocity_of(int joint) const { return root_velocities() + joint; }
};

template <class S>
struct Tables : TableStructure {
  const Tables* half = nullptr;  ///< of half the step, for the integrator that takes both
  S dt = 0;                      ///< how far a solve goes: the step, or gamma of it (M68)
  S step = 0;                    ///< the step
  S ahead = 0;                   ///< how far ahead linear terms are taken: dt, or 0 where they are explicit
  S position_bound = 0, velocity_bound = 0;
  S gravity[3] = {};  ///< in the root's frame if the root is fixed, else in the world's
  S world_gravity[3] = {};
  S root_rotation[9] = {};  ///< of a fixed root: its coordinates to the world's
  S root_offset[3] = {};
  S free_share = 1;  ///< share of the free motion that moves positions: (N + 1) / 2N in tgs
  Span<Body<S>> body;
  Span<LinkPlace<S>> link;
  Span<S> link_mass;
  Span<S> armature, damping, kp, kd;  ///< by joint
  Span<S> implicit;                   ///< armature + dt (damping + kd) + dt^2 kp, by joint
  Span<S> effort_limit;               ///< by joint
  Span<S> term_value, offset;         ///< of couplings in joint space
  Rows<S> rows;
  Bounds<S> bounds;
  Reduction<S> reduction;
  Span<S> hard_rate;  ///< erp / dt by coupling, 0 for soft ones: only if diagnostics are recorded
  Rows<S> undamped;   ///< rows whose softness refers to M + armature, where A holds more than that

  /// The mass matrix is made, be it only for undamped rows.
  inline __attribute__((always_inline)) bool makes_matrix() const { return !articulated.used() || undamped.count > 0; }

  /// All but `half`.
  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.dt, to.dt), visit(from.step, to.step), visit(from.ahead, to.ahead);
    visit(from.position_bound, to.position_bound), visit(from.velocity_bound, to.velocity_bound);
    visit(from.gravity, to.gravity), visit(from.world_gravity, to.world_gravity);
    visit(from.root_rotation, to.root_rotation), visit(from.root_offset, to.root_offset);
    visit(from.free_share, to.free_share), visit(from.body, to.body), visit(from.link, to.link);
    visit(from.link_mass, to.link_mass), visit(from.armature, to.armature), visit(from.damping, to.damping);
    visit(from.kp, to.kp), visit(from.kd, to.kd), visit(from.implicit, to.implicit);
    visit(from.effort_limit, to.effort_limit), visit(from.term_value, to.term_value), visit(from.offset, to.offset);
    visit(from.rows, to.rows), visit(from.bounds, to.bounds), visit(from.reduction, to.reduction);
    visit(from.hard_rate, to.hard_rate), visit(from.undamped, to.undamped);
  }
};

}  // namespace lockstep
