// A run that subcommands share: its options, its start and its steps. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "options.h"
#include "targets.h"

namespace lockstep::tool {

/// What is simulated, from where, by what and for how long.
struct RunOptions {
  ModelOptions model;
  StepOptions step;
  int environments = 1024, threads = 0;
  double seconds = 1.0, sigma = 0.0, tolerance = 0.0;
  std::uint64_t seed = 1;
  bool f64 = false;
  Engine engine = Engine::automatic;
  std::string state, targets;

  void add_to(CLI::App& app);
  /// The files that a run reads.
  std::vector<std::string> files() const { return {model.file, state, targets}; }
};

/// The files of states and targets. They are read once, though used twice: a file may be a pipe.
struct Inputs {
  std::optional<Table> state, targets;
  /// Throws InputError for files that are no tables.
  explicit Inputs(const RunOptions& options);
  Targets targets_of(const Plan& plan) const { return targets ? Targets(*targets, plan) : Targets(); }
};

struct Run {
  Plan plan;
  long steps;
  std::vector<VisualMesh> visual_meshes;
};

/// Loads the model, chooses the step if --tolerance asks for it (a line says which), and compiles. Throws InputError
/// and lockstep::Error.
Run prepare(const RunOptions& options, const Inputs& inputs, const std::vector<std::string>& outputs);

/// Gives the batch the start states of the run's environments that have its ids.
template <class S>
void put_to_start(const RunOptions& options, const Inputs& inputs, Batch<S>& batch);

/// Steps the batch with these targets and a progress bar. Calls `after` with the number of steps done, at every
/// multiple of `interval`, where targets change, and at the end. Returns the seconds of wall clock in Batch::step
/// alone.
template <class S>
double advance(Batch<S>& batch, const Targets& targets, long steps, long interval,
               const std::function<void(long)>& after);

}  // namespace lockstep::tool
