// The stages of compile(), in their order. SPDX-License-Identifier: Apache-2.0
//
// Each folder of src/plan has the stages that lay out one thing: bodies/, couplings/, matrix/ (the matrix that a step
// factors, A or A_r, and its velocities), rows/. They call each other, so all are declared here.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "model/softness_numbers.h"
#include "model/trees.h"
#include "program.h"

namespace lockstep {

/// Concatenates lists. Returns where each begins, and all elements.
template <class E>
std::tuple<Span<int>, Span<E>> flattened(const std::vector<std::vector<E>>& lists, TableStorage& storage) {
  std::vector<int> start{0};
  std::vector<E> all;
  for (const std::vector<E>& list : lists) {
    all.insert(all.end(), list.begin(), list.end());
    start.push_back(static_cast<int>(all.size()));
  }
  return {storage.keep(std::move(start)), storage.keep(std::move(all))};
}

// ---------------------------------------------------------------- times

/// The length of this integrator's solves, and the times at which it reads its inputs (integrator.cpp).
void lay_out_times(Program& program, Integrator integrator);

// ---------------------------------------------------------------- bodies

/// Bodies, frames, joints and the structure of the mass matrix (bodies/bodies.cpp).
void lay_out_bodies(Program& program, const Trees& trees);

/// Damping, drives, armature, and their part of the matrix, when followers are known (bodies/joint_terms.cpp).
void lay_out_joint_terms(Program& program);
/// Delays, lags and motors of the drives (bodies/actuators.cpp).
void lay_out_actuators(Program& program);

// ---------------------------------------------------------------- couplings

/// Couplings as linear forms over the joints (couplings/couplings.cpp).
void lay_out_couplings(Program& program);

/// Whether the coupling is hard in every environment.
bool always_hard(const Program& program, int coupling);
bool is_redundant(const Program& program, int coupling);
bool is_absent(const Program& program, int coupling);
bool declared(const Program& program, Parameter parameter);
/// Whether masses, centres of mass or inertias differ per environment.
bool has_own_inertias(const Program& program);

/// The functions that followers are of a joint, and the couplings that place curved followers
/// (couplings/functions.cpp).
void lay_out_functions(Program& program);
/// Which of the eliminated followers are curved or spatial tendons (couplings/functions.cpp).
void find_exact_followers(Program& program);
/// Throws ModelError where a bound of a curved follower is none of its leader, because the function rises and falls
/// (couplings/functions.cpp).
void check_bounds_of_functions(const Program& program);
/// What users see of curved followers: the tangents at the model's start (couplings/functions.cpp).
void take_tangents(Program& program);
/// Whether the coupling has a function, or follows hard a follower that has one (couplings/functions.cpp).
bool is_curved(const Program& program, int coupling);
/// Whether S differs between environments, or between steps (couplings/functions.cpp).
bool shares_differ(const Program& program);
/// The slope of a coupling's function at the model's start, or 1 where that is 0 (couplings/functions.cpp).
double slope_at_start(const Model& model, const Coupling& coupling);

/// A coupling's first joint is its follower, unless another joint's coefficient is this many times larger and the first
/// is no tendon.
inline constexpr double follower_preference = 1000.0;

/// Followers and what they follow, the order in which they are placed, and locked joints (couplings/followers.cpp).
void choose_followers(Program& program);
/// Whether StepSettings::ignore leaves out these bounds for a joint of program.model (couplings/followers.cpp).
bool leaves_out(const Program& program, const JointSet& bounds, const Joint& joint);

/// Adds hard couplings that follow from earlier ones to program.redundant. Throws ModelError if couplings contradict
/// each other, and names them (couplings/couplings.cpp).
void find_redundant_couplings(Program& program);

/// Which method a step uses, and why. Throws SettingsError for what the obstacles known by then stand against
/// (method.cpp).
void choose_method(Program& program);

// ---------------------------------------------------------------- matrix

/// Which entries of a symmetric matrix are not 0, as far as its elimination tree depends on it: the tree asks only
/// which rows are connected through rows from some number on (matrix/columns.cpp).
class Pattern {
 public:
  explicit Pattern(int n) : later_(static_cast<std::size_t>(n)) {}
  void join(int a, int b);
  /// All entries between these rows, which are sorted. A path along them connects as much.
  void join_all(std::vector<int>& rows);
  int size() const { return static_cast<int>(later_.size()); }
  const std::vector<int>& later(int row) const { return later_[static_cast<std::size_t>(row)]; }

 private:
  std::vector<std::vector<int>> later_;  // by row: rows after it
};

/// The elimination from last to first, with its fill-in, renumbered depth first (matrix/columns.cpp).
struct Elimination {
  std::vector<int> order;   ///< by new number: the old number
  std::vector<int> parent;  ///< by new number
};
Elimination elimination_tree(const Pattern& pattern);
/// Sizes and offsets from the parents in a depth-first numbering. Without `row` if there are more than most_entries,
/// which only A may have, if no step computes it (matrix/columns.cpp).
Columns make_columns(const std::vector<int>& parent, TableStorage& storage);
/// By entry: its column (matrix/columns.cpp).
std::vector<int> columns_of_entries(const Columns& columns);
/// The place of H_ij, or -1 if neither is the other's ancestor (matrix/columns.cpp).
int entry_of(const Columns& columns, int i, int j);

/// By tree, its component: trees that couplings join have the same number (matrix/components.cpp).
std::vector<int> components(const Tables<double>& t);
/// Gives the trees with a true another InertiaKind (matrix/components.cpp).
void set_inertia(Program& program, const std::vector<bool>& trees, InertiaKind inertia);
/// By tree, whether it is of this kind (matrix/components.cpp).
std::vector<bool> trees_with(const Tables<double>& t, InertiaKind inertia);
/// By velocity: its tree (matrix/components.cpp).
std::vector<int> trees_of_velocities(const Tables<double>& t);

/// The followers of `reduced`, and its elimination per environment (matrix/elimination.cpp).
void eliminate_followers(Program& program);

/// Segments between bodies of the spatial tendons (couplings/spatial_tendons.cpp).
void lay_out_spatial_tendons(Program& program);
/// How the lengths change with the independent joints at the model's start: what users see
/// (couplings/spatial_tendons.cpp).
void take_spatial_tangents(Program& program);

/// A joint whose velocity is a weighted sum of other velocities, plus its constraint velocity if it has one.
struct Follower {
  int joint;
  std::vector<std::pair<int, double>> shares;  ///< other velocities, and their weights
};
/// Spatial tendons as followers of velocities, at the model's start. Those that couplings eliminate are known
/// (couplings/spatial_tendons.cpp).
std::vector<Follower> spatial_followers(const Program& program, const std::vector<Follower>& of_couplings);
/// What fills their rows of S, which are laid out (couplings/spatial_tendons.cpp).
void lay_out_spatial_columns(Program& program);
/// Whether the joint is a spatial tendon, whose bounds act on all of its velocities (couplings/spatial_tendons.cpp).
bool is_spatial(const Tables<double>& t, int joint);

/// S of v = S z, and the products of A_r. The solver either eliminates the followers' velocities or replaces them by
/// constraint velocities (matrix/basis.cpp).
void lay_out_basis(Program& program, const std::vector<Follower>& followers, bool has_constraint_velocities);

/// Measured costs of the tables' loops, by which a plan chooses. The unit is one product of a long sum.
namespace work {
constexpr int column_past_body = 10;  ///< a column passes one body
constexpr int column_of_joint = 30;   ///< a joint's column is computed
constexpr int addition_to_entry = 4;  ///< a number is added to an entry of A_r
constexpr int short_product = 2;      ///< a product of a short sum
constexpr int articulated_body = 80;  ///< a body's articulated inertia is passed to its parent
constexpr int vector_past_body = 18;  ///< a vector passes one body
}  // namespace work

/// A_r of the trees with a true from composite columns, and by tree the work of a step that uses them
/// (matrix/composite_columns.cpp).
std::pair<CompositeColumns, std::vector<long>> composite_columns(const Tables<double>& t,
                                                                 const std::vector<bool>& trees, TableStorage& storage);
/// Takes composite columns for the components where they apply and are less work than A
/// (matrix/composite_columns.cpp).
void take_composite_columns(Program& program);
/// Takes them for the trees with a true (matrix/composite_columns.cpp).
void use_composite_columns(Program& program, const std::vector<bool>& trees);

/// Factors A by articulated bodies for the components where they apply and are less work (matrix/articulated.cpp).
void take_articulated_bodies(Program& program);

/// Chooses the couplings that are folded into A_r: in each component all that would be rows, or none. `shares` gives,
/// by coupling, the largest share (M97) of a joint's inertia at the model's start (matrix/folding.cpp).
void choose_folding(Program& program, const std::function<std::vector<double>(const Program&)>& shares);
/// Adds what the folded couplings fill to the pattern of A_r. `parts` names, by velocity, the solver velocities that it
/// depends on (matrix/folding.cpp).
void add_folded(const Program& program, const std::vector<std::vector<int>>& parts, Pattern& pattern);
/// Where the products of their terms stand in A_r (matrix/folding.cpp).
void lay_out_folding(Program& program);

/// Takes constraint velocities as velocities of the solver, for couplings with a first joint of their own and where
/// they are less work (matrix/constraint_velocities.cpp).
///
/// `first_joints_shares` gives, by coupling, 1 / (K_cc A_ff) at the model's start: the share of the follower's entry of
/// A that is left when all other velocities are eliminated from it.
void take_constraint_velocities(Program& program,
                                const std::function<std::vector<double>(const Program&)>& first_joints_shares);

/// What follows from the choice of each tree: which velocities are factored by columns, and which rows by paths
/// (matrix/articulated.cpp).
void lay_out_factoring(Program& program);

// ---------------------------------------------------------------- rows

/// A row as a linear form over the solver's velocities.
struct RowForm {
  int coupling;  ///< -1: the row of a joint
  Softness softness;
  std::map<int, std::vector<Contribution>> terms = {};  ///< by solver velocity
  int tree = -1;                                        ///< of one of its joints
};

/// Makes such forms (rows/forms.cpp). The reduction is that of the program, or an empty one for rows over all
/// velocities.
class Forms {
 public:
  Forms(const Program& program, const Reduction<double>& reduction);
  /// Adds a joint's velocity, times a term of a coupling, to the form. An eliminated joint is added by S.
  void add_joint(int joint, int term, RowForm& form) const;
  RowForm of_joint(int joint) const;
  RowForm of_coupling(int coupling) const;
  /// The solver velocity that this one is, -1 if it is none.
  int solver_of(int velocity) const { return solver_[static_cast<std::size_t>(velocity)]; }

 private:
  const Program& program_;
  Reduction<double> reduction_;
  std::vector<int> solver_;    // by velocity
  std::vector<int> measured_;  // by coupling: the follower whose constraint velocity it is; empty if there are none
};

/// (M27), (M28), (M36): rate and cfm, (22), (23), (26) to (29) of the note, for a step or for one of its sub-steps of
/// length h (rows/rows.cpp).
RowSoftness<double> row_softness(const Program& program, const Softness& softness, double h, int substeps);

/// The tables of rows with these forms. Rows that are `factored` are numbered by their elimination tree
/// (rows/rows.cpp).
Rows<double> lay_out_forms(Program& program, const std::vector<RowForm>& forms, const Columns& columns, bool factored);

/// Rows over the solver's velocities: the couplings that are left to solve, and the bounds (rows/rows.cpp).
void lay_out_rows(Program& program);

/// Whether the joint's position is bounded, and StepSettings::ignore does not leave that out (rows/bounds.cpp).
bool has_range_of(const Program& program, const Joint& joint);
/// What bounds each joint has, and their numbers (rows/bounds.cpp).
void lay_out_joint_bounds(Program& program);
/// Limits, frictions, kinematic drives and force limits as bounded rows (rows/bounds.cpp).
struct BoundForms {
  std::vector<RowForm> forms;  ///< by row
  std::vector<int> joint;      ///< by row, -1 for the row of a coupling
};
BoundForms lay_out_bounds(Program& program);

/// The Newton rounds, if something is bounded or touches and the method has no sweeps (rows/rounds.cpp).
void lay_out_rounds(Program& program);
/// Whether the joint moves with one velocity of the solver (rows/rounds.cpp).
bool acts_on_one_velocity(const Tables<double>& t, int joint);

/// A frame in a body, or in the world.
struct BodyPlace {
  int body;  ///< -1: the world
  Eigen::Isometry3d pose;
};
/// Of a frame in a link; an empty name, or link -1, is the world (rows/moving.cpp).
BodyPlace place_of(const Program& program, const std::string& link, const Eigen::Isometry3d& pose);
BodyPlace place_of(const Program& program, int link, const Eigen::Isometry3d& pose);
void put_pose(const Eigen::Isometry3d& pose, double (&rotation)[9], double (&offset)[3]);

/// Joints, as numbers of velocities, and velocities of floating roots that move two bodies against each other
/// (rows/moving.cpp).
std::vector<int> velocities_between(const Tables<double>& t, int first_body, int second_body);

/// By solver velocity: what it turns or moves of two bodies against each other (rows/moving.cpp).
using MovingColumns = std::map<int, std::vector<ColumnPart>>;
MovingColumns columns_between(const Program& program, const Forms& forms, int first_body, int second_body);

/// Moves the model's start to the closest pose that closes its loops, and finds which rows are redundant. Throws
/// ModelError for loops that do not close (rows/closing.cpp).
void close_start(Program& program);
/// The tables of loops, before the rounds (rows/loops.cpp).
bool has_loops(const Program& program);
void lay_out_loops(Program& program);
/// Their softness for the length of the program's solves (rows/loops.cpp).
void lay_out_loop_softness(Program& program);

/// By pair of colliders: the solver's velocities that move them against each other (rows/contacts.cpp).
std::vector<std::vector<int>> contact_velocities(const Program& program);
/// The tables of contacts, after the rounds (rows/contacts.cpp).
void lay_out_contacts(Program& program);

/// The rows of the diagnostics, and their names (rows/diagnostics.cpp).
void lay_out_report(Program& program);

// ---------------------------------------------------------------- when all other tables are there

/// Which joints turn for ever (couplings/turns.cpp).
void lay_out_turns(Program& program);

/// f32 from f64 (narrow.cpp).
void narrow(Program& program);

/// The step of half the length (other_lengths.cpp).
std::shared_ptr<Program> half_step(const Program& whole);
/// A solve over the whole step at the midpoint of a leapfrog, for contacts and rows that its stages cannot hold
/// (other_lengths.cpp).
std::shared_ptr<Program> midpoint_solve(const Program& whole);

}  // namespace lockstep
