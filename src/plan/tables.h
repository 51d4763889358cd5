// The tables that kernels read: flat, constant, shared by all environments. SPDX-License-Identifier: Apache-2.0
//
// A Program (program.h) owns them. Kernels see only this header, which uses no containers.
// The parts are in tables/.
//
// Indices: `joint` counts the moving joints in the solver's depth-first order, tree by tree; `velocity` counts the
// generalised velocities, tree by tree: a floating root's six, then the tree's joints; `dof` counts the moving joints
// in the Model's order, which is that of the views. Views have the floating roots in the order of Model::roots.
//
// A struct with numbers of type S has a base class for everything else. Its numbers() names each number once:
// narrow.cpp converts them to single precision and asserts that none is forgotten.
#pragma once

#include <cstdint>

#include "lockstep/enums.h"
#include "tables/actuators.h"
#include "tables/bodies.h"
#include "tables/contacts.h"
#include "tables/functions.h"
#include "tables/loops.h"
#include "tables/reduction.h"
#include "tables/rounds.h"
#include "tables/spatial_tendons.h"

namespace lockstep {

constexpr int guard_depth = 5;  ///< how often a step may be halved (M91)

struct TableStructure {
  Method method = Method::direct;
  Integrator integrator = Integrator::euler;
  int input_times = 1;  ///< how many of the step's times have targets and efforts of their own
  int iterations = 0, velocity_iterations = 0;
  int bodies = 0, joints = 0, velocities = 0, couplings = 0, links = 0;
  Span<FloatingRoot> roots;                     ///< in the order of the views
  Span<BallJoint> balls;                        ///< in the order of their bodies
  Span<int> own_weights;                        ///< moving links whose share of gravity is not their tree's
  bool makes_matrix = true;                     ///< A is computed, if only for some trees or for undamped rows
  Span<int> dof, joint_velocity, joint_body;    ///< by joint
  Columns matrix;                               ///< structure of the mass matrix
  Columns solver;                               ///< structure of the matrix that is factored: A or A_r
  Span<SupportRun> factored;                    ///< its velocities, but for those of articulated bodies
  Span<SupportRun> undamped_velocities;         ///< velocities of trees with undamped rows
  Span<int> servos;                             ///< joints with a servo that is linear, until a stage finds it limited
  Span<int> limited_servos;                     ///< joints that have a servo with an effort limit, on one velocity
  Span<int> row_servos;                         ///< joints whose limited servo is a row of Bounds
  Rounds rounds;                                ///< empty if nothing is bounded, kept or touching
  Span<int> springs;                            ///< joints that have a spring
  Span<int> turning;                            ///< joints that turn for ever (M80)
  Span<SupportRun> turning_runs, other_runs;    ///< the same as runs, and those of the other joints
  Span<int> turns;                              ///< by joint: whether it turns for ever; empty if none does
  Span<int> coupling_turns, turning_couplings;  ///< the same for couplings of such joints, and a list of these
  Span<int> turning_placed;                     ///< those that place a follower, in their order in `placing`
  Span<double> exact_ratio, exact_offset;       ///< term_value and offset, in double
  Span<int> limited_efforts;                    ///< joints without a servo whose effort is limited
  Span<int> tendons;                            ///< couplings whose follower is a tendon, (M112)
  Span<int> term_start, term_joint, term_gear;  ///< couplings in joint space; gear: row of the gear_ratio field, -1 for
                                                ///< the leading 1
  Articulated articulated;
  Span<Reported> reported;       ///< only if diagnostics are recorded
  Span<int> follows;             ///< by coupling: 1 if it is redundant and takes no impulse
  Span<int> impulse_coupling;    ///< couplings that have an impulse of their own: those of `rows`, then of `folded`
  Span<int> undamped_row;        ///< in this order: the coupling's row in `undamped`, -1 if none
  Span<int> folded_entry;        ///< of A_r, by row of `folded`, term, and term up to that one
  bool solve_twice = false;      ///< the position phase and the velocity phase have different solutions
  bool guarded = false;          ///< steps that are too coarse are taken in halves (M91)
  bool audited = false;          ///< energy from nowhere is found (M94)
  bool solves_midpoint = false;  ///< these are tables of a solve at a leapfrog's midpoint
  bool renewed = false;          ///< tgs: every sub-step computes its rows anew
  unsigned per_environment = 0;  ///< declared fields, bit by Parameter
  bool record_impulses = false;
  bool record_diagnostics = false;
  bool record_efforts = false;
  bool record_contacts = false;
  bool record_accelerations = false;

  inline __attribute__((always_inline)) bool declares(Parameter parameter) const {
    return (per_environment >> static_cast<unsigned>(parameter)) & 1u;
  }
  /// Whether masses, centres of mass or inertias differ per environment.
  inline __attribute__((always_inline)) bool has_own_inertias() const {
    return declares(Parameter::mass) || declares(Parameter::center_of_mass) || declares(Parameter::inertia);
  }
  /// Whether a batch keeps what its steps have done over a call.
  inline __attribute__((always_inline)) bool records_calls() const {
    return record_efforts || record_contacts || record_accelerations;
  }
  /// Whether the impulses of contacts are summed over the parts of a step.
  inline __attribute__((always_inline)) bool sums_contacts() const { return record_contacts || record_accelerations; }
  /// Whether forces act along the world's axes.
  inline __attribute__((always_inline)) bool has_orientations() const {
    return declares(Parameter::link_wrench) || own_weights.count > 0;
  }
  /// Whether a step guesses which servos are at their limits, and solves again where it was wrong.
  inline __attribute__((always_inline)) bool guesses_servos() const {
    return limited_servos.count > 0 && !rounds.used() && integrator == Integrator::euler;
  }
  inline __attribute__((always_inline)) int velocity_of(int joint) const { return joint_velocity[joint]; }
};

template <class S>
struct Tables : TableStructure {
  const Tables* half = nullptr;  ///< tables of half the step, null at the shortest
  const Tables* midpoint =
      nullptr;  ///< tables of a solve over the whole step at a leapfrog's midpoint (M122), if needed
  S dt = 0;     ///< length of a solve: the step, or gamma times the step (M68)
  S step = 0;   ///< the step
  S ahead = 0;  ///< how far ahead linear terms are taken: dt, or 0 if they are explicit
  S position_bound = 0, velocity_bound = 0;
  S coarse_above = 0, too_fast_above = 0;  ///< squares of eta (M91)
  S fast_above = 0, most_gain = 0;         ///< a velocity, and a share of the kinetic energy (M94)
  S gravity[3] = {};                       ///< world axes
  S free_share = 1;                        ///< share of the free motion that moves positions: (N + 1) / 2N in tgs
  Span<TreePlace<S>> tree;
  Span<Body<S>> body;
  Span<LinkPlace<S>> link;
  Span<S> link_mass;
  Span<S> armature, damping, kp, kd;  ///< by joint
  Span<S> stiffness, rest;            ///< of springs, by joint
  Span<S> implicit;                   ///< armature + dt (damping + kd) + dt^2 (kp + stiffness), by joint
  Span<S> effort_limit;               ///< by joint
  Span<S> term_value, offset;         ///< of couplings in joint space
  Rows<S> rows;
  Bounds<S> bounds;
  Reduction<S> reduction;
  ContactTables<S> contacts;
  LoopTables<S> loops;
  FunctionTables<S> functions;
  SpatialTendonTables<S> spatial;
  ActuatorTables<S> actuators;
  Span<S> hard_rate;  ///< erp / dt by coupling, 0 for soft ones
  Rows<S> undamped;   ///< rows whose softness refers to the undamped inertia, if A differs from that
  Rows<S> folded;  ///< soft couplings that are part of A_r (M95); their numbers in a tile stand behind those of `rows`
  /// Whether a batch keeps what its solves have cost.
  inline __attribute__((always_inline)) bool counts_solves() const { return contacts.used() || rounds.slots.count > 0; }
  /// Whether S differs between environments, or between steps.
  inline __attribute__((always_inline)) bool shares_differ() const {
    return declares(Parameter::gear_ratio) || shares_change();
  }
  /// Whether S differs between steps.
  inline __attribute__((always_inline)) bool shares_change() const { return functions.used() || spatial.used(); }
  /// Whether rounds find the first solution of a step of euler.
  inline __attribute__((always_inline)) bool solves_first() const {
    return limited_servos.count > 0 || row_servos.count > 0 || loops.used();
  }
  inline __attribute__((always_inline)) const TreeStructure& tree_of_joint(int joint) const {
    return tree[body[joint_body[joint]].tree];
  }

  /// All but `half` and `midpoint`.
  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.dt, to.dt), visit(from.step, to.step), visit(from.ahead, to.ahead);
    visit(from.position_bound, to.position_bound), visit(from.velocity_bound, to.velocity_bound);
    visit(from.coarse_above, to.coarse_above), visit(from.too_fast_above, to.too_fast_above);
    visit(from.fast_above, to.fast_above), visit(from.most_gain, to.most_gain);
    visit(from.gravity, to.gravity), visit(from.tree, to.tree);
    visit(from.free_share, to.free_share), visit(from.body, to.body), visit(from.link, to.link);
    visit(from.link_mass, to.link_mass), visit(from.armature, to.armature), visit(from.damping, to.damping);
    visit(from.kp, to.kp), visit(from.kd, to.kd), visit(from.implicit, to.implicit);
    visit(from.stiffness, to.stiffness), visit(from.rest, to.rest);
    visit(from.effort_limit, to.effort_limit), visit(from.term_value, to.term_value), visit(from.offset, to.offset);
    visit(from.rows, to.rows), visit(from.bounds, to.bounds), visit(from.reduction, to.reduction);
    visit(from.contacts, to.contacts), visit(from.loops, to.loops);
    visit(from.functions, to.functions), visit(from.spatial, to.spatial);
    visit(from.actuators, to.actuators);
    visit(from.hard_rate, to.hard_rate), visit(from.undamped, to.undamped), visit(from.folded, to.folded);
  }
};

/// Rows of a per-environment field; -1 for none of the enumerators.
template <class S>
inline __attribute__((always_inline)) int rows_of(const Tables<S>& t, Parameter parameter) {
  switch (parameter) {
    case Parameter::gear_ratio: return t.term_gear.count - t.couplings;
    case Parameter::offset:
    case Parameter::coupling_switch: return t.couplings;
    case Parameter::softness: return 2 * t.couplings;
    case Parameter::drive_gains:
    case Parameter::motor_curve:
    case Parameter::position_limits: return 2 * t.joints;
    case Parameter::damping:
    case Parameter::armature:
    case Parameter::stiffness:
    case Parameter::friction:
    case Parameter::velocity_limit:
    case Parameter::drive_delay:
    case Parameter::drive_lag:
    case Parameter::effort_limit: return t.joints;
    case Parameter::mass: return t.links;
    case Parameter::gravity: return 3;
    case Parameter::contact_friction:
    case Parameter::contact_restitution: return t.contacts.contacts.count;
    case Parameter::collider_place: return 4 * t.contacts.colliders.count;
    case Parameter::collider_size: return 3 * t.contacts.colliders.count;
    case Parameter::loop_switch: return t.loops.loops.count;
    case Parameter::loop_frame: return 7 * t.loops.loops.count;
    case Parameter::function: return t.functions.number.count;
    case Parameter::center_of_mass: return 3 * t.links;
    case Parameter::link_wrench:
    case Parameter::inertia: return 6 * t.links;
  }
  return -1;
}

}  // namespace lockstep
