// Settings of a step: step size, method, sweeps, per-environment parameters. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <initializer_list>

namespace lockstep {

/// How couplings are solved. `docs/architecture.md` says which to choose, docs/mathematics.md what each does.
enum class Method {
  automatic,  ///< reduced where it applies, else direct
  pgs,        ///< projected Gauss-Seidel, (16) of the note (PhysX, Mimic Joints): q fixed over the sweeps
  tgs,        ///< temporal Gauss-Seidel, (16) with C renewed in each of `iterations` sub-steps, r frozen
  direct,     ///< all couplings at once by LDL^T; exact for chains and stars of couplings
  reduced,    ///< followers of always-hard couplings eliminated when compiling, soft ones solved as in direct
};

/// "pgs", "tgs", "direct", "reduced", "automatic".
const char* name(Method method) noexcept;

/// How positions and velocities are taken through time, docs/mathematics.md sections 9 and 13; docs/accuracy.md says
/// which to choose. All but `euler` are for smooth scenes: no bounds (limits, friction, kinematic drives, force limits)
/// but those that StepSettings::ignore leaves out, the methods direct or reduced, no recordings, velocity_iterations of
/// at least 1 where couplings are hard, and no Parameter::softness of couplings that state theirs by erp and cfm. One that
/// is asked for and does not apply is a SettingsError; automatic takes euler then, and describe() says why.
enum class Integrator {
  automatic,    ///< leapfrog where it applies, else euler
  euler,        ///< semi-implicit Euler, (M45): first order, for every scene
  leapfrog,     ///< second order, linear terms implicit, (M66) to (M70): two to three times the cost
  extrapolated, ///< third order, from leapfrogs of one and of half a step, (M71): about three times the cost of leapfrog;
                ///< hard couplings' erp at most 1.75
  runge_kutta,  ///< the classical one of fourth order, (M72): every coupling hard and eliminated, no drives and damping too
                ///< stiff for the step at the model's start, (M75). Velocities that start off their couplings come back
                ///< in some steps, 0.375 of what is left in each; the others take one
};

/// "automatic", "euler", "leapfrog", "extrapolated", "runge_kutta".
const char* name(Integrator integrator) noexcept;

/// What may differ from environment to environment; each is a field that must be declared when compiling.
/// The rows of each field in Batch::parameter():
enum class Parameter : unsigned {
  gear_ratio,    ///< per coupling, in order: one row for each of its terms (ratios of Coupling::terms)
  offset,        ///< one row per coupling: gamma
  softness,      ///< two rows per coupling: `first` and `second` of its Softness, of the kind the model states;
                 ///< the second row of a hard one is its cfm
  drive_gains,   ///< two rows per dof: kp and kd
  damping,       ///< one row per dof
  mass,          ///< one row per link of the model, kg; the inertia scales with it, the centre stays
  gravity,       ///< three rows: x, y, z in m/s^2, world axes
  link_wrench,   ///< six rows per link of the model: torque about the link frame's origin (N m), then force (N),
                 ///< both in world axes; zero at the start, held until changed
  coupling_switch,  ///< one row per coupling: 0 is off, anything else on; 1 at the start
};
inline constexpr int parameter_count = 9;

/// "gear_ratio", "offset", ...
const char* name(Parameter parameter) noexcept;

/// A set of Parameters.
class ParameterSet {
 public:
  constexpr ParameterSet() = default;
  constexpr ParameterSet(std::initializer_list<Parameter> list) {
    for (Parameter p : list) bits_ |= 1u << static_cast<unsigned>(p);
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
  double dt = 1.0 / 240.0;           ///< s, > 0
  Method method = Method::automatic;
  Integrator integrator = Integrator::automatic;
  int iterations = 4;                ///< sweeps of pgs, sub-steps of tgs, 1 to 1000; direct and reduced ignore it
  int velocity_iterations = 1;       ///< 0 to 1000; after the position update, so that the velocity that
                                     ///< corrects positions stays out of the state. For direct and reduced any
                                     ///< number >= 1 means the same solve once more
  ParameterSet per_environment = {};  ///< fields that differ from environment to environment
  Ignored ignore = {};
  bool stage_inputs = false;         ///< position_targets(), velocity_targets() and efforts() of a Batch have the dofs'
                                     ///< rows once for each of Plan::stage_times(), in that order; else what they
                                     ///< hold is held over the step. Euler has one time only
  bool record_impulses = false;      ///< keep the couplings' impulses for Batch::coupling_impulses(); automatic
                                     ///< integrators are euler then, and likewise with the next
  bool record_diagnostics = false;   ///< keep what Batch::row_residuals(), energy_balances() and conflicts() show
  double position_bound = 1e5;       ///< rad or m; beyond it an environment is frozen, Fault::diverged.
                                     ///< Angles in float lose 6e-8 of their size, so keep them small
  double velocity_bound = 1e5;       ///< rad/s or m/s; the same
};

}  // namespace lockstep
