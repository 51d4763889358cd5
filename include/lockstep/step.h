// Settings of a step: step size, method, integrator, sweeps, per-environment parameters. SPDX-License-Identifier:
// Apache-2.0
#pragma once

#include <algorithm>
#include <concepts>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

#include "lockstep/enums.h"

namespace lockstep {

/// A set of Parameters.
class ParameterSet {
 public:
  constexpr ParameterSet() = default;
  constexpr ParameterSet(std::initializer_list<Parameter> list) {
    for (Parameter p : list) insert(p);
  }
  constexpr bool contains(Parameter p) const { return (bits_ & bit(p)) != 0; }
  constexpr void insert(Parameter p) { bits_ |= bit(p); }
  constexpr bool empty() const { return bits_ == 0; }
  /// True if it holds a number that is none of the enumerators. compile() refuses such a set.
  constexpr bool has_unknown() const { return bits_ >> parameter_count != 0; }

 private:
  static constexpr unsigned bit(Parameter p) { return 1u << std::min(static_cast<unsigned>(p), 31u); }
  unsigned bits_ = 0;
};

/// Some joints of a model.
struct JointSet {
  JointSet() = default;
  /// All joints, or none.
  template <std::same_as<bool> B>
  JointSet(B takes_all) : all(takes_all) {}
  JointSet(std::initializer_list<std::string> joint_names) : names(joint_names) {}
  /// The followers of couplings: Plan::follower_dofs().
  static JointSet of_followers() {
    JointSet set;
    set.followers = true;
    return set;
  }
  bool empty() const { return !all && !followers && names.empty(); }

  bool all = false, followers = false;
  std::vector<std::string> names;  ///< of moving joints; compile() refuses others
};

/// Bounds that a step leaves out although the model states them, by joint: `true` is all, and
/// `{.position_limits = {"left", "right"}}` or `{.position_limits = JointSet::of_followers()}` are some.
struct Ignored {
  JointSet position_limits = {}, velocity_limits = {}, effort_limits = {}, friction = {};
};

/// How contacts are solved, section 23 of docs/mathematics.md. The defaults are for grasps and legs; lower numbers are
/// faster, and show in the slip of fast motions first. docs/contacts.md, "Environments that differ", has what each
/// costs and misses on three scenes.
struct ContactSettings {
  int passes = 3;           ///< 1 to 100: solves that renew how fast contacts slide
  int rounds = 30;          ///< 1 to 1000: the most Newton rounds of each solve
  double tolerance = 1e-4;  ///< in (0, 0.1]: a solve ends at a smaller change of velocity, relative to 1 + the largest

  /// For learning, where steps count more than their last digits. Impacts and fast slips are off the most.
  static constexpr ContactSettings learning() { return {2, 30, 1e-2}; }
  /// Near the exact law, for measurements and for comparing. Where much slides at once, as in a hand, errors stay.
  static constexpr ContactSettings accurate() { return {10, 30, 1e-4}; }
};

/// The names of ContactSettings in Python and in the command.
inline constexpr std::pair<const char*, ContactSettings> all_contact_settings[] = {
    {"learning", ContactSettings::learning()}, {"default", {}}, {"accurate", ContactSettings::accurate()}};

/// Everything that compile() must know beside the Model. The defaults are what most users want.
struct StepSettings {
  double dt = 1.0 / 240.0;  ///< s, 1e-9 to 1000
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
  /// Keep the efforts of drives for Quantity::drive_effort and its peak and mean. Steps are made by the tables then, by
  /// leapfrog or euler. No joint may have a kinematic drive.
  bool record_efforts = false;
  /// Keep what each pair of Plan::contacts() has done for Quantity::contact_peak_force to contact_first_touch.
  bool record_contacts = false;
  /// Keep the accelerations of the last step for Quantity::joint_acceleration to joint_wrench.
  bool record_accelerations = false;
  /// The largest eta of a step, > 0; infinity switches the guard off. eta is the part of the momentum that a step
  /// misses because velocities change within it: (M91) in docs/mathematics.md. Environments above it take the step in
  /// halves, quarters ... down to 1/32, if the integrator is leapfrog. What is above ten times this even then is frozen
  /// with Fault::too_fast.
  double guard = 0.01;
  ContactSettings contacts = {};
  /// rad or m; an environment beyond it is frozen with Fault::diverged. It is not for joints that turn for ever.
  double position_bound = 1e5;
  double velocity_bound = 1e5;  ///< rad/s or m/s; the same
};

}  // namespace lockstep
