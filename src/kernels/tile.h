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
  // kinematics and bias forces, by body
  T* sine;
  T* cosine;
  Vec3<T>* angular;        // angular velocity
  Vec3<T>* alpha;          // angular acceleration
  Mat3<T>* tensor;         // angular acceleration tensor
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
  T* matrix;               // A (packed)
  T* drive;                // [velocities] dt times the forces: dt (tau - c - ...)
  T* reduced;              // A_r (packed): only where followers are eliminated
  T* inverse;              // [solver] 1 / D
  T* free_position;        // [solver] D^-1 L^-T of the drive, for positions
  T* free_velocity;        // and for velocities: the same array unless they differ
  T* start;                // [solver] the velocities that a step starts from
  T* solution;             // [solver] the velocities that move positions
  T* closing_solution;     // [solver] those that stay: only if they differ
  T* scratch;              // as long as the longest vector, for one stage at a time
  T* product;              // [velocities] momentum to gain, S^T still to come
  T* corrected_product;    // the same less that of the correction
  // what gear ratios make, the same for all environments or this tile's own
  T* coefficient;          // [coupling terms]
  T* share;                // entries of S
  T* inverse_form;         // entries of J_F^-1
  T* row_value;            // [row terms]
  T* form;                 // room for the lanes' own elimination
  T* correction;           // [joints] velocity that corrects followers' errors
  T* mismatch;             // [joints] what followers' velocities are off by
  // rows
  T* response;             // [rows][solver] X = L^-T J^T
  T* scaled;               // [rows][solver] D^-1 X
  T* coupled;              // K
  T* row_error;            // C
  T* row_rate;             // bias = rate C
  T* row_cfm;
  T* row_bias;
  T* row_start;            // J v at the start of the step
  T* row_speed;            // J v as the sweeps see it
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
  T* member_share;         // [members] s of (M54)
  T* member_inverse;
  T* bound_value;          // [terms]
  T* bound_lo;             // 2 [rows]
  T* bound_hi;             // 2 [rows]
  T* bound_centre;         // 2 [rows]
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
  T* bound_coupled;        // [rows][rows] of (M55)
  T* row_alone;            // 2 [coupling rows] impulses without bounded rows
  T* search_matrix;
  T* search_inverse;
  T* search_impulse;
  T* search_speed;
  Branch<T>* search_branch;         // 2 [rows]
  typename T::Mask* search_held;    // [rows]
  typename T::Mask* bound_known;    // 2 [rows] lanes that have a branch to begin with
  typename T::Mask* bound_touched;  // lanes in which the row takes part
  typename T::Mask suspect;         // lanes in which bounds may act at all
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
};

/// Hands out consecutive pieces of the scratch block; with a null block it only measures.
class Carver {
 public:
  explicit Carver(void* block) : base_(static_cast<char*>(block)) {}
  template <class E>
  E* take(int count) {
    E* piece = reinterpret_cast<E*>(base_ + used_);
    used_ += sizeof(E) * static_cast<std::size_t>(count);
    return piece;
  }
  /// Indices, in whole lines of the cache so that what follows stays aligned.
  int* take_indices(int count) { return take<int>((count + 15) / 16 * 16); }
  std::size_t used() const { return used_; }

 private:
  char* base_;
  std::size_t used_ = 0;
};

template <class T>
LOCKSTEP_INLINE bool declared(const Tables<ScalarOf<T>>& t, int parameter) {
  return (t.per_environment >> parameter) & 1u;
}

template <class T>
inline void lay_out_bounds(const Tables<ScalarOf<T>>& t, Carver& c, Tile<T>& x) {
  const Bounds<ScalarOf<T>>& b = t.bounds;
  const int bounds = b.form.count, solver = t.solver.n, rows = t.rows.count;
  x.member_share = c.take<T>(b.member.count);
  x.member_inverse = c.take<T>(b.member.count);
  x.bound_value = c.take<T>(b.form.term_value.count);
  T** const twice[] = {&x.bound_lo, &x.bound_hi, &x.bound_centre, &x.bound_free, &x.bound_impulse};
  T** const once[] = {&x.bound_force, &x.bound_cfm, &x.bound_own, &x.bound_now, &x.bound_gain,
                      &x.bound_moved, &x.search_inverse, &x.search_impulse, &x.search_speed};
  for (T** array : twice) *array = c.take<T>(2 * bounds);
  for (T** array : once) *array = c.take<T>(bounds);
  x.bound_response = c.take<T>(bounds * solver);
  x.bound_scaled = c.take<T>(bounds * solver);
  x.bound_through = c.take<T>(bounds * rows);
  x.bound_through_scaled = c.take<T>(bounds * rows);
  x.bound_coupled = c.take<T>(bounds * bounds);
  x.row_alone = c.take<T>(2 * rows);
  x.search_matrix = c.take<T>(bounds * bounds);
  x.search_branch = c.take<Branch<T>>(2 * bounds);
  x.search_held = c.take<typename T::Mask>(bounds);
  x.bound_known = c.take<typename T::Mask>(2 * bounds);
  x.bound_touched = c.take<typename T::Mask>(bounds);
  x.bound_fresh = c.take_indices(bounds);
  x.bound_listed = c.take_indices(bounds);
}

template <class T>
inline void lay_out_motion(const Tables<ScalarOf<T>>& t, Carver& c, Motion<T>& motion) {
  motion.world = c.take<Mat3<T>>(t.bodies);
  motion.place = c.take<Vec3<T>>(t.bodies);
  motion.angular = c.take<Vec3<T>>(t.bodies);
  motion.linear = c.take<Vec3<T>>(t.bodies);
}

template <class T>
inline void lay_out_diagnostics(const Tables<ScalarOf<T>>& t, Carver& c, Tile<T>& x) {
  lay_out_motion(t, c, x.motion);
  x.moved_velocity = c.take<T>(t.velocities);
  x.other_v = c.take<T>(t.velocities);
  x.other_q = c.take<T>(t.joints);
  x.other_root_pose = c.take<T>(7);
  x.residual = c.take<T>(t.reported.count);
  x.row_state = c.take<T>(t.reported.count);
  x.energy = c.take<T>(4);
  x.energy_change = c.take<T>(4);
}

/// Lays the tile out in `block`; returns its size in bytes.
template <class T>
inline std::size_t lay_out(const Tables<ScalarOf<T>>& t, void* block, Tile<T>& x) {
  Carver c(block);
  const int joints = t.joints, velocities = t.velocities, solver = t.solver.n, rows = t.rows.count;
  const Reduction<ScalarOf<T>>& r = t.reduction;
  const bool gears = declared<T>(t, 0), masses = declared<T>(t, 5), wrenches = declared<T>(t, 7);
  x.q = c.take<T>(joints);
  x.v = c.take<T>(velocities);
  x.root_pose = c.take<T>(7);
  x.next_q = c.take<T>(joints);
  x.next_v = c.take<T>(velocities);
  x.next_root_pose = c.take<T>(7);
  x.half_turn = c.take<T>(4);
  x.sine = c.take<T>(t.bodies);
  x.cosine = c.take<T>(t.bodies);
  x.inertia = c.take<PseudoInertia<T>>(masses ? t.bodies : 0);
  x.felt = c.take<PseudoInertia<T>>(t.bodies);
  // Bias forces are done with theirs when the mass matrix begins: they share the room, for the cache's sake.
  Carver shared = c;
  x.angular = c.take<Vec3<T>>(t.bodies);
  x.alpha = c.take<Vec3<T>>(t.bodies);
  x.tensor = c.take<Mat3<T>>(t.bodies);
  x.linear = c.take<Vec3<T>>(t.bodies);
  x.force = c.take<Vec3<T>>(t.bodies);
  x.moment = c.take<Vec3<T>>(t.bodies);
  x.world = c.take<Mat3<T>>(wrenches ? t.bodies : 0);
  x.composite = shared.take<PseudoInertia<T>>(t.bodies);
  x.column_force = shared.take<Vec3<T>>(t.bodies);
  x.column_moment = shared.take<Vec3<T>>(t.bodies);
  x.matrix = c.take<T>(t.matrix.entries);
  x.drive = c.take<T>(velocities);
  x.reduced = r.followers ? c.take<T>(t.solver.entries) : x.matrix;
  x.inverse = c.take<T>(solver);
  x.free_position = c.take<T>(solver);
  x.free_velocity = r.followers && t.solve_twice ? c.take<T>(solver) : x.free_position;
  x.start = c.take<T>(solver);
  x.solution = c.take<T>(solver);
  x.closing_solution = c.take<T>(t.solve_twice ? solver : 0);
  x.scratch = c.take<T>(velocities > rows ? velocities : rows);
  x.product = c.take<T>(velocities);
  x.corrected_product = c.take<T>(velocities);
  x.coefficient = c.take<T>(t.term_value.count);
  x.share = c.take<T>(r.value.count);
  x.inverse_form = c.take<T>(r.inverse_value.count);
  x.row_value = c.take<T>(t.rows.term_value.count);
  x.form = c.take<T>(gears ? r.entries : 0);
  x.correction = c.take<T>(r.followers);
  x.mismatch = c.take<T>(r.followers);
  x.response = c.take<T>(rows * solver);
  x.scaled = c.take<T>(rows * solver);
  x.coupled = c.take<T>(t.rows.response_entries);
  x.row_error = c.take<T>(rows);
  x.row_rate = c.take<T>(rows);
  x.row_cfm = c.take<T>(rows);
  x.row_bias = c.take<T>(rows);
  x.row_start = c.take<T>(rows);
  x.row_speed = c.take<T>(rows);
  x.row_speed_closed = c.take<T>(rows);
  x.row_inverse = c.take<T>(rows);
  x.row_impulse = c.take<T>(rows);
  x.position_impulse = c.take<T>(rows);
  x.velocity_impulse = c.take<T>(rows);
  x.coupling_error = c.take<T>(t.couplings);
  x.impulse = c.take<T>(t.record_impulses ? t.couplings : 0);
  const bool natural = t.natural.count > 0;
  x.natural_matrix = c.take<T>(natural ? t.matrix.entries : 0);
  x.natural_inverse = c.take<T>(natural ? velocities : 0);
  x.natural_response = c.take<T>(natural ? velocities : 0);
  x.natural_compliance = c.take<T>(t.natural.count);
  x.bound_count = 0;
  if (t.bounds.form.count > 0) lay_out_bounds(t, c, x);
  x.saturation = c.take<T>(t.limited.count);
  if (t.record_diagnostics) lay_out_diagnostics(t, c, x);
  return c.used();
}

/// The tile and room for a Motion beside it.
template <class T>
inline std::size_t lay_out(const Tables<ScalarOf<T>>& t, void* block, Tile<T>& x, Motion<T>& motion) {
  const std::size_t used = lay_out(t, block, x);
  Carver c(static_cast<char*>(block) + used);
  lay_out_motion(t, c, motion);
  return used + c.used();
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

/// The same lanes, moved to begin at environment `first`.
template <class S>
LOCKSTEP_INLINE Lanes<S> at(Lanes<S> lanes, std::ptrdiff_t first) {
  lanes.position += first;
  lanes.velocity += first;
  if (lanes.root_pose) lanes.root_pose += first, lanes.root_velocity += first;
  lanes.position_target += first;
  lanes.velocity_target += first;
  lanes.effort += first;
  for (const S*& f : lanes.field)
    if (f) f += first;
  if (lanes.impulse) lanes.impulse += first;
  if (lanes.residual) lanes.residual += first, lanes.row_state += first, lanes.energy += first;
  lanes.fault += first;
  return lanes;
}

}  // namespace lockstep::kernels
