// Plan: a Model compiled to flat tables that hold only what the scene uses. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "lockstep/model.h"
#include "lockstep/query.h"
#include "lockstep/step.h"

namespace lockstep {

struct Program;

/// What a follower follows: q = sum of ratio * q_leader + offset, with the model's numbers.
struct Following {
  struct Leader {
    int dof;       ///< an independent one
    double ratio;  ///< rad or m of the follower per rad or m of the leader
  };
  std::vector<Leader> leaders;  ///< empty for independent and for locked joints
  double offset = 0.0;          ///< rad or m
  /// Whether it follows a function (Coupling::function), or what does. Then q is that of the sum where the model
  /// starts, and ratios are the slopes there.
  bool curved = false;
};

/// Joints that hard couplings leave one position.
struct LockedJoints {
  std::vector<int> dofs;
  std::vector<int> couplings;  ///< that lock them
};

/// A tree of links, and what rows of a Batch belong to it.
struct PlanTree {
  std::string root;       ///< its root link
  int floating_root;      ///< n: rows 7n to 7n + 6 of root_poses() and 6n to 6n + 5 of root_velocities(); -1 if bolted
  std::vector<int> dofs;  ///< ascending
};

/// A loop, and what its rows hold where the model starts.
struct PlanLoop {
  std::string name;
  int rows;       ///< 3 to 6
  int redundant;  ///< of them, those that follow from couplings and from rows before: a planar loop has some
};

/// Two colliders that may touch, and the slots in which their contact points stand.
struct PlanContact {
  std::string name;       ///< "first-second"
  int first, second;      ///< in Model::colliders
  int first_slot, slots;  ///< of Quantity::contact_point
  double friction, restitution;
  double torsional_friction, rolling_friction;  ///< m
};

/// Something of the scene or its settings that keeps a method, an integrator or a part of a step from applying.
struct Obstacle {
  std::string feature;     ///< what stands in the way: "tendons", "contacts", "softness per environment"
  std::string applies_to;  ///< what it keeps from applying: "tgs", "runge_kutta", "folding", "stages", "audit"
  std::string reason;
  std::string remedy;  ///< empty where the plan does as well without
};

/// An immutable compiled model; copies share it. Thread-safe.
///
/// Rows of a Batch follow the Model: dofs are its moving joints in the order of Model::joints,
/// couplings, links and sites have the order of theirs.
class LOCKSTEP_API Plan {
 public:
  const Model& model() const;
  const StepSettings& settings() const;

  /// Of the model and the settings as they were given, and of the model alone: every name and every bit of every number
  /// counts. The same on every machine, and by every version of the library with the same format of save points. Two
  /// plans that differ have the same with a chance of 2^-64.
  std::uint64_t hash() const;
  std::uint64_t model_hash() const;

  Method method() const;          ///< the one in use, never automatic
  Integrator integrator() const;  ///< the one in use, never automatic

  /// When in a step targets and efforts are used, as shares of dt, in the order of the rows that
  /// StepSettings::stage_inputs asks for. Some times come twice.
  std::vector<double> stage_times() const;

  int dofs() const;  ///< moving joints; the six velocities of each floating root are apart
  int couplings() const;
  const std::vector<std::string>& root_names() const;  ///< links that float, in the order of Batch::root_poses()
  const std::vector<PlanTree>& trees() const;          ///< in the order of Model::roots
  const std::vector<PlanContact>& contacts() const;    ///< pairs of colliders, groups resolved
  const std::vector<PlanLoop>& loops() const;          ///< in the model's order
  /// Dofs that the loops leave no motion of their own where the model starts, in ascending order: one for each row that
  /// is not redundant, or fewer if trees float. Joints without a drive come first, the last ones of a tree before those
  /// that carry them. They are among independent_dofs(): no coupling says where they are.
  const std::vector<int>& loop_dependent_dofs() const;
  const std::vector<std::string>& dof_names() const;  ///< joint names, by dof
  int dof(const std::string& joint) const;            ///< throws UsageError for unknown or fixed joints
  int link(const std::string& name) const;            ///< index of the link; throws UsageError for an unknown one
  int site(const std::string& name) const;            ///< index of the site; throws UsageError for an unknown one
  int pose(const std::string& name) const;            ///< index in Model::poses; throws UsageError for an unknown one
  int contact(const std::string& name) const;         ///< index of a pair; throws UsageError for an unknown one
  int parameter_rows(Parameter parameter) const;      ///< rows of that field, declared or not; throws UsageError
  /// What the rows of a field are about, declared or not, for instance "driver" or "driver upper". Ratios are
  /// "follower: leader". A component comes last: "kp" and "kd"; "lower" and "upper"; "x", "y", "z"; "ixx" ... "iyz";
  /// "torque x" ... "force z"; of a softness "erp" and "cfm", "kp" and "kd", or "frequency" and "damping ratio". Throws
  /// UsageError for none of the enumerators.
  const std::vector<std::string>& parameter_row_names(Parameter parameter) const;

  /// Rows that Batch::read() writes for the query. Throws UsageError for elements outside the plan and a scale that is
  /// NaN.
  int query_rows(const Query& query) const;

  /// Everything that a step holds or bounds, in the order of Batch::row_residuals() and row_states(): "coupling NAME"
  /// for each coupling, "loop NAME" for each loop, then by dof what it has of "position limit NAME", "velocity limit
  /// NAME", "friction NAME", "kinematic drive NAME", "effort limit NAME".
  const std::vector<std::string>& row_names() const;

  /// Couplings (indices) that follow from others, found by rank. They take no impulse.
  const std::vector<int>& redundant_couplings() const;
  /// Followers (dofs) that the method reduced has eliminated.
  const std::vector<int>& eliminated_dofs() const;

  // Couplings leave the independent joints free and place the followers. The choice does not depend on the softness of
  // couplings, nor on the method. A coupling's first joint is its follower, unless an earlier coupling has it already
  // or another joint's ratio is more than 1000 times larger. Then it is the joint with the largest ratio that is left.

  /// The dofs that place all others, in ascending order.
  const std::vector<int>& independent_dofs() const;
  /// Those that follow targets: joints, followers and tendons with a drive in the model, and all independent ones where
  /// drive_gains are declared. A follower's target is its own position; its drive moves it through its leaders. Locked
  /// joints are left out. In ascending order.
  const std::vector<int>& driven_dofs() const;
  /// All others than independent ones, in an order in which each can be computed from the ones before; those of
  /// couplings in a ring come last and are computed together.
  const std::vector<int>& follower_dofs() const;
  /// What a dof follows, through all couplings between. Throws UsageError for a dof outside the plan.
  const Following& following(int dof) const;
  /// The one leader of a follower; -1 for an independent dof, a locked one and one that follows several (see
  /// following()). Throws UsageError for a dof outside the plan.
  int leader(int dof) const;
  /// Joints that cannot move because always-hard couplings contradict their motion. describe() names them.
  const std::vector<LockedJoints>& locked_joints() const;

  /// What the model and the settings keep from applying: methods, where the integrator is automatic; integrators beside
  /// this plan's method; soft couplings in the matrix ("folding"), bounds in the stages of leapfrog ("stages"), the
  /// watch over energy ("audit"). compile() refuses what is named here, but for the last three, which describe() tells
  /// too. Not named are rates that are too fast for runge_kutta: they are measured where it is asked for. Thread-safe.
  std::vector<Obstacle> obstacles() const;

  /// In words: what a step does, by which method and why, what was left out, which engine runs it, what it costs.
  std::string describe() const;

  /// Floating-point operations of one step of one environment by the tables; a fused multiply-add is two, a sine and
  /// cosine are what their polynomials take. Without what is solved only where a bound acts or a servo is at its limit.
  long flops_per_step() const;
  /// Bytes that step(1) reads and writes in memory for one environment, at the given scalar size.
  long bytes_per_step(int scalar_bytes) const;
  /// Bytes that a Batch holds for one environment, at the given scalar size.
  long bytes_per_environment(int scalar_bytes) const;

 private:
  friend LOCKSTEP_API Plan compile(const Model& model, const StepSettings& settings);
  friend const Program& program_of(const Plan& plan);
  explicit Plan(std::shared_ptr<const Program> program) : program_(std::move(program)) {}
  std::shared_ptr<const Program> program_;
};

/// Validates and compiles. Throws ModelError (the model is impossible; hard couplings that contradict
/// each other are named) or SettingsError. Thread-safe.
LOCKSTEP_API Plan compile(const Model& model, const StepSettings& settings = {});

}  // namespace lockstep
