// Tile: the W environments that a kernel advances together, and its scratch memory. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "../plan/tables.h"
#include "../simd/vec3.h"
#include "lanes.h"

namespace lockstep::kernels {

using simd::Mat3;
using simd::PseudoInertia;
using simd::ScalarOf;
using simd::Vec3;
using simd::each_axis;

/// The codes of Method in step.h.
enum MethodCode { method_pgs = 1, method_tgs = 2, method_direct = 3, method_reduced = 4 };
/// The codes of Integrator in step.h.
enum IntegratorCode { integrator_euler = 1, integrator_leapfrog = 2, integrator_extrapolated = 3, integrator_runge_kutta = 4 };
constexpr int leapfrog_stages = 3;

/// Of the finite ones.
template <class S>
constexpr S largest_number = S(sizeof(S) == 4 ? 3.4028234e38 : 1.7976931348623157e308);

template <class T>
struct Branch;  // projection.h

/// Where bodies are and how they move: world for places, own axes for twists.
template <class T>
struct Motion {
  Mat3<T>* world;
  Vec3<T>* place;
  Vec3<T>* angular;
  Vec3<T>* linear;
};

/// Everything one tile computes with, as arrays of wide numbers in one block of scratch memory.
/// An array that the scene has no use for has length 0.
template <class T>
struct Tile {
  // state
  T* q;                    // [joints]
  T* v;                    // [velocities] root twist, then joints
  T* root_pose;            // [7]
  T* next_q;               // the same after the step, before it is checked
  T* next_v;
  T* next_root_pose;
  T* half_turn;            // [4] quaternion of half the root's turn over the step
  // of integrators with more than one stage
  T* begin_q;              // where the step began: q and v are the stage's meanwhile
  T* begin_v;
  T* begin_pose;
  T* midpoint_q;
  T* midpoint_v;           // [velocities] those of the begin, a root's along the midpoint's axes
  T* stage_v;              // [stages][velocities]
  T* stage_change;         // [stages][velocities]
  T* mean_v;               // [velocities] what moves the positions
  T* gained_v;             // [velocities] what a leapfrog adds to them, along the midpoint's axes
  T* stage_pose;           // [7]
  T* pose_rate;            // [7]
  T* first_q;              // where the first of several steps began
  T* first_v;
  T* first_pose;
  T* change_q;             // of the step
  T* change_v;
  T* change_pose;
  // kinematics and bias forces, by body
  T* sine;
  T* cosine;
  Vec3<T>* angular;        // angular velocity
  Vec3<T>* alpha;          // angular acceleration
  Vec3<T>* linear;         // acceleration of the origin
  Vec3<T>* force;
  Vec3<T>* moment;
  Mat3<T>* world;          // orientation in the world: only with link wrenches
  PseudoInertia<T>* inertia;    // per-environment masses
  PseudoInertia<T>* felt;       // what a step takes for the bodies' masses (M10)
  PseudoInertia<T>* composite;
  Vec3<T>* column_force;   // of the mass matrix, on their way inwards
  Vec3<T>* column_moment;
  // equations of motion
  T* joint_inertia;        // [joints] what A has beyond M; then A's diagonal, if a limited drive wants it
  T* matrix;               // A (packed), unless A_r is made without or bodies are articulated
  T* bias;                 // [velocities] c: the same array as drive unless it is used more than once
  T* drive;                // [velocities] dt times the forces, and what followers lose of their mismatch (by_force)
  T* reduced;              // A_r (packed), and S^T A w behind it where columns are merged; or the root's own part
  T* inverse;              // [solver] 1 / D
  // where bodies are articulated, by slot or body
  simd::ArticulatedInertia<T>* articulated;  // [slots]
  T* factored_q;           // [joints] positions at which that was: those of the tile unless they go on meanwhile
  Vec3<T>* hinge_force;    // [bodies] U D^-1
  Vec3<T>* hinge_moment;
  Vec3<T>* wrench_force;   // [slots] on their way inwards
  Vec3<T>* wrench_moment;
  Vec3<T>* reached_angular;  // [2][bodies] accelerations on their way outwards
  Vec3<T>* reached_linear;
  T* free_position;        // [solver] D^-1 L^-T of the drive, for positions
  T* free_velocity;        // and for velocities: the same array unless they differ
  T* free_velocity_apart;  // where they may
  T* start;                // [solver] the velocities that a step starts from
  T* solution;             // [solver] the velocities that move positions, or what they change by (solve.h)
  T* closing_solution;     // [solver] those that stay: only if they differ
  T* scratch;              // as long as the longest vector, for one stage at a time
  T* product;              // [velocities] momentum to gain, S^T still to come; of by_force, x.drive is that
  T* corrected_product;    // the same less that of the correction
  // what gear ratios make, the same for all environments or this tile's own
  T* coefficient;          // [coupling terms]
  T* offset;               // [couplings]
  T* share;                // entries of S
  T* inverse_form;         // entries of J_F^-1
  T* row_value;            // [row terms]
  T* form;                 // room for the lanes' own elimination
  T* correction;           // [followers] velocity that corrects followers' errors
  T* mismatch;             // [followers] what followers' velocities are off by
  T* lost;                 // [followers] what bias forces take for lost of that
  T* acceleration;         // [followers] for it to be lost within the step
  T* factor;               // products of S's entries for merged columns
  // rows
  T* response;             // [rows][solver] X = L^-T J^T
  T* coupled;              // K
  T* row_error;            // C
  T* row_rate;             // bias = rate C
  T* row_cfm;
  T* row_bias;
  T* row_start;            // J v at the start of the step
  T* row_speed;            // J v
  T* row_residual;           // J v + b + cfm impulse, in sweeps
  T* row_speed_closed;     // the same for the velocity phase
  T* row_inverse;          // 1 / (r + cfm), or of D where K is factored
  T* row_impulse;
  T* position_impulse;
  T* velocity_impulse;
  T* coupling_error;       // [couplings]
  T* impulse;              // [couplings]: only if recorded
  // inertia that soft rows feel, where A holds more than that
  T* natural_matrix;
  T* natural_inverse;
  T* natural_response;     // [velocities]
  T* natural_compliance;   // [natural rows]

  // bounded rows; those marked 2 hold one for each phase
  T* member_share;         // [members] s of (M59)
  T* member_inverse;
  T* bound_value;          // [terms]
  T* bound_lo;             // 2 [rows]
  T* bound_hi;             // 2 [rows]
  T* bound_centre;         // 2 [rows]
  T* bound_eased;          // [rows] speed that the position phase leaves to kinematic drives
  T* bound_pushed;         // [rows] the w / s in what they ask of it
  T* bound_slowest;        // [rows] the speed nearest to none that their limits allow
  T* bound_force;
  T* bound_cfm;
  T* bound_own;            // r before the couplings have their say
  T* bound_free;           // 2 [rows] speed without bounded rows
  T* bound_now;            // speed in a sweep
  T* bound_gain;           // of the free motion in a sub-step
  T* bound_moved;          // way in earlier sub-steps
  T* bound_impulse;        // 2 [rows]
  T* bound_response;       // [rows][solver]
  T* bound_scaled;         // [rows][solver]
  T* bound_through;        // [rows][coupling rows] K_BE, half solved where these are solved
  T* bound_through_scaled;
  T* bound_coupled;        // [rows][rows] of (M61)
  T* alone;                // what the step comes to without bounded rows, the couplings' impulses first (compete.h)
  T* search_matrix;
  T* search_inverse;
  T* search_impulse;
  T* search_speed;
  T* search_noise;         // of pivots
  Branch<T>* search_branch;         // 2 [rows]
  typename T::Mask* search_held;    // [rows]
  typename T::Mask* bound_known;    // 2 [rows] lanes that have a branch to begin with
  typename T::Mask* bound_touched;  // lanes in which the row takes part
  typename T::Mask suspect;         // lanes in which bounds may act at all
  T search_doubts[2];               // by phase: how often it was asked whether sharing is needed
  typename T::Mask search_shared[2];  // by phase: lanes in which rows depend on each other
  typename T::Mask senseless;       // lanes in which a row asks for what is no number
  int* bound_fresh;        // it has begun to in some lane
  int* bound_listed;       // rows that take part in some lane, ascending
  int bound_count;         // how many
  // drives with an effort limit
  T* saturation;           // [limited] -1, 0, 1
  int saturation_pass;

  // only if diagnostics are recorded
  Motion<T> motion;
  T* moved_velocity;       // [velocities] that moved the positions
  T* other_v;              // [velocities] those that would have moved them without corrections
  T* other_q;              // [joints] and where to
  T* other_root_pose;      // [7]
  T* residual;             // [reported]
  T* row_state;            // [reported]
  T* energy;               // [4], summed over sub-steps
  T* energy_change;        // [4] of this one

  typename T::Mask frozen;
  typename T::Mask singular;
  bool in_place;           // all followers of all lanes are, and stay, where the others put them
  bool corrects;           // solutions for positions correct the couplings' errors
  bool solves_twice;       // and velocities want another one
};

template <class T>
LOCKSTEP_INLINE bool declared(const Tables<ScalarOf<T>>& t, int parameter) {
  return (t.per_environment >> parameter) & 1u;
}

/// A number that is the table's for all environments, or a row of a declared field.
template <class T>
struct Field {
  const ScalarOf<T>* table;
  const ScalarOf<T>* lanes;  // null: the table's
  std::ptrdiff_t stride;
  LOCKSTEP_INLINE T at(int table_index, int row) const {
    return lanes ? T::load(lanes + row * stride) : T(table[table_index]);
  }
};

/// Pointers of this tile's first environment.
template <class T>
LOCKSTEP_INLINE Field<T> field(const Lanes<ScalarOf<T>>& lanes, int parameter, const ScalarOf<T>* table) {
  return {table, lanes.field[parameter], lanes.stride};
}

}  // namespace lockstep::kernels
