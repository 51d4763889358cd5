// States of environments: columns in files, and starts that satisfy the couplings. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "csv.h"
#include "lockstep/batch.h"

namespace lockstep::tool {

/// One number of an environment's state and the name of its column: NAME and NAME.v for a joint, root.x ... root.vz for
/// the floating root, or LINK.x ... LINK.vz for each of several.
struct StateColumn {
  enum class Kind { position, velocity, root_pose, root_velocity };
  std::string name;
  Kind kind;
  int row;  ///< of the Batch's view of that kind
};

/// Position and velocity of each dof, then poses of the floating roots, then their velocities, in the order of the
/// Batch's rows. Throws InputError if two columns have the same name, or that of another column of a recording.
std::vector<StateColumn> state_columns(const Plan& plan, bool of_recording = false);

/// "fixed", "floating", or how many of several trees float.
std::string base_of(const Model& model);

template <class S>
typename Batch<S>::View state_view(Batch<S>& batch, StateColumn::Kind kind);

/// Throws InputError unless the table has one row for all, or one for each of so many environments.
void require_rows(const Table& table, int environments);

/// Writes the rows of a state file into the environments: one row for all, or one for each. Followers without a column
/// go where the other joints put them, through couplings of any softness; other states keep their values. Throws
/// InputError for unknown columns, and for numbers that cannot be used.
template <class S>
void apply_state(const Table& table, Batch<S>& batch);

/// The model with the start of a state file of one row.
Model with_state(Model model, const Table& table);

/// Writes the states of all environments as apply_state() reads them, to the same bits. Without names only the lines of
/// the environments. Throws InputError where the file cannot be written.
template <class S>
void write_states(const std::string& path, bool with_names, Batch<S>& batch);

/// Adds normal noise of standard deviation `sigma` to the independent joints of every environment, and places the
/// followers. Joints stay within the position ranges that a step holds, or as far outside as they start. The noise of
/// an environment depends on its id and on nothing else of the batch.
template <class S>
void perturb(double sigma, std::uint64_t seed, Batch<S>& batch);

}  // namespace lockstep::tool
