// Batch: many environments of one Plan, stepped together. SPDX-License-Identifier: Apache-2.0
//
// One file: it is one class and what its functions take.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "lockstep/actions.h"
#include "lockstep/coordinates.h"
#include "lockstep/environment_set.h"
#include "lockstep/inverse_kinematics.h"
#include "lockstep/linearize.h"
#include "lockstep/plan.h"
#include "lockstep/random.h"
#include "lockstep/rollout.h"

namespace lockstep {

/// The instruction set that the kernels use. All give the same results to rounding. avx2, avx512 and neon fuse
/// multiply-adds and give the same bits; baseline does not fuse them.
enum class Target {
  automatic,  ///< the best that this machine has. The environment variable LOCKSTEP_TARGET, set to one of the names
              ///< below, takes precedence
  baseline,   ///< what every processor has: SSE2 or NEON, multiply-adds as two instructions
  avx2,       ///< AVX2 and FMA
  avx512,     ///< AVX-512 F, BW, DQ and VL
  neon,       ///< AArch64
};

/// Every one but automatic, whether this machine supports it or not.
inline constexpr Target all_targets[] = {Target::baseline, Target::avx2, Target::avx512, Target::neon};

/// True if this machine has its instructions.
LOCKSTEP_API bool supported(Target target) noexcept;

/// What runs the step. All engines give the same results to rounding; each gives the same bits for any number of
/// threads, batch size and place in the batch. docs/choose.md has their costs.
enum class Engine {
  automatic,  ///< generated where the program holds a kernel for the plan, else compiled where it applies and is known
              ///< to be faster than the tables, else the tables. Plan::describe() tells
  tables,     ///< the solver's stages as loops over tables. Takes every plan
  compiled,   ///< machine code of the plan for the target, made in milliseconds when the first Batch of the plan is
              ///< made. For AVX2 and AVX-512. Not for every plan: Plan::describe() tells
  generated,  ///< straight-line code that was written for the plan and compiled into the program (generate.h)
};

/// The enumerator's name: "avx2", "compiled" ... The string lives forever.
LOCKSTEP_API const char* to_string(Target target) noexcept;
LOCKSTEP_API const char* to_string(Engine engine) noexcept;

struct BatchOptions {
  /// 1: the calling thread; step() allocates nothing. n > 1: an arena of n threads of its own. 0: as many as this
  /// process may use. That is the oneTBB arena of the caller, which has all processors of the affinity mask unless the
  /// caller limits it. Where that arena has more threads than the affinity mask and the quota of the control group
  /// grant, it is an arena of its own with as many as they do.
  int threads = 0;
  Target target = Target::automatic;
  Engine engine = Engine::automatic;
  std::uint64_t seed = 0;      ///< of all environments: what Batch::seeds() begins with
  std::uint32_t first_id = 0;  ///< of environment 0; the others count on: what Batch::ids() begins with
  /// Holds the threads to the processors of one memory domain (NUMA node), and the batch's memory in it. -1: any. 0, 1
  /// ... in the order of tbb::info::numa_nodes(), which sees only one unless oneTBB finds hwloc (Debian:
  /// libtbbbind-2-5). Whoever has several domains runs a process or a batch for each.
  int memory_domain = -1;
};

/// The couplings by which Batch::project() and Batch::reset() place followers.
enum class Couplings {
  none,
  hard,  ///< that are hard in the environment, with a force limit or without. The stretch of a soft coupling is part of
         ///< the state and stays
  all,   ///< soft ones too: their springs are at rest then
};

/// What Batch::reset() does beside putting the state back.
struct ResetOptions {
  bool keep_inputs = false;             ///< targets and efforts stay; otherwise they become the model's, too
  Couplings project = Couplings::hard;  ///< for given states: see Batch::project()
};

/// What Batch::restore() takes beside a blob of its own plan.
struct RestoreOptions {
  /// Also a blob of the same model with other settings. Fields that the blob lacks keep their values; a field or rows
  /// of inputs that only the blob has are refused. The audit of energy begins anew. Steps count the blob's dt.
  bool other_settings = false;
};

/// What Batch::reset_to() changes at random of a floating root. Numbers are the largest change to either side, >= 0.
struct RootNoise {
  std::string link = {};                               ///< root link; empty: all floating roots that no other names
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< along x, y and z of the world, m
  double yaw = 0.0;                                    ///< about the world's z, rad, at most pi
  bool any_rotation = false;      ///< in place of yaw and of the pose's own rotation: uniform over all
  double angular_velocity = 0.0;  ///< about each of the world's axes, rad/s
  double linear_velocity = 0.0;   ///< along each, m/s
};

/// What Batch::reset_to() changes at random of a pose, and how it resets. All draws are uniform, (M141) and (M142) of
/// docs/mathematics.md. Numbers are >= 0.
struct PoseNoise {
  double position = 0.0;               ///< the largest change of the joints' positions to either side, rad or m
  double spread = 0.0;                 ///< beside it, this share of the way to each end of the joint's range, 0 to 1
  double velocity = 0.0;               ///< the largest change of the joints' velocities, rad/s or m/s
  std::vector<RootNoise> roots = {};   ///< floating roots that none is about are where the pose has them
  unsigned stream = 0;                 ///< below stream_count
  bool keep_inputs = false;            ///< see ResetOptions
  Couplings project = Couplings::all;  ///< by which followers are placed; soft ones are at rest then
};

/// Where Batch::reset_random() puts environments.
struct RandomReset {
  double spread = 1.0;                 ///< share of the way from the model's start to each end of the range, 0 to 1
  double speed = 0.0;                  ///< the largest change of a velocity, rad/s or m/s, >= 0
  unsigned stream = 0;                 ///< below stream_count
  bool keep_inputs = false;            ///< see ResetOptions
  Couplings project = Couplings::all;  ///< by which followers are placed; soft ones are at rest then
};

/// A coupling that project() could not meet, because others that are placed before it contradict it: ratios, offsets or
/// switches of this environment leave no position for all of them.
struct UnmetCoupling {
  int environment;
  int coupling;           ///< -1: a loop is not met
  double error;           ///< C that is left, rad or m of its first joint; NaN if the state is
  double velocity_error;  ///< dC/dt, rad/s or m/s
  int loop = -1;          ///< a loop that does not close; its errors are over all its rows, m and rad
};

/// Where and when an environment failed.
struct FaultReport {
  Fault fault = Fault::none;
  FaultStage stage = FaultStage::none;
  /// The dof whose new position or velocity is beyond its bound or NaN, the fastest one if the motion is too
  /// fast, or the one with the bad action. -1 where a floating root, a parameter or the matrix is to blame.
  int dof = -1;
  std::uint32_t step = 0;  ///< steps of dt that it had taken since its last reset
  double time = 0.0;       ///< s, of these steps
};

/// A value that stands in a batch and should not.
struct Problem {
  int environment;
  std::string field;    ///< the view: "mass" and other names of Parameters, "positions", "position_targets" ...
  int row;              ///< of the view; of a rule about several rows the first
  double value;         ///< there, or their sum if that is what the rule is about
  std::string element;  ///< "mass of link 'forearm'"
  std::string rule;     ///< "must be above 0"
};

/// Rows of numbers in memory of the caller: the number of a row and an environment stands at
/// data[row * row_stride + environment * environment_stride]. Strides count numbers. So rows of a view are
/// {view.data(), view.outerStride()}, and one row for each environment is {data, 1, width}.
template <class S>
struct StridedRows {
  S* data = nullptr;
  std::ptrdiff_t row_stride = 0, environment_stride = 1;
};

/// State and inputs of many environments as a structure of arrays, and the step over them.
///
/// S is float or double. Views are row-major: a row is a dof (or coupling, ...), a column is an environment, so one row
/// is contiguous. Rows are padded; use the view's outerStride, or Eigen expressions. Views stay valid for the life of
/// the Batch; write to them between steps.
///
/// A batch that was moved from throws UsageError, except that step() does nothing; it may be assigned to.
///
/// Thread-safety: the functions of one Batch, const ones too, must not run at the same time. Different batches are
/// independent. While one runs, step() does nothing and returns false, and resets, project(), copy(), save(), restore()
/// and readbacks that compute throw UsageError.
///
/// The same bits result for any number of threads, batch size and place in the batch. step() and what draws random
/// numbers round to nearest whatever the caller does; compile() and readbacks round as the caller.
template <class S>
class LOCKSTEP_API Batch {
  static_assert(std::is_same_v<S, float> || std::is_same_v<S, double>, "a Batch holds float or double");

 public:
  using Scalar = S;
  /// Plain malloc and free, so that library and application may be compiled with different -m flags.
  using Array = Eigen::Array<S, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor | Eigen::DontAlign>;
  using View = Eigen::Map<Array, Eigen::Unaligned, Eigen::OuterStride<>>;
  using ConstView = Eigen::Map<const Array, Eigen::Unaligned, Eigen::OuterStride<>>;

  /// All environments start in the model's state. Throws SettingsError for environments outside 1 to 2^24, threads
  /// outside 0 to 1024, a target that this machine does not support or an engine that does not take the plan,
  /// UsageError for numbers that S cannot hold, std::bad_alloc. All memory is taken here, that of threads too.
  Batch(const Plan& plan, int environments, const BatchOptions& options = {});
  ~Batch();
  Batch(Batch&&) noexcept;
  Batch& operator=(Batch&&) noexcept;

  const Plan& plan() const;
  int environments() const;
  int threads() const;              ///< how many may work on a step that the calling thread begins
  Target target() const;            ///< the one in use, never automatic
  Engine engine() const;            ///< the one in use, never automatic
  std::string kernel_name() const;  ///< of the generated kernel in use; empty for other engines

  // --- state, to read and to write -------------------------------------------------------------
  // Contacts go on where positions, velocities or poses are written: what touches before and after keeps what it holds
  // by friction, and what does not touch any more has nothing. See forget_contacts().
  /// [dofs][environments] rad or m. A joint that turns for ever shows its whole angle, rounded: see angles(). A number
  /// that is written is taken as it is. A step puts tendons where their joints are, whatever is written.
  View positions();
  View velocities();  ///< [dofs][environments] rad/s or m/s
  /// [7 roots][environments] x, y, z (m), quaternion w, x, y, z of each floating root, in the order of
  /// Plan::root_names(). See Root.
  View root_poses();
  View root_velocities();  ///< [6 roots][environments] angular, then linear, in the root's axes, in the same order
  ConstView positions() const;
  ConstView velocities() const;
  ConstView root_poses() const;
  ConstView root_velocities() const;

  // --- inputs, held until changed --------------------------------------------------------------
  // With StepSettings::stage_inputs they have the dofs' rows once for each of Plan::stage_times(), one time after the
  // other. Each of the n steps of step(n) uses the same rows.
  View position_targets();  ///< [dofs or times x dofs][environments] rad or m; used by joints with a drive only
  View velocity_targets();  ///< [dofs or times x dofs][environments] rad/s or m/s; the same
  View efforts();           ///< [dofs or times x dofs][environments] feed-forward, N m or N
  /// A per-environment field; rows as listed at Parameter, filled with the model's values. The next step uses what is
  /// written. Throws UsageError for a field that was not declared in StepSettings::per_environment.
  View parameter(Parameter parameter);

  /// Actions [actions][environments] of an agent, mapped to targets or efforts, of all stage times alike. An
  /// environment with a NaN among its actions gets Fault::bad_input at once. Environments with a fault keep their
  /// inputs. Allocates nothing. Throws UsageError, and changes nothing, for a map that does not fit, and for a joint
  /// without the limit that is to be its range. Actions must not lie in memory of this batch.
  void set_actions(const StridedRows<const S>& actions, const ActionMap& map = {},
                   const EnvironmentSet& which = EnvironmentSet::all());

  // --- stepping --------------------------------------------------------------------------------
  /// `substeps` steps of dt with the inputs held. Never throws; allocates nothing with one thread. An environment that
  /// fails is flagged and keeps its last good state; the others go on.
  ///
  /// Before the first of them, quaternions of root_poses() that are not unit are normalised, and environments with an
  /// impossible value get Fault::bad_value. The host's rounding mode and floating-point traps do not matter.
  /// Returns false, and does nothing, where another function of this batch runs.
  bool step(int substeps = 1) noexcept;
  /// The same, and calls `before` with 0, 1 ... before each step of dt: for motor models, controllers and forces of
  /// your own. It may call any function of this batch and write to its views. It is called in the caller's thread,
  /// once for all environments, frozen ones too. The steps have the bits of step() called as often.
  /// What is said of the last call of step() is then said of the last step alone. Costs what as many calls of step(1)
  /// do. What `before` throws passes through, and the steps before it stay. Throws UsageError where `before` is empty.
  bool step(int substeps, const std::function<void(int substep)>& before);

  /// Back to the model's state and inputs. Parameters stay. Clears the faults of these environments and of no others;
  /// nothing else clears a fault, not even writing to a faulted environment. Throws UsageError for environments that do
  /// not fit, and changes nothing then; so do all functions with an EnvironmentSet.
  void reset(const EnvironmentSet& which = EnvironmentSet::all(), const ResetOptions& options = {});
  /// Joints to given states: one column per listed environment, rows as in the views; views of this batch are allowed.
  /// Where an environment is listed twice, the last column counts. Followers are then placed as project() does it, and
  /// the couplings that it cannot meet are returned. A floating root goes back to the model's state; root_poses() and
  /// root_velocities() may be written afterwards.
  std::vector<UnmetCoupling> reset(std::span<const int> ids, const Eigen::Ref<const Array>& positions,
                                   const Eigen::Ref<const Array>& velocities, const ResetOptions& options = {});

  /// Puts the positions and velocities of followers where the other joints and this environment's ratios and offsets
  /// put them. So it is enough to write the Plan::independent_dofs(), where all couplings take part. Works for every
  /// method. Joints that hold their couplings to rounding keep their bits. Faults stay.
  ///
  /// Returns the couplings that cannot be met, by environment; allocates only where there are some.
  std::vector<UnmetCoupling> project(const EnvironmentSet& which = EnvironmentSet::all(),
                                     Couplings couplings = Couplings::hard);

  /// Contacts begin anew in the next step, as after a reset: for bodies that were put elsewhere by hand. Contact forces
  /// read 0 until then.
  void forget_contacts(const EnvironmentSet& which = EnvironmentSet::all());

  // --- random numbers, see random.h ------------------------------------------------------------
  /// One per environment, to read and to write. Environments of the same id and seed draw the same numbers in the same
  /// episode; the episode is resets().
  std::span<std::uint32_t> ids();
  std::span<std::uint64_t> seeds();
  std::span<const std::uint32_t> ids() const;
  std::span<const std::uint64_t> seeds() const;
  /// [rows][environments] uniform in [0, 1), multiples of 2^-24, so float and double are the same numbers. A row has
  /// the same number however many rows are drawn. Other environments stay unwritten. Allocates nothing. Throws
  /// UsageError for a stream that is none, a negative number of rows, or rows without memory.
  void draw(const StridedRows<S>& out, int rows, unsigned stream = 0,
            const EnvironmentSet& which = EnvironmentSet::all()) const;
  /// The same, from the standard normal distribution.
  void draw_normal(const StridedRows<S>& out, int rows, unsigned stream = 0,
                   const EnvironmentSet& which = EnvironmentSet::all()) const;
  /// Writes a declared field: its compiled values, changed by random numbers of each environment and row. Calls do not
  /// add up, and one in the same episode and stream draws the same again.
  ///
  /// Throws UsageError, and writes nothing, for a field that was not declared and for results that a Model could not
  /// have: it names element, bound and remedy. What low and high allow is judged; normal draws, and rules about several
  /// rows, are judged by the values that would be written.
  void randomize(Parameter parameter, const Randomization& how, const EnvironmentSet& which = EnvironmentSet::all());
  /// Resets to one of Model::poses, by name or by number, with noise; "" and -1 are the model's own start. Noise acts
  /// on the Plan::independent_dofs() and on floating roots. It carries no joint out of its range, or farther out than
  /// the pose is; the range is the environment's, where position_limits are declared. `spread` needs two finite limits.
  /// Followers are then placed as project() does it, beyond their own ranges if need be, and loops are closed; what
  /// cannot be met is returned. The episode counts on before it draws, as in reset(). Allocates only where something is
  /// not met. Throws UsageError for an unknown pose or root, and for numbers outside the ranges of PoseNoise and
  /// RootNoise.
  std::vector<UnmetCoupling> reset_to(const EnvironmentSet& which, int pose, const PoseNoise& noise = {});
  std::vector<UnmetCoupling> reset_to(const EnvironmentSet& which, const std::string& pose,
                                      const PoseNoise& noise = {});
  /// reset_to() the model's own start, with this spread and speed. A spread of 0 is the start, one of 1 the whole
  /// range.
  std::vector<UnmetCoupling> reset_random(const EnvironmentSet& which = EnvironmentSet::all(),
                                          const RandomReset& how = {});

  // --- saving ----------------------------------------------------------------------------------
  /// All environments, or those listed in that order, as bytes: state, inputs, declared parameters, faults, counts and
  /// what the library keeps between steps. restore() puts them into any places of any batch of that plan, scalar and
  /// byte order, where they continue with the same bits; with the same arithmetic, that is, as for any step. The
  /// diagnostics and impulses of the last step are not saved; restore() makes them 0. Throws UsageError for an
  /// environment outside the batch.
  std::vector<std::byte> save() const;
  std::vector<std::byte> save(std::span<const int> ids) const;
  /// Environments of the blob into those of the batch: all, which must be as many, or those that `from` lists (all if
  /// it is empty) into those that `into` lists. Where an environment is listed twice, the last one counts. Throws
  /// UsageError on a byte that is not as save() wrote it, another byte order, scalar, plan or format, a fault or dof
  /// that the plan does not have, a wrong size or index, and changes nothing then. Other numbers are taken as they are:
  /// check() looks at them. Checksums find damage, not malice.
  void restore(std::span<const std::byte> blob, const RestoreOptions& options = {});
  void restore(std::span<const std::byte> blob, std::span<const int> into, std::span<const int> from = {},
               const RestoreOptions& options = {});

  /// Makes environments equal to `from`: state, inputs, declared parameters, faults, counts, what the library keeps
  /// between steps, and what it has read of the last one. They keep their ids, seeds and resets(), so they draw other
  /// numbers. Allocates nothing. Throws UsageError for an environment outside the batch, and changes nothing then.
  void copy(int from, const EnvironmentSet& to = EnvironmentSet::all());
  // --- planning --------------------------------------------------------------------------------
  /// Rollouts from saved states. The batch is the workspace: its environments are overwritten, and those that were used
  /// end where their last rollouts end.
  ///
  /// `start` is a blob of save(): of one environment, from which all rollouts start, or of one for each rollout. Empty:
  /// rollout i starts from environment i as it stands, and there are as many rollouts as environments. A blob holds the
  /// parameters, too. In each control step controls become inputs as set_actions() does it, `substeps` steps are taken,
  /// and the rows of the queries are written to `out`, as read() does it. Rollouts that are more than the environments
  /// are taken in turns. A rollout that fails keeps its last good state, and its fault is returned.
  ///
  /// Controls and `out` must not lie in memory of this batch. Allocates nothing per step with one thread. Throws
  /// UsageError, and changes nothing, for numbers of rollouts, steps and substeps below 1, controls that are NaN or
  /// infinite, rows without memory, a blob as restore() does and an ActionMap as set_actions() does.
  std::vector<Fault> rollout(std::span<const std::byte> start, const StridedSteps<const S>& controls,
                             std::span<const Query> record, const StridedSteps<S>& out, const RolloutOptions& options);

  /// Derivatives of the next step of each environment by state, input and parameter, (M144): centred differences of
  /// copies, which are placed as project() does it and keep what the environment remembers of contacts. The batch stays
  /// as it is. Takes a batch of its own for as long as it runs. A parameter at an end of its range, such as a friction
  /// of 0, is moved away from it alone; what holds for several numbers together may break.
  ///
  /// Throws UsageError for a Batch<float>, whose differences would be rounding; for ContactSettings::tolerance above
  /// 1e-8, as differences of 1e-6 would drown in what solves leave; for fields that are not declared, switches and
  /// infinite limits; for soft loops; and where an environment without a fault has a coupling or loop that is off,
  /// cannot be met or has slipped, or a hard coupling that is soft there.
  std::vector<Linearization> linearize(const EnvironmentSet& which = EnvironmentSet::all(),
                                       const LinearizeOptions& options = {}) const;

  /// Moves the joints of environments so that the site comes as near to its target as it can within the ranges, (M145):
  /// least squares of m and rad, from where the joints are. The nearest is a local one. `targets` are
  /// [3][environments] of the batch, positions in the world, m, or [7][environments], poses as root_poses(). Floating
  /// roots stay, followers, of soft couplings too, and loops are placed as project() does it with the environment's own
  /// ratios and functions.
  /// A joint that starts beyond its range is first put to its end, or, if it follows, goes no further out. Velocities
  /// stay, those of followers are placed.
  ///
  /// Returns what is left, [2][environments]: distance, m, and angle, rad, which is 0 for positions; 0 for others.
  /// Throws UsageError, and changes nothing, for targets that do not fit or are not finite, a site that is none, and
  /// where loops hold floating roots.
  Array inverse_kinematics(int site, const Eigen::Ref<const Array>& targets,
                           const EnvironmentSet& which = EnvironmentSet::all(),
                           const InverseKinematicsOptions& options = {});

  // --- faults ----------------------------------------------------------------------------------
  std::span<const Fault> faults() const;  ///< one per environment
  int faulted() const;                    ///< how many are not Fault::none
  /// All zero but for dof without a fault. Throws UsageError for an environment outside the batch.
  FaultReport fault_report(int environment) const;
  /// In words: the fault, the fields, joints and values that are to blame now, the rule they break and the remedy.
  /// Empty without a fault. Throws UsageError for an environment outside the batch.
  std::string explain_fault(int environment) const;

  /// In words: what runs the steps, by how many threads, and what the last call of step() has spent on contacts and on
  /// rows over several velocities, in the mean of an environment and step, and how many solves have ended at their cap
  /// since the resets. Quantity::solve_counts has the numbers by environment. For people, so the words may change.
  std::string describe() const;

  /// Looks at the values that stand there, by the rules of step(): impossible values in declared fields, NaN and
  /// infinity in state, inputs and fields, root quaternions of 0; and targets that differ from the model's although the
  /// joint has no drive. By environment. Changes nothing.
  std::vector<Problem> check(const EnvironmentSet& which = EnvironmentSet::all()) const;

  // --- counts, one per environment; they wrap around at 2^32 ------------------------------------
  std::span<const std::uint32_t> steps() const;  ///< of dt that it has taken since its last reset
  std::span<std::uint32_t> resets();             ///< of the environment, to read and to write: see ids()
  std::span<const std::uint32_t> resets() const;

  // --- readbacks, computed when asked for ------------------------------------------------------
  /// Writes the rows of the queries one after the other, Plan::query_rows() for each. All frames of links and sites
  /// together take one kinematics pass, each energy takes another. `out` must not lie in memory of this batch.
  /// Allocates nothing with one thread. Throws UsageError for elements outside the plan, a scale that is NaN, and
  /// rows without memory.
  void read(std::span<const Query> queries, const StridedRows<S>& out) const;

  // These allocate their result.
  Array loop_errors() const;      ///< [2 x loops][environments] see Quantity::loop_error
  Array coupling_errors() const;  ///< [couplings][environments] C of (M2), rad or m
  /// [couplings][environments] impulse of the last step, N m s or N s along the coupling's first joint; 0 in
  /// environments with a fault.
  /// Throws UsageError unless StepSettings::record_impulses.
  Array coupling_impulses() const;
  /// [dofs][environments] rad or m, and whole turns: position = angle + 2 pi turns. Revolute joints without a range
  /// turn for ever. They keep the two apart, so neither angles nor couplings lose digits however far they turn. Beyond
  /// 2^20 turns in float, 2^50 in double, they are Fault::diverged. Other joints have no turns. A copy of positions()
  /// is rounded; project() puts its followers right.
  Array angles() const;
  Array turns() const;
  Array link_poses(int link) const;  ///< [7][environments] as root_poses, of any link of the model
  /// [6][environments] angular velocity, then that of the link frame's origin, both in world axes.
  Array link_velocities(int link) const;
  Array site_positions(int site) const;  ///< [3][environments] world, m
  /// [6 * columns][environments]: row 6 c + r is the derivative of component r (angular, then linear velocity of the
  /// site, world axes) by generalised velocity c: the six of each floating root, then the dofs.
  Array site_jacobians(int site) const;
  Array kinetic_energies() const;    ///< [1][environments] J, with the armatures' share
  Array potential_energies() const;  ///< [1][environments] J, of gravity alone, zero at the world's origin
  Array momenta() const;             ///< [6][environments] angular about the world's origin, then linear
  Array limit_violations() const;    ///< [1][environments] how far the worst joint is beyond its range, rad or m
  Array speeds() const;              ///< [1][environments] of the fastest joint, rad/s or m/s

  // --- in independent coordinates, computed when asked for, (M146) --------------------------------
  // Coordinates are the six velocities of each floating root, as root_velocities(), then the open_coordinate_dofs().
  // Hard couplings and functions, with the environment's own numbers, place all other dofs; those with a force limit
  // count as holding. Loops are open: they are constraints on these matrices. Everything is of the state as it stands,
  // in double,
  // [...][listed environments]. Throws UsageError where a hard coupling is off or soft, and for a link or site that is
  // none. What a root's rates are: those of the components of its twist.
  /// [n x n]: row n i + j, kg m^2, kg m or kg. With armatures, also of followers and tendons.
  Array mass_matrices(const EnvironmentSet& which = EnvironmentSet::all()) const;
  /// [n] N m or N: the forces on the coordinates that keep their rates 0. Gravity, Coriolis and centrifugal forces,
  /// and what followers that are functions need as their slope changes. Without springs, servos, damping, friction,
  /// efforts, wrenches, contacts and loops.
  Array bias_forces(const EnvironmentSet& which = EnvironmentSet::all()) const;
  /// [6 x n] as site_jacobians(), by coordinate: of a link's frame, and of a site.
  Array reduced_link_jacobians(int link, const EnvironmentSet& which = EnvironmentSet::all()) const;
  Array reduced_site_jacobians(int site, const EnvironmentSet& which = EnvironmentSet::all()) const;

  // --- diagnostics of the last step: UsageError unless StepSettings::record_diagnostics ----------
  // Rows of environments with a fault are 0.
  /// [Plan::row_names()][environments] what the step left of each row's condition (M64): the error, in rad or m, that
  /// it should have corrected and did not. 0 for rows that hold, that are inactive, or that slip at their bound.
  Array row_residuals() const;
  /// [Plan::row_names()][environments] 0: the row is inactive; 1: it holds; 2, -2: it pushes with its largest force,
  /// upwards or downwards. For limits 1 is the lower, -1 the upper end.
  Array row_states() const;
  /// [4][environments] of the last call of step(), J, (M65): work of servos, drives, springs, efforts and bounces;
  /// dissipated by damping and dry friction; work of the corrections of position; change of kinetic and potential
  /// energy. Work of Parameter::link_wrench is in none of the first three.
  Array energy_balances() const;
  /// Names of the rows that could not be met in the last step because others contradict them: those whose residual is
  /// beyond rounding. Empty if all were met. Throws UsageError for an environment outside the batch.
  std::vector<std::string> conflicts(int environment) const;

 private:
  struct Impl;
  Impl& impl() const;
  std::unique_ptr<Impl> impl_;
};

extern template class Batch<float>;
extern template class Batch<double>;

}  // namespace lockstep
