// The stages of compile(), one file each. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "model/softness_numbers.h"
#include "model/tree.h"
#include "program.h"

namespace lockstep {

/// How far the solves of this integrator go, and when it looks at its inputs (integrator.cpp).
void lay_out_times(Program& program, Integrator integrator);

/// Why a compiled scene is not one for its integrator, if so, and what to do about it (integrator.cpp).
struct Obstacle {
  std::string reason, remedy;
};
std::optional<Obstacle> obstacle_of(const Program& program);

/// Bodies, frames, joints and the structure of the mass matrix (bodies.cpp).
void lay_out_bodies(Program& program, const Tree& tree);

/// Lists one behind the other, and where each begins.
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

/// Damping, drives, armature and what of them stands in the matrix (bodies.cpp).
void lay_out_joint_terms(Program& program);

/// Couplings as linear forms over the joints (couplings.cpp).
void lay_out_couplings(Program& program);

/// Hard couplings that follow from earlier ones go to program.redundant; throws ModelError, naming both
/// sides, where they contradict each other (couplings.cpp).
void find_redundant_couplings(Program& program);

/// Which method a step uses, and why; throws SettingsError where the one asked for does not apply (method.cpp).
void choose_method(Program& program);

/// A joint whose velocity is a sum of other joints', or that and the speed of its coupling.
struct Follower {
  int joint;
  std::vector<std::pair<int, double>> shares;  ///< of other joints' velocities
};
/// S and its products: v = S z where followers are eliminated, or where speeds of couplings stand for them (basis.cpp).
void lay_out_basis(Program& program, const std::vector<Follower>& followers, bool has_constraint_velocities);

/// The followers of `reduced`, and its elimination per environment (elimination.cpp).
void eliminate_followers(Program& program);

/// The couplings that are left to solve as rows over the solver's velocities, and the bounds (rows.cpp).
void lay_out_rows(Program& program);

/// What loops over tables take, as measured, in units of a product in a long sum, for a plan to choose by.
namespace work {
constexpr int passing = 10;          ///< a column's way past one body
constexpr int column_of_joint = 30;  ///< what a joint takes to begin one
constexpr int adding = 4;            ///< a number on its way to A_r
constexpr int summing = 2;           ///< a product of a short sum
constexpr int articulating = 80;     ///< what the parent feels of a body
constexpr int travelling = 18;       ///< a vector's way past one body
}  // namespace work

/// A_r from merged columns, and what work that is (composite_columns.cpp).
std::pair<CompositeColumns, long> composite_columns(const Tables<double>& t, TableStorage& storage);
/// Has A_r made so where that is less work than by A, and possible (composite_columns.cpp).
void take_composite_columns(Program& program);

/// The routes of articulated bodies (articulated.cpp).
Articulated articulated_bodies(const Tables<double>& t, TableStorage& storage);
/// Has A factored by them where that is less work, and possible (articulated.cpp).
void articulate(Program& program);

/// Has speeds of couplings for velocities of the solver, where A is made and couplings have joints of their own
/// (constraint_velocities.cpp).
///
/// `first_joints_shares` gives by coupling what is left of its follower's entry of A when all that the coupling lets
/// move is eliminated from it: 1 / (K_cc A_ff) at the scene's start.
void take_constraint_velocities(Program& program,
                                const std::function<std::vector<double>(const Program&)>& first_joints_shares);

/// A row as a linear form over the solver's velocities.
struct RowForm {
  int coupling;  ///< -1: a joint's
  Softness softness;
  std::map<int, std::vector<Contribution>> terms;  ///< by solver velocity
};

/// Adds a joint's velocity, times a term of a coupling, to the form: by S where the joint was eliminated (rows.cpp).
void add_joint(const Tables<double>& t, const Reduction<double>& reduction, int joint, int term, RowForm& form);
RowForm coupling_form(const Program& program, const Reduction<double>& reduction, int coupling);

/// (M27), (M28), (M36): rate and cfm, (22), (23), (26) to (29) of the note, for a step or one of its sub-steps of
/// length h (rows.cpp).
RowSoftness<double> row_softness(const Program& program, const Softness& softness, double h, int substeps);

/// The tables of rows with these forms; `factored` ones are numbered by their elimination tree (rows.cpp).
Rows<double> lay_out_forms(Program& program, const std::vector<RowForm>& forms, const Columns& columns, bool factored);

/// Limits, frictions, kinematic drives, force limits as bounded rows (bounds.cpp).
struct BoundForms {
  std::vector<RowForm> forms;  ///< by row
  std::vector<int> joint;      ///< by row, -1 for a coupling's
};
BoundForms lay_out_bounds(Program& program);

/// The rows of a report, by name too (bounds.cpp).
void lay_out_report(Program& program);

/// f32 from f64 (narrow.cpp).
void narrow(Program& program);

/// Couplings that no environment can soften.
bool always_hard(const Program& program, int coupling);
bool is_redundant(const Program& program, int coupling);
bool is_absent(const Program& program, int coupling);
bool declared(const Program& program, Parameter parameter);

/// A symmetric pattern, square; only [i][j] with j <= i is read.
using Pattern = std::vector<std::vector<char>>;

/// Elimination from the last to the first with its fill-in, renumbered depth first (columns.cpp).
struct Elimination {
  std::vector<int> order;   ///< by new number: the old one
  std::vector<int> parent;  ///< by new number
};
Elimination elimination_tree(Pattern pattern);

/// Sizes and offsets from the parents of a depth-first numbering (columns.cpp).
Columns make_columns(const std::vector<int>& parent, TableStorage& storage);

/// Where H_ij stands, or -1 where neither is the other's ancestor (columns.cpp).
int entry_of(const Columns& columns, int i, int j);

}  // namespace lockstep
