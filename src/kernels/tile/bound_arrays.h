// Arrays of the bounds: their rows, the search for the active set, limited servos. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "state.h"

namespace lockstep::kernels {

/// The part of (M54) that a bounded row is on: it holds the low or the high end of its interval, or it sticks at the
/// centre of its box. If none of these, its impulse is known.
template <class T>
struct Branch {
  typename T::Mask low, high, stuck;
  T impulse;
};

/// By bounded row. Arrays marked 2 have the rows of the position phase, then those of the velocity phase.
template <class T>
struct BoundRows {
  T* member_share;  // [members] s of (M59)
  T* member_inverse;
  T* value;            // [terms]
  T* lo;               // 2 [rows]
  T* hi;               // 2 [rows]
  T* centre;           // 2 [rows]
  T* unbounded_speed;  // 2 [rows] without impulses of bounded rows
  T* impulse;          // 2 [rows]
  T* relaxed_target;   // [rows] what a kinematic drive that gave way asks for (M60)
  T* correction;       // [rows] mean w / s of its drives (M60)
  T* slowest;          // [rows] k_0 of (M60): the velocity nearest to zero within its limits
  T* force;
  T* cfm;
  T* own_response;     // r without the couplings
  T* speed;            // in a sweep
  T* gain;             // of speed by the free motion, in a sub-step
  T* moved;            // displacement in earlier sub-steps
  T* response;         // [rows][solver]
  T* scaled_response;  // [rows][solver]
  T* cross_response;   // [rows][coupling rows] K_BE, half solved where these are solved
  T* scaled_cross_response;
  T* delassus;                 // [rows][rows] of (M61)
  T* unbounded_result;         // of the step, the couplings' impulses first (solve_bounds.h)
  typename T::Mask* active;    // lanes in which the row is active
  int* newly_active;           // 1: it has become active in some lane and is not listed yet
  int* active_rows;            // rows that are active in some lane, ascending
  int active_count;            // their number
  typename T::Mask candidate;  // lanes in which bounds may be active at all
  typename T::Mask invalid;    // lanes in which a row asks for NaN or infinity

  template <class Take>
  void arrays(const Tables<ScalarOf<T>>& t, Take& take) {
    const auto& b = t.bounds;
    const int bounds = b.rows.count, rows = t.rows.count;
    const int responding = t.rounds.used() ? 0 : bounds, solver = t.solver.n;
    take("bounds.member_share", member_share, b.member.count, Lifetime::call);
    take("bounds.member_inverse", member_inverse, b.member.count, Lifetime::call);
    take("bounds.value", value, b.rows.term_value.count, Lifetime::call);
    take("bounds.lo", lo, 2 * bounds);
    take("bounds.hi", hi, 2 * bounds);
    take("bounds.centre", centre, 2 * bounds);
    take("bounds.unbounded_speed", unbounded_speed, 2 * bounds);
    take("bounds.impulse", impulse, 2 * bounds);
    take("bounds.relaxed_target", relaxed_target, b.may_depend ? bounds : 0);
    take("bounds.correction", correction, b.may_depend ? bounds : 0);
    take("bounds.slowest", slowest, b.may_depend ? bounds : 0);
    take("bounds.force", force, bounds);
    take("bounds.cfm", cfm, bounds);
    take("bounds.own_response", own_response, bounds);
    take("bounds.speed", speed, bounds);
    take("bounds.gain", gain, bounds);
    take("bounds.moved", moved, bounds);
    take("bounds.response", response, responding * solver);
    take("bounds.scaled_response", scaled_response, responding * solver);
    take("bounds.cross_response", cross_response, bounds * rows);
    take("bounds.scaled_cross_response", scaled_cross_response, bounds * rows);
    take("bounds.delassus", delassus, responding * responding);
    const int results =
        (t.solve_twice ? 2 : 1) * (2 * rows + solver) + t.joints + (t.record_diagnostics ? 2 : 1) * t.velocities;
    take("bounds.unbounded_result", unbounded_result, results + (7 + 4) * t.roots.count);
    take("bounds.active", active, bounds);
    take("bounds.newly_active", newly_active, bounds);
    take("bounds.active_rows", active_rows, bounds);
  }
};

/// The search for the active set. By active row, except `branch` and `known`, which are by bounded row.
template <class T>
struct ActiveSetSearch {
  T* inverse;
  T* impulse;  // by bounded row in sweeps
  T* speed;
  T* noise;                       // rounding of the pivots
  T* matrix;                      // [rows][rows]
  Branch<T>* branch;              // 2 [rows]
  typename T::Mask* held;         // [rows]
  typename T::Mask* known;        // 2 [rows] lanes whose search begins with this branch
  T retries[2];                   // by phase: how often a lane has searched again without compliance
  typename T::Mask compliant[2];  // by phase: lanes whose rows depend on each other and have compliance
  typename T::Mask open;          // lanes that are still searching
  typename T::Mask going_on;      // and lanes that begin where the search before has ended

  template <class Take>
  void arrays(const Tables<ScalarOf<T>>& t, Take& take) {
    const int bounds = t.bounds.rows.count;
    take("search.inverse", inverse, bounds);
    take("search.impulse", impulse, bounds);
    take("search.speed", speed, bounds);
    take("search.noise", noise, bounds);
    take("search.matrix", matrix, t.rounds.used() ? 0 : bounds * bounds);
    take("search.branch", branch, 2 * bounds);
    take("search.held", held, bounds);
    take("search.known", known, 2 * bounds);
  }
};

/// Velocities that are held in the factor of A (held_velocities.h). Arrays marked 2 are by phase, as above.
template <class T>
struct HeldVelocities {
  T* matrix;               // A or A_r (packed)
  T* start;                // [solver] velocities at the start
  T* momentum;             // 2 [solver] to gain, without impulses
  T* factor;               // of a round (packed)
  T* diagonal;             // [solver] with the servos' parts
  T* pivot;                // [solver]
  T* inverse;              // [solver] 1 / pivot, 0 for held velocities
  T* raw;                  // [solver]
  T* rhs;                  // [solver]
  T* goal;                 // 2 [solver]
  T* velocity;             // 2 [solver]
  T* impulse;              // 2 [solver] that hold velocities
  T* light;                // [rows] 1 / A_kk
  typename T::Mask* mask;  // [solver]

  template <class Take>
  void arrays(const Tables<ScalarOf<T>>& t, Take& take) {
    const int n = t.rounds.columns.n, entries = t.rounds.columns.entries, phases = t.solve_twice ? 2 : 1;
    take("held.matrix", matrix, entries);
    take("held.start", start, t.rounds.renumbered ? n : 0);
    take("held.momentum", momentum, phases * n);
    take("held.factor", factor, entries);
    take("held.diagonal", diagonal, n);
    take("held.pivot", pivot, n);
    take("held.inverse", inverse, n);
    take("held.raw", raw, n);
    take("held.rhs", rhs, n);
    take("held.goal", goal, phases * n);
    take("held.velocity", velocity, phases * n);
    take("held.impulse", impulse, phases * n);
    take("held.light", light, t.bounds.single);
    take("held.mask", mask, n);
  }
};

/// The law of a row over several velocities (section 12) at one speed: its branch and impulse. `active`: its slope is
/// not 0.
template <class T>
struct ActingRow {
  T lo, hi, centre, force, cfm;  // of the phase
  T response;                    // (M118)
  T own_response;                // J A^-1 J^T, where the softness refers to it
  T added;                       // R - cfm: compliance that updates take back
  T multiplier;                  // m
  T speed, change;               // u, and what the Newton step adds
  T rounding;                    // speeds below which nothing counts, without those of the iterate
  T missing;                     // what the law misses, as a share of what is allowed
  Branch<T> law, trial;
  typename T::Mask yields;  // lanes in which it has given way
};

/// Newton rounds (rounds/newton.h).
template <class T>
struct RoundArrays {
  T* z;     // [velocities of the rounds] iterate
  T* step;  // Newton step
  T* gradient;
  T* momentum;            // J^T impulse
  T* kept;                // momentum to gain
  T* ended;               // velocities of a solve that may gain energy
  ActingRow<T>* row;      // [slots]
  T* single_impulse;      // [bounds of one velocity] of the last round in which the lane was open
  T* answer;              // [(rows of contacts + single bounds + slots) velocities] to a unit impulse, in sweeps
  T* unbounded_result;    // of the step in which none of them acts (integrators/solve_rounds.h)
  typename T::Mask open;  // lanes that have not finished
  typename T::Mask weak;  // lanes with a pivot that is too small
  T largest, fastest;     // of the step and of the velocities at its end
  T slope;                // of the line function where the step begins

  template <class Take>
  void arrays(const Tables<ScalarOf<T>>& t, Take& take) {
    const int n = t.rounds.columns.n;
    take("rounds.z", z, n);
    take("rounds.step", step, n);
    take("rounds.gradient", gradient, n);
    take("rounds.momentum", momentum, n);
    take("rounds.kept", kept, n);
    take("rounds.ended", ended, n);
    take("rounds.row", row, t.rounds.slots.count);
    take("rounds.single_impulse", single_impulse, t.bounds.single);
    const int contact_rows = 3 * (t.contacts.slots + t.contacts.turning_frictions);
    const int answers = t.method == Method::pgs ? contact_rows + t.bounds.single + t.rounds.slots.count : 0;
    take("rounds.answer", answer, answers * n);
    const int results = (t.solve_twice ? 2 : 1) * (2 * t.rows.count + t.solver.n) + t.joints +
                        (t.record_diagnostics ? 2 : 1) * t.velocities + (7 + 4) * t.roots.count;
    take("rounds.unbounded_result", unbounded_result, results);
  }
};

/// A solve at a leapfrog's midpoint (integrators/midpoint.h).
template <class T>
struct MidpointArrays {
  typename T::Mask* halved;    // [joints] lanes in which kappa of (M121) is 1/2
  T* diagonal;                 // [velocities of the rounds] of the matrix of the stages
  T* implicit;                 // [velocities of the rounds] what linear terms add to that
  T* way;                      // [velocities of the rounds] to the next midpoint over the step, without contacts
  T *rate, *cfm;               // [coupling rows] of a solve over the whole step
  T* first_bias;               // [velocities] at the start's velocity
  T* bias;                     // [velocities] of the stages' prediction
  T* before;                   // [velocities] bias forces of lanes that are not predicted
  T* change;                   // [velocities] of the stages' prediction
  T* end;                      // [velocities of the rounds] from the midpoint to the step's end over the step
  typename T::Mask acts;       // lanes whose step is made at the midpoint
  typename T::Mask predicted;  // lanes whose bias forces are not those of that prediction

  template <class Take>
  void arrays(const Tables<ScalarOf<T>>& t, Take& take) {
    const int n = t.rounds.columns.n;
    take("midpoint.halved", halved, t.joints);
    take("midpoint.diagonal", diagonal, n);
    take("midpoint.implicit", implicit, n);
    take("midpoint.way", way, n);
    take("midpoint.rate", rate, t.rows.count);
    take("midpoint.cfm", cfm, t.rows.count);
    take("midpoint.first_bias", first_bias, t.velocities);
    take("midpoint.bias", bias, t.velocities);
    take("midpoint.before", before, t.velocities);
    take("midpoint.change", change, t.velocities);
    take("midpoint.end", end, n);
  }
};

/// Servos with an effort limit. The search of held_velocities.h sees a force that acts for a time from given positions.
template <class T>
struct LimitedServos {
  T* saturation;              // [limited servos] -1 or 1 at an end of the limit, else 0
  typename T::Mask* bounded;  // [limited servos] lanes in which a stage leaves the servo to the search
  const T* from;              // [joints] positions
  T duration;
  typename T::Mask decided;  // lanes in which the other phase has decided
  bool corrected;            // the position phase corrects followers
  int time;                  // of its inputs
  int pass;                  // of the guess (limited_servos.h)

  template <class Take>
  void arrays(const Tables<ScalarOf<T>>& t, Take& take) {
    take("servos.saturation", saturation, t.limited_servos.count);
    take("servos.bounded", bounded, t.integrator == Integrator::euler ? 0 : t.limited_servos.count);
  }
};

/// One end of a range in the stages of a step, seen so that the row moves towards it with a negative speed.
template <class T>
struct RangeEnd {
  T gap;          // displacement to the end, positive beyond it
  T rate;         // at which an error is corrected
  T restitution;  // of the joint that reaches its end first
  T time;         // share of the step after which the row has arrived; beyond 1 if it has not
  T arrival;      // its speed then
  T gained;       // the speed that it would gain in a step, if it arrives within this one
};

/// A bounded row in the stages of a step (stage_bounds.h).
template <class T>
struct StageRow {
  RangeEnd<T> low, high;
  T most;           // velocity limit
  T prescribed;     // by kinematic drives
  T force;          // impulse of friction in a whole step
  T direction;      // -1 or 1 if it slips at the start, else 0
  T reversal;       // share of the step after which it slips no longer that way
  T inertia_share;  // of the diagonal of the matrix
};

/// By velocity of the rounds, but for `row`.
template <class T>
struct StageBounds {
  StageRow<T>* row;  // [rows]
  // All lanes or none, as control is data (control.h):
  typename T::Mask opened;    // bounds have acted in this step
  typename T::Mask factored;  // and the matrix of the step has been factored with velocities held
  typename T::Mask searched;  // lanes in which they have acted
  T* start;                   // velocity at the start of the step
  T* end;                     // velocity at its end
  T* mean;                    // velocity that moves the positions
  T* correction;              // momentum that corrects followers' positions
  T* impulse;                 // [stages] of each stage alone

  template <class Take>
  void arrays(const Tables<ScalarOf<T>>& t, Take& take) {
    const int n = t.solver.n;
    take("stage_bounds.row", row, t.bounds.rows.count);
    take("stage_bounds.start", start, n);
    take("stage_bounds.end", end, n);
    take("stage_bounds.mean", mean, n);
    take("stage_bounds.correction", correction, n);
    take("stage_bounds.impulse", impulse, leapfrog_stages * n);
  }
};

}  // namespace lockstep::kernels
