// Settings of a step: step size, method, integrator, sweeps, per-environment parameters. SPDX-License-Identifier:
// Apache-2.0
#pragma once

#include <initializer_list>

#include "lockstep/enums.h"

namespace lockstep {

/// A set of Parameters.
class ParameterSet {
 public:
  constexpr ParameterSet() = default;
  constexpr ParameterSet(std::initializer_list<Parameter> list) {
    for (Parameter p : list) insert(p);
  }
  constexpr bool contains(Parameter p) const { return (bits_ >> static_cast<unsigned>(p)) & 1u; }
  constexpr void insert(Parameter p) { bits_ |= 1u << static_cast<unsigned>(p); }
  constexpr bool empty() const { return bits_ == 0; }

 private:
  unsigned bits_ = 0;
};

/// Bounds that a step leaves out although the model states them.
struct Ignored {
  bool position_limits = false, velocity_limits = false, effort_limits = false, friction = false;
};

/// Everything that compile() must know beside the Model. The defaults are what most users want.
struct StepSettings {
  double dt = 1.0 / 240.0;  ///< s, > 0
  Method method = Method::automatic;
  Integrator integrator = Integrator::automatic;
  int iterations = 4;  ///< sweeps of pgs, sub-steps of tgs, 1 to 1000; direct and reduced do not use it
  /// Sweeps after the position update, 0 to 1000: the velocity that corrects positions stays out of the state. For
  /// direct and reduced any number >= 1 means one more solve.
  int velocity_iterations = 1;
  ParameterSet per_environment = {};  ///< fields that differ from environment to environment
  Ignored ignore = {};
  /// False: targets and efforts are held over the step. True: position_targets(), velocity_targets() and efforts() of a
  /// Batch have the dofs' rows once for each of Plan::stage_times(), in that order. Euler has one time only.
  bool stage_inputs = false;
  /// Keep the couplings' impulses for Batch::coupling_impulses(). An automatic integrator is euler then.
  bool record_impulses = false;
  /// Keep what Batch::row_residuals(), row_states(), energy_balances() and conflicts() show. The same holds.
  bool record_diagnostics = false;
  double position_bound = 1e5;  ///< rad or m; an environment beyond it is frozen with Fault::diverged. Angles in float
                                ///< lose 6e-8 of their size, so keep them small
  double velocity_bound = 1e5;  ///< rad/s or m/s; the same
};

}  // namespace lockstep
