// The tile's arrays, one by one, in their order in memory. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tile.h"

namespace lockstep::kernels {

/// How long what stands in an array is of use.
enum class Lasts {
  stage,  ///< only within a stage, or until the next one has read it
  step,   ///< other stages of the step may read it
  call,   ///< made before the first step of a call, and the same in all of them
  state,  ///< the next step starts from it
};

/// Names the arrays of bounded rows to `take`, as arrays() does.
template <class T, class Take>
inline void bound_arrays(const Tables<ScalarOf<T>>& t, Tile<T>& x, Take& take) {
  const Bounds<ScalarOf<T>>& b = t.bounds;
  const int bounds = b.form.count, solver = t.solver.n, rows = t.rows.count;
  take("member_share", x.member_share, b.member.count, Lasts::call);
  take("member_inverse", x.member_inverse, b.member.count, Lasts::call);
  take("bound_value", x.bound_value, b.form.term_value.count, Lasts::call);
  take("bound_lo", x.bound_lo, 2 * bounds);
  take("bound_hi", x.bound_hi, 2 * bounds);
  take("bound_centre", x.bound_centre, 2 * bounds);
  take("bound_free", x.bound_free, 2 * bounds);
  take("bound_impulse", x.bound_impulse, 2 * bounds);
  take("bound_eased", x.bound_eased, t.bounds.may_depend ? bounds : 0);
  take("bound_pushed", x.bound_pushed, t.bounds.may_depend ? bounds : 0);
  take("bound_slowest", x.bound_slowest, t.bounds.may_depend ? bounds : 0);
  take("bound_force", x.bound_force, bounds);
  take("bound_cfm", x.bound_cfm, bounds);
  take("bound_own", x.bound_own, bounds);
  take("bound_now", x.bound_now, bounds);
  take("bound_gain", x.bound_gain, bounds);
  take("bound_moved", x.bound_moved, bounds);
  take("search_inverse", x.search_inverse, bounds);
  take("search_impulse", x.search_impulse, bounds);
  take("search_speed", x.search_speed, bounds);
  take("search_noise", x.search_noise, bounds);
  take("bound_response", x.bound_response, bounds * solver);
  take("bound_scaled", x.bound_scaled, bounds * solver);
  take("bound_through", x.bound_through, bounds * rows);
  take("bound_through_scaled", x.bound_through_scaled, bounds * rows);
  take("bound_coupled", x.bound_coupled, bounds * bounds);
  const int phases = t.solve_twice ? 2 : 1;
  const int outcomes = phases * (2 * rows + solver) + t.joints + (t.record_diagnostics ? 2 : 1) * t.velocities;
  take("alone", x.alone, outcomes + (t.floating ? 7 + 4 : 0));
  take("search_matrix", x.search_matrix, bounds * bounds);
  take("search_branch", x.search_branch, 2 * bounds);
  take("search_held", x.search_held, bounds);
  take("bound_known", x.bound_known, 2 * bounds);
  take("bound_touched", x.bound_touched, bounds);
  take("bound_fresh", x.bound_fresh, bounds);
  take("bound_listed", x.bound_listed, bounds);
}

template <class T, class Take>
inline void motion_arrays(const Tables<ScalarOf<T>>& t, Motion<T>& motion, Take& take) {
  take("motion.world", motion.world, t.bodies);
  take("motion.place", motion.place, t.bodies);
  take("motion.angular", motion.angular, t.bodies);
  take("motion.linear", motion.linear, t.bodies);
}

/// Names the arrays of integrators with more than one stage to `take`, as arrays() does.
template <class T, class Take>
inline void stage_arrays(const Tables<ScalarOf<T>>& t, Tile<T>& x, Take& take) {
  const int joints = t.joints, velocities = t.velocities, pose = t.floating ? 7 : 0;
  const bool explicitly = t.integrator == integrator_runge_kutta, twice = t.integrator == integrator_extrapolated;
  take("begin_q", x.begin_q, joints);
  take("begin_v", x.begin_v, velocities);
  take("begin_pose", x.begin_pose, pose);
  take("midpoint_q", x.midpoint_q, explicitly ? 0 : joints);
  take("midpoint_v", x.midpoint_v, explicitly ? 0 : velocities);
  take("stage_v", x.stage_v, explicitly ? 0 : leapfrog_stages * velocities);
  take("stage_change", x.stage_change, explicitly ? velocities : leapfrog_stages * velocities);
  take("mean_v", x.mean_v, explicitly ? 0 : velocities);
  take("gained_v", x.gained_v, explicitly ? 0 : velocities);
  take("stage_pose", x.stage_pose, explicitly ? pose : 0);
  take("pose_rate", x.pose_rate, explicitly ? pose : 0);
  take("first_q", x.first_q, twice ? joints : 0);
  take("first_v", x.first_v, twice ? velocities : 0);
  take("first_pose", x.first_pose, twice ? pose : 0);
  take("change_q", x.change_q, explicitly || twice ? joints : 0);
  take("change_v", x.change_v, explicitly || twice ? velocities : 0);
  take("change_pose", x.change_pose, explicitly || twice ? pose : 0);
}

/// Names the arrays of articulated bodies to `take`, as arrays() does.
template <class T, class Take>
inline void articulated_arrays(const Tables<ScalarOf<T>>& t, Tile<T>& x, Take& take) {
  const bool goes_on = t.integrator > integrator_euler;
  take("factored_q", x.factored_q, goes_on ? t.joints : 0);
  if (!goes_on) x.factored_q = x.q;
  take("hinge_force", x.hinge_force, t.bodies);
  take("hinge_moment", x.hinge_moment, t.bodies);
  take("wrench_force", x.wrench_force, t.articulated.slots, Lasts::stage);
  take("wrench_moment", x.wrench_moment, t.articulated.slots, Lasts::stage);
  const int vectors = t.solve_twice ? 2 : 1;
  take("reached_angular", x.reached_angular, vectors * t.bodies, Lasts::stage);
  take("reached_linear", x.reached_linear, vectors * t.bodies, Lasts::stage);
}

/// Names every array of the tile to `take`, in their order in memory: take(name, pointer, count, Lasts). A copy of it
/// lays out other arrays in the same room, and take.behind(copy) goes on behind both.
template <class T, class Take>
inline void arrays(const Tables<ScalarOf<T>>& t, Tile<T>& x, Take& take) {
  const int joints = t.joints, velocities = t.velocities, solver = t.solver.n, rows = t.rows.count;
  const Reduction<ScalarOf<T>>& r = t.reduction;
  const bool gears = declared<T>(t, 0), masses = declared<T>(t, 5), wrenches = declared<T>(t, 7);
  take("q", x.q, joints, Lasts::state);
  take("v", x.v, velocities, Lasts::state);
  take("root_pose", x.root_pose, t.floating ? 7 : 0, Lasts::state);
  take("next_q", x.next_q, joints);
  take("next_v", x.next_v, velocities);
  take("next_root_pose", x.next_root_pose, t.floating ? 7 : 0);
  take("half_turn", x.half_turn, t.floating ? 4 : 0);
  const bool stages = t.integrator > integrator_euler;
  if (stages) stage_arrays(t, x, take);
  take("sine", x.sine, t.bodies);
  take("cosine", x.cosine, t.bodies);
  take("inertia", x.inertia, masses ? t.bodies : 0, Lasts::call);
  take("felt", x.felt, t.bodies, Lasts::call);
  // Bias forces are done with theirs when the mass matrix begins: they share the room, for the cache's sake.
  Take shared = take;
  take("angular", x.angular, t.bodies, Lasts::stage);
  take("alpha", x.alpha, t.bodies, Lasts::stage);
  take("linear", x.linear, t.bodies, Lasts::stage);
  take("force", x.force, t.bodies, Lasts::stage);
  take("moment", x.moment, t.bodies, Lasts::stage);
  take("world", x.world, wrenches ? t.bodies : 0, Lasts::stage);
  const bool merged = r.merged.slots > 0, articulated = t.articulated.used(), natural = t.natural.count > 0;
  const bool composites = !articulated || natural;
  shared("articulated", x.articulated, t.articulated.slots, Lasts::stage);
  shared("composite", x.composite, composites ? t.bodies : 0, Lasts::stage);
  const int columns = merged ? r.merged.slots : composites ? t.bodies : 0;
  shared("column_force", x.column_force, columns, Lasts::stage);
  shared("column_moment", x.column_moment, columns, Lasts::stage);
  take.behind(shared);
  take("joint_inertia", x.joint_inertia, joints);
  take("matrix", x.matrix, merged ? 0 : composites ? t.matrix.entries : t.articulated.root.entries);
  take("drive", x.drive, velocities);
  take("bias", x.bias, stages ? velocities : 0);
  if (!stages) x.bias = x.drive;
  take("reduced", x.reduced, r.followers ? t.solver.entries + (merged && t.solve_twice ? solver : 0) : 0);
  if (r.followers == 0) x.reduced = x.matrix;
  take("inverse", x.inverse, solver);
  if (articulated) articulated_arrays(t, x, take);
  take("free_position", x.free_position, solver);
  const bool free_twice = r.eliminates() && t.solve_twice;
  take("free_velocity", x.free_velocity, free_twice ? solver : 0);
  if (!free_twice) x.free_velocity = x.free_position;
  x.free_velocity_apart = x.free_velocity;
  take("start", x.start, solver);
  take("solution", x.solution, solver);
  take("closing_solution", x.closing_solution, t.solve_twice ? solver : 0);
  const int vectors = rows > 0 ? RowBlock::most_rows * velocities : velocities;
  take("scratch", x.scratch, vectors > rows ? vectors : rows, Lasts::stage);
  take("product", x.product, velocities, Lasts::stage);
  take("corrected_product", x.corrected_product, velocities, Lasts::stage);
  take("coefficient", x.coefficient, t.term_value.count, Lasts::call);
  take("offset", x.offset, t.couplings, Lasts::call);
  take("share", x.share, r.value.count, Lasts::call);
  take("inverse_form", x.inverse_form, r.inverse_value.count, Lasts::call);
  take("row_value", x.row_value, t.rows.term_value.count, Lasts::call);
  take("form", x.form, gears ? r.entries : 0, Lasts::call);
  const int eliminated = r.eliminates() ? r.followers : 0;
  take("correction", x.correction, eliminated);
  take("mismatch", x.mismatch, eliminated);
  take("lost", x.lost, r.by_force ? eliminated : 0);
  take("acceleration", x.acceleration, r.by_force ? eliminated : 0);
  take("factor", x.factor, r.merged.factors.count, Lasts::call);
  take("response", x.response, rows * solver);
  take("coupled", x.coupled, t.rows.response_entries);
  take("row_error", x.row_error, rows);
  take("row_rate", x.row_rate, rows);
  take("row_cfm", x.row_cfm, rows);
  take("row_bias", x.row_bias, rows);
  take("row_start", x.row_start, rows);
  take("row_speed", x.row_speed, rows);
  take("row_residual", x.row_residual, t.rows.columns.n > 0 ? 0 : rows, Lasts::stage);
  take("row_speed_closed", x.row_speed_closed, rows);
  take("row_inverse", x.row_inverse, rows);
  take("row_impulse", x.row_impulse, rows);
  take("position_impulse", x.position_impulse, rows);
  take("velocity_impulse", x.velocity_impulse, rows);
  take("coupling_error", x.coupling_error, t.couplings);
  take("impulse", x.impulse, t.record_impulses ? t.couplings : 0, Lasts::state);
  take("natural_matrix", x.natural_matrix, natural ? t.matrix.entries : 0, Lasts::stage);
  take("natural_inverse", x.natural_inverse, natural ? velocities : 0, Lasts::stage);
  take("natural_response", x.natural_response, natural ? velocities : 0, Lasts::stage);
  take("natural_compliance", x.natural_compliance, t.natural.count);
  if (t.bounds.form.count > 0) bound_arrays(t, x, take);
  take("saturation", x.saturation, t.limited.count);
  if (!t.record_diagnostics) return;
  motion_arrays(t, x.motion, take);
  take("moved_velocity", x.moved_velocity, velocities);
  take("other_v", x.other_v, velocities);
  take("other_q", x.other_q, joints);
  take("other_root_pose", x.other_root_pose, t.floating ? 7 : 0);
  take("residual", x.residual, t.reported.count, Lasts::state);
  take("row_state", x.row_state, t.reported.count, Lasts::state);
  take("energy", x.energy, 4, Lasts::state);
  take("energy_change", x.energy_change, 4);
}

/// What a step does with followers that are all in place, or not: (M76). Their two motions are one.
template <class T>
LOCKSTEP_INLINE void settle(const Tables<ScalarOf<T>>& t, Tile<T>& x, bool in_place) {
  const bool one_motion = in_place && t.rows.count == 0 && t.bounds.form.count == 0;
  x.in_place = in_place;
  x.solves_twice = t.solve_twice && !one_motion;
}

/// Hands out consecutive pieces of the scratch block; with a null block it only measures.
class Carver {
 public:
  explicit Carver(void* block) : base_(static_cast<char*>(block)) {}
  template <class E>
  void operator()(const char*, E*& array, int count, Lasts = Lasts::step) {
    array = reinterpret_cast<E*>(base_ + used_);
    used_ += sizeof(E) * static_cast<std::size_t>(count);
  }
  /// Indices, in whole lines of the cache so that what follows stays aligned.
  void operator()(const char*, int*& array, int count, Lasts = Lasts::step) {
    array = reinterpret_cast<int*>(base_ + used_);
    used_ += sizeof(int) * static_cast<std::size_t>((count + 15) / 16 * 16);
  }
  /// What comes next stands behind what `other`, a copy of this, has laid out in the same room.
  void behind(const Carver& other) {
    if (used_ < other.used_) used_ = other.used_;
  }
  std::size_t used() const { return used_; }

 private:
  char* base_;
  std::size_t used_ = 0;
};

/// Lays the tile out in `block`; returns its size in bytes.
template <class T>
inline std::size_t lay_out(const Tables<ScalarOf<T>>& t, void* block, Tile<T>& x) {
  Carver carver(block);
  arrays(t, x, carver);
  x.bound_count = 0;
  x.corrects = true;
  settle(t, x, false);
  return carver.used();
}

/// The tile and room for a Motion beside it.
template <class T>
inline std::size_t lay_out(const Tables<ScalarOf<T>>& t, void* block, Tile<T>& x, Motion<T>& motion) {
  const std::size_t used = lay_out(t, block, x);
  Carver carver(static_cast<char*>(block) + used);
  motion_arrays(t, motion, carver);
  return used + carver.used();
}

}  // namespace lockstep::kernels
