// The tables that kernels read: flat, constant, shared by all environments. SPDX-License-Identifier: Apache-2.0
//
// A Program (program.h) owns them. Kernels see only this header, which uses no containers.
// This file is longer than 450 lines because it only declares: one place lists all that a kernel can read.
//
// Indices: `joint` counts the moving joints in the solver's depth-first order, tree by tree; `velocity` counts the
// generalised velocities, tree by tree: a floating root's six, then the tree's joints; `dof` counts the moving joints
// in the Model's order, which is that of the views. Views have the floating roots in the order of Model::roots.
//
// A struct with numbers of type S has a base class for everything else. Its numbers() names each number once:
// narrow.cpp converts them to single precision and asserts that none is forgotten.
#pragma once

#include <cstdint>

#include "lockstep/enums.h"
#include "model/softness_kind.h"

namespace lockstep {

/// Stands for infinity in tables: any step size or gear ratio can scale it in single precision.
constexpr double unlimited = 1e25;

/// A smaller compliance counts as 0.
constexpr double smallest_compliance = 1e-30;

/// gamma of (M69): the share of a step that an implicit stage covers.
constexpr double alexander_gamma = 0.43586652150845899942;

template <class E>
struct Span {
  const E* data = nullptr;
  int count = 0;
  inline __attribute__((always_inline)) const E& operator[](int i) const { return data[i]; }
};

/// Structure of a sparse symmetric matrix H = L^T D L. Column j holds the rows j to j + size[j] - 1, contiguous from
/// offset[j]: its elimination tree is numbered depth first, so subtrees are ranges. The mass matrix has this structure
/// without fill-in (Featherstone 2008, section 6.5).
struct Columns {
  int n = 0;
  int entries = 0;
  Span<int> parent;     ///< -1 for a root of the tree
  Span<int> size;       ///< of the subtree, including its root
  Span<int> offset;     ///< of column j's diagonal
  Span<int> row_start;  ///< n + 1
  Span<int> row;        ///< entries of row i in the columns of its ancestors, the nearest first
};

/// One rigid body and the joint that carries it. The joint's axis is a coordinate axis of the body's frame.
struct BodyStructure {
  int parent;  ///< body, -1 for the fixed world
  int tree;
  int velocity;  ///< of its joint, or the first of a floating root's six
  int joint;     ///< for a floating root: its number among these
  int axis;      ///< 0, 1, 2
  bool prismatic;
  bool rotated;   ///< a constant rotation comes before the joint's own
  bool root;      ///< a floating root, which has no joint
  int kind;       ///< BodyKind: what kernels::with_joint() switches over
  bool first;     ///< the first of its parent's children in the order from the leaves to the root
  bool leaf;      ///< it carries no other body
  bool heavy;     ///< base_mass is not zero, for it or for a body that it carries
  bool diagonal;  ///< base_second is diagonal in every environment
};
template <class S>
struct Body : BodyStructure {
  S sign;                                       ///< the joint's axis is sign times the coordinate axis
  S rotation[9];                                ///< parent coordinates to joint coordinates at q = 0, row-major
  S offset[3];                                  ///< origin in the parent frame at q = 0
  S mass, moment[3], second[6];                 ///< pseudo-inertia about the origin, see simd/vec3.h
  S base_mass, base_moment[3], base_second[6];  ///< base inertia: mass on joint axes is moved inwards (M10)

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.sign, to.sign), visit(from.rotation, to.rotation), visit(from.offset, to.offset);
    visit(from.mass, to.mass), visit(from.moment, to.moment), visit(from.second, to.second);
    visit(from.base_mass, to.base_mass), visit(from.base_moment, to.base_moment),
        visit(from.base_second, to.base_second);
  }
};

/// A joint and the direction of its body's offset. A revolute joint without a constant rotation has 3 * axis plus one
/// of the first three: its offset lies along the next axis, the last one, or both. A prismatic joint without a constant
/// rotation has sliding_joint + axis.
enum BodyKind : int {
  next_axis,
  last_axis,
  both_axes,
  turned_joint = 9,
  sliding_joint = 10,
  turned_sliding_joint = 13
};

/// A link of the model in its body: where it is, and the inertia of one kilogram of it.
struct LinkStructure {
  int body;  ///< -1: bolted to the world
  int tree;
};
template <class S>
struct LinkPlace : LinkStructure {
  S rotation[9];  ///< link coordinates to body coordinates, row-major
  S offset[3];
  S unit_moment[3], unit_second[6];  ///< per kg, about the body's origin, or a bolted root's
  S spread[6];  ///< the second moment about the centre of mass, in the link's axes; per kg if masses differ

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.rotation, to.rotation), visit(from.offset, to.offset);
    visit(from.unit_moment, to.unit_moment), visit(from.unit_second, to.unit_second);
    visit(from.spread, to.spread);
  }
};

/// A floating root: its body, the first of its six velocities, and its number among the solver's velocities.
struct FloatingRoot {
  int body, velocity, solver;
};

/// How the inertia of a tree enters a step: as its part of A, from which A_r follows (M40); as A_r at once, by
/// composite columns (M41); or by articulated bodies, which factor A without computing it (M22). Trees that couplings
/// join have the same. No other tree changes the choice, so a tree steps with the bits that it has alone.
enum class InertiaKind : int { matrix, composite_columns, articulated_bodies };

/// A tree of links. Its bodies and its joints are consecutive.
struct TreeStructure {
  InertiaKind inertia;
  bool has_undamped_rows;
  int root;                     ///< number among the floating roots, -1 if bolted
  int first_body, last_body;    ///< the last is one past the end
  int first_joint, last_joint;  ///< the same
};
template <class S>
struct TreePlace : TreeStructure {
  S rotation[9];  ///< of a bolted root: its coordinates to world coordinates, row-major
  S offset[3];    ///< the same
  S gravity[3];   ///< along the axes of a bolted root; of a floating one, along the world's

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.rotation, to.rotation), visit(from.offset, to.offset), visit(from.gravity, to.gravity);
  }
};

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
  Span<Contribution> contribution;  ///< summands of term_value, for gear ratios that differ per environment
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
/// soft kinematic drive, or a coupling with a force limit.
enum class BoundKind : int { joint, soft_limit, soft_drive, coupling };

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
  bool may_depend = false;   ///< the directions of hard rows may be linearly dependent
  Span<int> kinematic;       ///< by row: whether it holds a hard kinematic drive
  bool always = false;       ///< some row is active in every step: friction, a kinematic drive, a force limit
  Span<int> has;             ///< by joint: JointBound
  Span<int> undamped_row;    ///< by row, as Tables::undamped_row
  bool by_velocity = false;  ///< each row and each limited servo acts on one velocity (held_velocities.h)
  Span<int> velocity;        ///< by row, then: of the solver
  Span<int> row_of;          ///< by solver velocity, then: its row, -1 if none
  Span<Watched> watched;     ///< the joints with limits
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
  enum Kind : int { coupling, position_limit, velocity_limit, friction, kinematic_drive, effort_limit };
  int kind;
  int index;    ///< coupling, or joint
  int row;      ///< row of Tables::rows, -1 if none
  int bounded;  ///< row of Bounds, -1 if none
  int member;   ///< of a coupling: 1 if it is hard; of an effort limit: the place among the limited servos; else -1
};

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
/// for `reduced`, or constraint velocities replace theirs (M77). Empty if A itself is factored.
struct ReductionStructure {
  int followers = 0;
  bool removes_by_force = false;  ///< bias forces remove followers' velocity error within a step
  CompositeColumns composite;
  inline __attribute__((always_inline)) bool has_constraint_velocities() const { return constraint_velocity.count > 0; }
  inline __attribute__((always_inline)) bool eliminates() const {
    return followers > 0 && constraint_velocity.count == 0;
  }
  /// A_r is computed from the entries of A, at least for some trees.
  inline __attribute__((always_inline)) bool by_entries() const { return product_entry.count > 0; }
  Span<int> constraint_velocity;    ///< by follower: the solver velocity that is its coupling's constraint velocity
  Span<int> measured_coupling;      ///< by follower: that coupling
  Span<int> follower;               ///< joint, by follower
  Span<int> follower_of;            ///< by joint: its number among the followers, -1 if independent
  Span<int> independent;            ///< velocity, by solver velocity
  Span<int> start, column, leader;  ///< the followers' rows of S, sparse: solver velocity, and its joint
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
  // With gear ratios per environment, this Gauss-Jordan elimination computes S for each lane.
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

/// An initial entry of the elimination: a row of the gear_ratio field, or `value` if `gear` is -1.
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

/// A servo with an effort limit, where it acts on one velocity of the solver.
struct LimitedServo {
  int velocity;
  int share;     ///< entry of S, -1 for 1
  int follower;  ///< -1 if the joint is independent
};

struct TableStructure {
  Method method = Method::direct;
  Integrator integrator = Integrator::euler;
  int input_times = 1;  ///< how many of the step's times have targets and efforts of their own
  int iterations = 0, velocity_iterations = 0;
  int bodies = 0, joints = 0, velocities = 0, couplings = 0, links = 0;
  Span<FloatingRoot> roots;                     ///< in the order of the views
  bool makes_matrix = true;                     ///< A is computed, if only for some trees or for undamped rows
  Span<int> dof, joint_velocity, joint_body;    ///< by joint
  Columns matrix;                               ///< structure of the mass matrix
  Columns solver;                               ///< structure of the matrix that is factored: A or A_r
  Span<SupportRun> factored;                    ///< its velocities, but for those of articulated bodies
  Span<SupportRun> undamped_velocities;         ///< velocities of trees with undamped rows
  Span<int> servos;                             ///< joints that have a servo without an effort limit
  Span<int> limited_servos;                     ///< joints that have a servo with an effort limit
  Span<LimitedServo> servo_velocities;          ///< of these, if Bounds::by_velocity
  Span<int> springs;                            ///< joints that have a spring
  Span<int> turning;                            ///< joints that turn for ever (M80)
  Span<SupportRun> turning_runs, other_runs;    ///< the same as runs, and those of the other joints
  Span<int> turns;                              ///< by joint: whether it turns for ever; empty if none does
  Span<int> coupling_turns, turning_couplings;  ///< the same for couplings of such joints, and a list of these
  Span<int> turning_placed;                     ///< those that place a follower, in their order in `placing`
  Span<double> exact_ratio, exact_offset;       ///< term_value and offset, in double
  Span<int> limited_efforts;                    ///< joints without a servo whose effort is limited
  Span<int> term_start, term_joint, term_gear;  ///< couplings in joint space; gear: row of the gear_ratio field, -1 for
                                                ///< the leading 1
  Articulated articulated;
  Span<Reported> reported;       ///< only if diagnostics are recorded
  Span<int> follows;             ///< by coupling: 1 if it is redundant and takes no impulse
  Span<int> undamped_row;        ///< by row of `rows`: its row in `undamped`, -1 if none
  bool solve_twice = false;      ///< the position phase and the velocity phase have different solutions
  bool renewed = false;          ///< tgs: every sub-step computes its rows anew
  unsigned per_environment = 0;  ///< declared fields, bit by Parameter
  bool record_impulses = false;
  bool record_diagnostics = false;

  inline __attribute__((always_inline)) bool declares(Parameter parameter) const {
    return (per_environment >> static_cast<unsigned>(parameter)) & 1u;
  }
  /// Whether masses, centres of mass or inertias differ per environment.
  inline __attribute__((always_inline)) bool has_own_inertias() const {
    return declares(Parameter::mass) || declares(Parameter::center_of_mass) || declares(Parameter::inertia);
  }
  inline __attribute__((always_inline)) int velocity_of(int joint) const { return joint_velocity[joint]; }
};

template <class S>
struct Tables : TableStructure {
  const Tables* half = nullptr;  ///< tables of half the step, for Integrator::extrapolated
  S dt = 0;                      ///< length of a solve: the step, or gamma times the step (M68)
  S step = 0;                    ///< the step
  S ahead = 0;                   ///< how far ahead linear terms are taken: dt, or 0 if they are explicit
  S position_bound = 0, velocity_bound = 0;
  S gravity[3] = {};  ///< world axes
  S free_share = 1;   ///< share of the free motion that moves positions: (N + 1) / 2N in tgs
  Span<TreePlace<S>> tree;
  Span<Body<S>> body;
  Span<LinkPlace<S>> link;
  Span<S> link_mass;
  Span<S> armature, damping, kp, kd;  ///< by joint
  Span<S> stiffness, rest;            ///< of springs, by joint
  Span<S> implicit;                   ///< armature + dt (damping + kd) + dt^2 (kp + stiffness), by joint
  Span<S> effort_limit;               ///< by joint
  Span<S> term_value, offset;         ///< of couplings in joint space
  Rows<S> rows;
  Bounds<S> bounds;
  Reduction<S> reduction;
  Span<S> hard_rate;  ///< erp / dt by coupling, 0 for soft ones
  Rows<S> undamped;   ///< rows whose softness refers to the undamped inertia, if A differs from that

  inline __attribute__((always_inline)) const TreeStructure& tree_of_joint(int joint) const {
    return tree[body[joint_body[joint]].tree];
  }

  /// All but `half`.
  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.dt, to.dt), visit(from.step, to.step), visit(from.ahead, to.ahead);
    visit(from.position_bound, to.position_bound), visit(from.velocity_bound, to.velocity_bound);
    visit(from.gravity, to.gravity), visit(from.tree, to.tree);
    visit(from.free_share, to.free_share), visit(from.body, to.body), visit(from.link, to.link);
    visit(from.link_mass, to.link_mass), visit(from.armature, to.armature), visit(from.damping, to.damping);
    visit(from.kp, to.kp), visit(from.kd, to.kd), visit(from.implicit, to.implicit);
    visit(from.stiffness, to.stiffness), visit(from.rest, to.rest);
    visit(from.effort_limit, to.effort_limit), visit(from.term_value, to.term_value), visit(from.offset, to.offset);
    visit(from.rows, to.rows), visit(from.bounds, to.bounds), visit(from.reduction, to.reduction);
    visit(from.hard_rate, to.hard_rate), visit(from.undamped, to.undamped);
  }
};

}  // namespace lockstep
