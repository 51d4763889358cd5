// Plan: a Model compiled to flat tables that hold only what the scene uses. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "lockstep/model.h"
#include "lockstep/step.h"

namespace lockstep {

struct Program;  // the tables themselves (src/plan/program.h)

/// An immutable compiled model; copies share it. Thread-safe.
///
/// Rows of a Batch follow the Model: dofs are its moving joints in the order of Model::joints,
/// couplings, links and sites have the order of theirs.
class Plan {
 public:
  const Model& model() const;
  const StepSettings& settings() const;

  /// The method that a step really uses: never Method::automatic.
  Method method() const;

  /// The integrator that a step really uses: never Integrator::automatic.
  Integrator integrator() const;

  /// When in a step targets and efforts are looked at, as shares of dt, in the order of the rows that
  /// StepSettings::stage_inputs asks for. Some times come twice.
  std::vector<double> stage_times() const;

  int dofs() const;                                   ///< moving joints; a floating root's six are apart
  int couplings() const;
  bool floating() const;
  const std::vector<std::string>& dof_names() const;  ///< joint names, by dof
  int dof(const std::string& joint) const;            ///< throws UsageError for unknown or fixed joints
  int link(const std::string& name) const;            ///< throws UsageError
  int site(const std::string& name) const;            ///< throws UsageError
  int parameter_rows(Parameter parameter) const;      ///< rows of that field, declared or not

  /// Everything that a step holds or bounds, in the order of Batch::row_residuals() and row_states(): "coupling NAME"
  /// for each coupling, then by dof what it has of "position limit NAME", "velocity limit NAME", "friction NAME",
  /// "kinematic drive NAME", "effort limit NAME".
  const std::vector<std::string>& row_names() const;

  /// Couplings that follow from others and therefore take no impulse (indices), found by rank.
  const std::vector<int>& redundant_couplings() const;
  /// Joints whose motion follows from the others' when the method is reduced (dofs).
  const std::vector<int>& eliminated_dofs() const;

  /// In words: what a step does, by which method and why, what was left out, what it costs.
  std::string describe() const;

  /// Operations of one step of one environment, counted by running the very kernel on a counting
  /// number type: a fused multiply-add is two, a sine and cosine are what their polynomial takes.
  long flops_per_step() const;
  /// Bytes that one environment's step(1) reads and writes in memory, at the given scalar size.
  long bytes_per_step(int scalar_bytes) const;
  /// Bytes that a Batch holds for one environment, at the given scalar size.
  long bytes_per_environment(int scalar_bytes) const;

  const Program& program() const { return *program_; }

 private:
  friend Plan compile(const Model& model, const StepSettings& settings);
  explicit Plan(std::shared_ptr<const Program> program) : program_(std::move(program)) {}
  std::shared_ptr<const Program> program_;
};

/// Validates and compiles. Throws ModelError (the model is impossible; hard couplings that contradict
/// each other are named) or SettingsError. Thread-safe.
Plan compile(const Model& model, const StepSettings& settings = {});

}  // namespace lockstep
