// The tables that kernels read: flat, constant, shared by all environments. SPDX-License-Identifier: Apache-2.0
//
// A Program (program.h) owns them; kernels see only this header, which knows no container.
// Indices: `joint` counts the moving joints in the solver's depth-first order; `velocity` counts the
// generalised velocities, a floating root's six first, then the joints; `row of a field` is what the
// user sees, in the Model's order.
#pragma once

#include <cstdint>

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
  Span<int> parent;  ///< -1 for a root of the tree
  Span<int> size;    ///< of the subtree, itself included
  Span<int> offset;  ///< of column j's diagonal
  Span<int> row_start;  ///< n + 1
  Span<int> row;        ///< entries of row i in the columns of its ancestors, the nearest first
};

/// One rigid body and the joint that carries it, in frames in which the joint's axis is a coordinate axis.
template <class S>
struct Body {
  int parent;       ///< body, -1 for the fixed world
  int axis;         ///< 0, 1, 2
  bool prismatic;
  bool rotated;     ///< there is a constant rotation before the joint's own
  bool root;        ///< the floating root: no joint
  int kind;         ///< of all these and of the offset: what kernels::with_joint() looks at
  bool first;       ///< of its parent's children it is the first to be added, from the leaves to the root
  bool leaf;        ///< it carries no others
  bool heavy;       ///< there is mass in `felt_mass` of it or of those that it carries
  bool diagonal;    ///< felt_second is, in every environment
  S sign;           ///< the joint's axis is sign times the coordinate axis
  S rotation[9];    ///< parent coordinates to joint coordinates at q = 0, row-major
  S offset[3];      ///< origin in the parent frame at q = 0
  S mass, moment[3], second[6];  ///< pseudo-inertia about the origin, see simd/vec3.h
  S felt_mass, felt_moment[3], felt_second[6];  ///< with what lies on joints' axes moved inwards (M10)
};

/// What is known of a joint and its body's offset when compiling. A revolute joint without a constant rotation has
/// 3 axis + one of the first three: the offset is along the next axis, the last one, or both.
enum BodyKind : int { next_axis, last_axis, both_axes, turned_joint = 9, sliding_joint = 10, turned_sliding_joint = 13 };

/// A link of the model in its body: where it is, and what a kilogram of it contributes.
template <class S>
struct LinkPlace {
  int body;         ///< -1: part of the fixed world
  S rotation[9];    ///< link coordinates to body coordinates, row-major
  S offset[3];
  S unit_moment[3], unit_second[6];  ///< per kg, about the body's origin, or the fixed root's
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
  int row, rows, column, columns;      ///< the first of either, and how many
  int run_first, run_last;             ///< in Rows::block_runs: velocities that may be moved by both
  int entry[most_rows][most_columns];  ///< where K stands, -1 for a pair that has none or is another block's
  int mirror[most_rows][most_columns]; ///< and its mirror image (the same for packed storage)
};

/// A share of a row's term: term of a coupling, times an entry of S; -1 stands for 1 in both.
struct Contribution {
  int term, value;
};

/// How soft a row is: cfm + cfm_per_response * r, and bias = rate * C. Made of Softness and the step.
template <class S>
struct RowSoftness {
  int kind;           ///< Softness::Kind, for fields that change it per environment
  S rate, cfm, cfm_per_response;
};

/// Linear forms over the solver's velocities: the couplings that are left to solve.
template <class S>
struct Rows {
  int count = 0;
  Span<int> coupling;                 ///< by row; -1 where the row is a joint's
  Span<int> term_start;               ///< by row, count + 1
  Span<int> term_index;               ///< solver velocity
  Span<S> term_value;
  Span<int> contribution_start;       ///< by term, terms + 1; what term_value is made of, for gear ratios
  Span<Contribution> contribution;    ///< that differ per environment
  Span<int> support_start;            ///< by row, count + 1
  Span<SupportRange> support;         ///< ascending
  Span<int> run_start;                ///< by row, count + 1
  Span<SupportRun> runs;              ///< the same velocities as runs
  Span<RowGroup> groups;
  Span<SupportRange> group_support;
  Span<SupportRun> group_runs;
  Span<RowBlock> blocks;              ///< by their rows
  Span<SupportRun> block_runs;
  bool dense = false;                 ///< every entry of K is in a block
  Span<int> known;                    ///< by solver velocity: the hard row whose speed it is, -1 if none, where rows leave
                                      ///< their speeds behind (M79)
  bool all_known = false;             ///< of every row
  bool prescribed = false;            ///< and these speeds are what direct asks for, whatever the rows' impulses, which
                                      ///< nobody asks for
  Span<int> neighbour_start;          ///< by row, count + 1
  Span<SupportRun> neighbours;        ///< rows that its impulse moves, where K is not factored
  int response_entries = 0;           ///< size of K's storage
  Columns columns;                    ///< structure of K, for the methods that factor it
  Span<RowSoftness<S>> softness;      ///< by row
};

/// What a bounded row is made of: the hard bounds of one joint (or of all that move with one velocity), or one of
/// the others.
enum class BoundKind : int { joint, soft_limit, soft_drive, coupling };

/// What a joint has, as bits.
enum JointBound : int { has_range = 1, has_speed_limit = 2, has_friction = 4, has_kinematic_drive = 8, has_restitution = 16 };

/// A joint whose bounds are in a row.
struct Member {
  int joint, follower;  ///< follower: -1 if it moves with a velocity of its own
  int share;            ///< entry of S, -1 stands for 1
};

/// A joint whose limits are looked at in every step.
template <class S>
struct Watched {
  int joint;
  S lower, upper;
  S way;          ///< that it may go in a step, 0 where its speed has no limit
  bool bounces;
};

/// Rows with an interval or a box (M54).
template <class S>
struct Bounds {
  Rows<S> form;                 ///< directions, and the softness of those that have one
  Span<BoundKind> kind;         ///< by row
  Span<int> member_start;       ///< by row, rows + 1
  Span<Member> member;
  Span<S> member_share;         ///< the values of S
  bool may_depend = false;      ///< directions of hard intervals may depend on each other
  Span<int> driven;             ///< by row: it holds a hard kinematic drive
  bool always = false;          ///< some row acts in every step: friction, a kinematic drive, a force limit
  Span<Watched<S>> watched;     ///< the joints with limits
  // by joint; what it has not is not read
  Span<int> has;                ///< JointBound
  Span<S> lower, upper, limit_rate, restitution, speed_limit, friction, drive_rate;
  Span<S> sub_step_rate;        ///< limit_rate in the sub-steps of tgs
  Span<S> force_limit;          ///< by coupling
  Span<S> soft_rate;            ///< by row, of the whole step; its softness in `form` is that of a sub-step of tgs
  Span<int> natural_row;        ///< by row, as Tables::natural_row
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

/// Slots whose contents come together.
struct Join {
  int from, to;
};

/// How A_r is made without A (M41): columns of M S, which joints that share a velocity share, on their way inwards. A
/// column stands in a slot until it has left the tree. Lists are by body. Used where there are slots.
struct MergedColumns {
  struct Row { int slot, entry, factor; };      ///< what a column asks of the joint, and where it goes
  struct Square { int entry, factor; };         ///< where inertia of the joint alone goes
  struct Unit { int slot, factor; bool first; };  ///< where the joint's own column goes
  struct Factor { int left, right, times; };    ///< entries of S, -1 for 1
  // of followers, where positions are corrected by a solution of their own
  struct Correction { int slot; bool first; };  ///< where the joint's own column goes, times its correction
  int slots = 0;
  Span<Factor> factors;
  Span<int> join_start, row_start, pull_start, square_start, pulled_start, unit_start, passed_start;
  Span<Join> joins;         ///< of one velocity, out of two branches
  Span<Row> rows;           ///< the root's have one of its velocities for a factor
  Span<Row> pulls;          ///< the same, times the correction
  Span<Square> squares;
  Span<Square> pulled;      ///< the same, times the correction
  Span<Unit> units;
  Span<Correction> correction;  ///< by body
  Span<int> passed;         ///< slots of what goes on to the parent
};

/// A vector on its way inwards over articulated bodies, and where the wrench that it has become stands.
struct Traveller {
  int slot, vector;
};

/// A body that they come to. Those from `fresh` on begin there, those from `known` on come from bodies farther out.
struct Pass {
  int body;
  int joins, joined;       ///< first and one past the last in Articulated::joins: of one vector, out of two branches
  int fresh, known, last;  ///< in Articulated::travellers
};

/// Passes from the leaves to the root, a floating root's among them.
struct Route {
  int first, last;
};

/// How A is factored without being made, where that is less work (M22 to M25). Used where there are passes.
struct Articulated {
  Span<Pass> passes;
  Span<Traveller> travellers;
  Span<Join> joins;
  int slots = 0;
  Route all = {0, 0};  ///< of one vector over all bodies; inertias take the same slots
  Route rows = {0, 0}; ///< of Tables::rows
  Span<Route> bound;   ///< by row of Bounds::form
  Columns root;        ///< structure of a floating root's own part
  inline __attribute__((always_inline)) bool used() const { return passes.count > 0; }
};

/// A follower of one joint, as a plan has for most: indices of joints, coupling, its coefficient and the entry of S.
struct Pair {
  int follower, driver, coupling, term, value;
};

/// A follower whose angle in place is its driver's, or minus that: so are sine and cosine.
struct Mirror {
  int body, driver;
  bool opposed;
};

/// The velocities in terms of those that are solved for: v = S z, A_r = S^T A S. Either followers are eliminated (M39), for
/// `reduced`, or couplings' speeds stand for them (M77); empty where A itself is factored.
template <class S>
struct Reduction {
  int followers = 0;
  bool by_force = false;              ///< bias forces hold what followers lose of their mismatch within a step
  MergedColumns merged;
  inline __attribute__((always_inline)) bool keeps_speeds() const { return speed.count > 0; }
  inline __attribute__((always_inline)) bool eliminates() const { return followers > 0 && speed.count == 0; }
  /// A_r is made of A's entries.
  inline __attribute__((always_inline)) bool by_entries() const { return followers > 0 && merged.slots == 0; }
  Span<int> speed;                    ///< by follower: the solver velocity that is the speed of its coupling
  Span<int> measured;                 ///< and that coupling
  Span<int> follower;                 ///< joint, by follower
  Span<int> follower_of;              ///< by joint: its number among the followers, -1 if independent
  Span<int> independent;              ///< velocity, by solver velocity
  Span<int> start, column, driver;    ///< rows of S that belong to followers, sparse: solver velocity, and its joint
  Span<S> value;
  Span<int> placing;                  ///< couplings that place their first joints (M76), behind those that they wait for
  bool shortens = false;              ///< a step is shorter where all followers are in place
  Span<Pair> pairs;                   ///< if all followers are of one joint
  Span<Mirror> mirrors;               ///< by ascending body
  Span<int> collect_start;            ///< by solver velocity: S^T, as followers' velocities and entries of S
  Span<Collected> collected;
  Span<int> momentum_start;           ///< by velocity: the followers that it shares entries of A with
  Span<Momentum> momentum;
  Span<int> inverse_start, inverse_coupling;  ///< inverse of J's follower columns: error by follower
  Span<S> inverse_value;
  Span<S> rate;                       ///< erp / dt by coupling
  Span<ProductGroup> product_groups;  ///< entries of A_r that are sums of so many products
  Span<int> product_entry;            ///< of A_r, in the order of their groups
  Span<int> product_start;            ///< in the same order
  Span<int> product_source;           ///< entry of A
  Span<S> product_value;
  Span<int> product_left, product_right;      ///< the two entries of S whose product it is; -1 stands for 1
  // With gear ratios per environment, S is found lane by lane by this Gauss-Jordan elimination.
  struct Fill { int entry, gear; S value; };  ///< initial entry: field row, or the value where gear is -1
  struct Elimination { int factor, pivot, first, last; };  ///< one row minus factor/pivot times the pivot's row
  struct Update { int target, source; };
  int entries = 0;
  Span<Fill> fills;
  Span<Elimination> eliminations;
  Span<Update> updates;
  Span<int> pivot;                    ///< by follower: entry of its pivot
  Span<int> value_entry;              ///< by value: entry that it is minus pivot's share of
  Span<int> inverse_entry;
};

template <class S>
struct Tables {
  S dt = 0;                       ///< how far a solve goes: the step, or gamma of it (M68)
  S step = 0;                     ///< the step
  S ahead = 0;                    ///< how far ahead linear terms are taken: dt, or 0 where they are explicit
  int method = 0;                 ///< Method
  int integrator = 0;             ///< Integrator
  int input_times = 1;            ///< so many of the step's times have targets and efforts of their own
  const Tables* half = nullptr;   ///< of half the step, for the integrator that takes both
  int iterations = 0, velocity_iterations = 0;
  bool floating = false;
  int bodies = 0, joints = 0, velocities = 0, couplings = 0, links = 0;
  S position_bound = 0, velocity_bound = 0;
  S gravity[3] = {};              ///< in the root's frame if the root is fixed, else in the world's
  S world_gravity[3] = {};
  S root_rotation[9] = {};        ///< of a fixed root: its coordinates to the world's
  S root_offset[3] = {};
  Span<Body<S>> body;
  Span<LinkPlace<S>> link;
  Span<S> link_mass;
  Span<int> joint_row;            ///< by joint: the dof's row in the views
  Columns matrix;                 ///< structure of the mass matrix
  Columns solver;                 ///< structure of the matrix that is factored: of A or of A_r
  Span<S> armature, damping, kp, kd;  ///< by joint
  Span<S> implicit;               ///< armature + dt (damping + kd) + dt^2 kp, by joint
  Span<int> driven;               ///< joints that have a servo without an effort limit
  Span<int> limited;              ///< joints that have a servo with an effort limit
  Span<int> clamped;              ///< joints without a servo whose effort is limited, in order
  Span<S> effort_limit;           ///< by joint
  // couplings in joint space
  Span<int> term_start, term_joint, term_gear;  ///< gear: row of the gear_ratio field, -1 for the leading 1
  Span<S> term_value;
  Span<S> offset, softness_first, softness_second;
  Rows<S> rows;
  Bounds<S> bounds;
  Reduction<S> reduction;
  Articulated articulated;
  Span<Reported> reported;        ///< only if diagnostics are recorded
  Span<S> hard_rate;              ///< erp / dt by coupling, 0 for soft ones: the same
  Span<int> follows;              ///< by coupling: 1 if it is redundant and takes no impulse; the same
  // rows whose softness refers to the mechanism's own inertia where A holds more than that
  Rows<S> natural;
  Span<int> natural_row;          ///< by row of `rows`: its row in `natural`, -1 if none
  bool solve_twice = false;       ///< position and velocity want different solutions
  bool renewed = false;           ///< tgs: rows are renewed in every sub-step
  S free_share = 1;               ///< share of the free motion that moves positions: (N + 1) / 2N in tgs
  unsigned per_environment = 0;   ///< declared fields, bit by Parameter
  bool record_impulses = false;
  bool record_diagnostics = false;
};

}  // namespace lockstep
