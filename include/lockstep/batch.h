// Batch: many environments of one Plan, stepped together. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "lockstep/plan.h"

namespace lockstep {

/// Why an environment was frozen. The code is sticky until the environment is reset.
enum class Fault : std::uint32_t {
  none = 0,
  not_finite = 1,  ///< the step would have left a position or velocity that is no number, or infinite
  diverged = 2,    ///< ... or beyond StepSettings::position_bound or velocity_bound
  singular = 3,    ///< the mass matrix is not positive definite, or not finite: a per-environment parameter is
                   ///< impossible, or the masses are too far apart for this precision
};

/// "none", "not_finite", ...
const char* name(Fault fault) noexcept;

/// The instruction set that the kernels use. All give the same answers to rounding; those of one
/// arithmetic class (fused: avx2, avx512, neon and the scalar twins; unfused: baseline and its twin) the same bits.
enum class Target {
  automatic,       ///< the best this machine has; the environment variable LOCKSTEP_TARGET, set to one of
                   ///< the names below, takes precedence
  baseline,        ///< what every processor has: SSE2 or NEON, multiply-adds as two instructions
  baseline_scalar, ///< its scalar twin: one environment at a time, the same bits
  avx2,            ///< AVX2 and FMA
  avx2_scalar,     ///< its scalar twin
  avx512,          ///< AVX-512 F, BW, DQ and VL; avx2_scalar is its scalar twin as well
  neon,            ///< AArch64
  neon_scalar,     ///< its scalar twin
};

/// Every one but automatic, whether this machine supports it or not.
inline constexpr Target all_targets[] = {Target::baseline, Target::baseline_scalar, Target::avx2, Target::avx2_scalar,
                                         Target::avx512, Target::neon, Target::neon_scalar};

/// "baseline", "baseline_scalar", "avx2", "avx2_scalar", "avx512", "neon", "neon_scalar", "automatic".
const char* name(Target target) noexcept;
bool supported(Target target) noexcept;  ///< by this machine

struct BatchOptions {
  int threads = 0;  ///< 1: the calling thread, no allocation in step; 0: the oneTBB arena of the caller
                    ///< (all cores unless the caller limits it); n > 1: an arena of n of its own
  Target target = Target::automatic;
  bool generated = true;  ///< take the kernel that was generated for the plan (generate.h), if this program holds one
  /// Otherwise take the step as a list of operations, each done for 64 environments or so before the next: always,
  /// never, or where that is known to be faster than the tables' loops if there are enough environments - up to 30
  /// velocities to solve for, but not beside friction, kinematic drives or couplings with a force limit, nor by reduced
  /// or direct where all couplings are soft. describe() tells. Rounds otherwise than they do. Listing takes milliseconds, once for a plan. Plans that
  /// solve lane by lane or until a servo's limit of effort is satisfied, or take over 40,000 operations, stay with the
  /// tables. For tests, the environment variable LOCKSTEP_LISTED, set to 0 or 1, stands for a value that is not given;
  /// set to anything else it is a SettingsError.
  std::optional<bool> listed = {};
};

/// State and inputs of many environments, structure of arrays, and the step over them.
///
/// S is float or double. Views are row-major: row = dof (coupling, ...), column = environment, so one
/// row is contiguous. Rows are padded; use the view's outerStride, or Eigen expressions. Views stay
/// valid for the life of the Batch; write to them between steps, from any thread but one at a time.
/// The functions of one Batch are not thread-safe against each other; different batches are independent.
///
/// The same bits result for any number of threads, batch size and place in the batch.
template <class S>
class Batch {
  static_assert(std::is_same_v<S, float> || std::is_same_v<S, double>, "a Batch holds float or double");

 public:
  using Scalar = S;
  /// Plain malloc and free, so that library and application may be compiled with other -m flags.
  using Array = Eigen::Array<S, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor | Eigen::DontAlign>;
  using View = Eigen::Map<Array, Eigen::Unaligned, Eigen::OuterStride<>>;
  using ConstView = Eigen::Map<const Array, Eigen::Unaligned, Eigen::OuterStride<>>;

  /// All environments start in the model's state. Throws SettingsError for environments < 1 or an
  /// unsupported target, UsageError for numbers that S cannot hold.
  Batch(const Plan& plan, int environments, const BatchOptions& options = {});
  ~Batch();
  Batch(Batch&&) noexcept;
  Batch& operator=(Batch&&) noexcept;

  const Plan& plan() const;
  int environments() const;
  Target target() const;  ///< the one in use
  std::string kernel() const;  ///< what steps it: "tables", "operations" or "generated NAME"

  // --- state, to read and to write -------------------------------------------------------------
  View positions();       ///< [dofs][environments] rad or m
  View velocities();      ///< [dofs][environments] rad/s or m/s
  View root_poses();      ///< [7][environments] x, y, z (m), quaternion w, x, y, z; see Root. No rows if fixed
  View root_velocities(); ///< [6][environments] angular, linear, root axes; see Root. No rows if fixed
  ConstView positions() const;
  ConstView velocities() const;
  ConstView root_poses() const;
  ConstView root_velocities() const;

  // --- inputs, held until changed --------------------------------------------------------------
  // With StepSettings::stage_inputs rows come once for each of Plan::stage_times(), dof by dof, time after time; in
  // step(n) each of the n steps looks at the same rows.
  View position_targets();  ///< [dofs or times x dofs][environments]; read only for joints with a drive
  View velocity_targets();  ///< [dofs or times x dofs][environments]; the same
  View efforts();           ///< [dofs or times x dofs][environments] feed-forward, N m or N
  /// A declared per-environment field; rows as listed at Parameter, filled with the model's values.
  /// Throws UsageError for a field that was not declared in StepSettings::per_environment.
  View parameter(Parameter parameter);

  // --- stepping --------------------------------------------------------------------------------
  /// `substeps` steps of dt with the inputs held (decimation). Never throws, never allocates with one
  /// thread. An environment that fails is flagged and keeps its last good state; the others go on.
  void step(int substeps = 1) noexcept;

  /// Back to the model's state, with faults cleared: all, those with a true in the mask (length
  /// environments), or those listed. Inputs and parameters stay. Throws UsageError on a wrong size or index.
  void reset();
  void reset(std::span<const bool> mask);
  void reset(std::span<const int> ids);
  /// Joints to given states: one column per listed environment, rows as in the views. A floating root goes back to the
  /// model's state; root_poses() and root_velocities() may be written afterwards.
  void reset(std::span<const int> ids, const Eigen::Ref<const Array>& positions,
             const Eigen::Ref<const Array>& velocities);

  // --- what happened ---------------------------------------------------------------------------
  std::span<const Fault> faults() const;  ///< one per environment
  int faulted() const;                    ///< how many are not Fault::none

  // --- readbacks, computed when asked for (they allocate their result) --------------------------
  Array coupling_errors() const;    ///< [couplings][environments] C of (3), (17)
  /// [couplings][environments] impulse of the last step, N m s or N s along the coupling's first joint.
  /// Throws UsageError unless StepSettings::record_impulses.
  Array coupling_impulses() const;
  Array link_poses(int link) const;       ///< [7][environments] as root_poses, of any link of the model
  /// [6][environments] angular velocity, then that of the link frame's origin, both in world axes.
  Array link_velocities(int link) const;
  Array site_positions(int site) const;   ///< [3][environments] world, m
  /// [6 * columns][environments]: row 6 c + r is the derivative of component r (angular, then linear
  /// velocity of the site, world axes) by generalised velocity c: the root's six if floating, then the dofs.
  Array site_jacobians(int site) const;
  Array kinetic_energies() const;         ///< [1][environments] J, with the armatures' share
  Array potential_energies() const;       ///< [1][environments] J, gravity alone, zero at the world's origin
  Array momenta() const;                  ///< [6][environments] angular about the world's origin, then linear
  Array limit_violations() const;         ///< [1][environments] farthest that a joint is beyond its position range
  Array speeds() const;                   ///< [1][environments] fastest joint, rad/s or m/s

  // --- diagnostics of the last step: UsageError unless StepSettings::record_diagnostics ----------
  /// [Plan::row_names()][environments] what the step left of each row's condition (M64): the error, in rad or m, that
  /// it should have corrected and did not. 0 for rows that hold, that are inactive, or that slip at their bound.
  Array row_residuals() const;
  /// [Plan::row_names()][environments] 0: the row does not act; 1: it holds; 2, -2: it pushes with all it has, upwards
  /// or downwards; for limits 1 is the lower, -1 the upper end.
  Array row_states() const;
  /// [4][environments] of the last call of step(), J, (M65): work of servos, drives, efforts and bounces; dissipated by
  /// damping and dry friction; work of the corrections of position; change of kinetic and potential energy.
  Array energy_balances() const;
  /// Names of the rows that could not be met in the last step because others were in their way, empty if all were:
  /// those whose residual is beyond rounding. Throws UsageError for an environment outside the batch.
  std::vector<std::string> conflicts(int environment) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

extern template class Batch<float>;
extern template class Batch<double>;

}  // namespace lockstep
