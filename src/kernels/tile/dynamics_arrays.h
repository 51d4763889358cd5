// Arrays of the equations of motion: bodies, articulated bodies, matrices and right-hand sides.
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "state.h"

namespace lockstep::kernels {

using simd::Mat3;
using simd::PseudoInertia;
using simd::Vec3;

/// By body: kinematics, bias forces, composite inertia.
template <class T>
struct Bodies {
  T* sine;
  T* cosine;
  Mat3<T>* ball_turn;              // [balls] child to parent coordinates
  PseudoInertia<T>* inertia;       // per-environment masses
  PseudoInertia<T>* base_inertia;  // with the mass on joints' axes moved inwards (M10)
  Vec3<T>* angular;                // angular velocity
  Vec3<T>* alpha;                  // angular acceleration
  Vec3<T>* linear;                 // acceleration of the origin
  Vec3<T>* force;
  Vec3<T>* moment;
  Mat3<T>* orientation;  // in the world: only where forces act along its axes
  PseudoInertia<T>* composite;
  Vec3<T>* column_force;  // of the mass matrix, as they are passed inwards
  Vec3<T>* column_moment;
  Vec3<T>* composite_force;  // of composite columns, by place
  Vec3<T>* composite_moment;

  template <class Take>
  void kinematics(const Tables<ScalarOf<T>>& t, Take& take) {
    take("bodies.sine", sine, t.bodies);
    take("bodies.cosine", cosine, t.bodies);
    take("bodies.ball_turn", ball_turn, t.balls.count);
    take("bodies.inertia", inertia, t.has_own_inertias() ? t.bodies : 0, Lifetime::call);
    take("bodies.base_inertia", base_inertia, t.bodies, Lifetime::call);
  }
  template <class Take>
  void bias_forces(const Tables<ScalarOf<T>>& t, Take& take) {
    take("bodies.angular", angular, t.bodies, Lifetime::stage);
    take("bodies.alpha", alpha, t.bodies, Lifetime::stage);
    take("bodies.linear", linear, t.bodies, Lifetime::stage);
    take("bodies.force", force, t.bodies, Lifetime::stage);
    take("bodies.moment", moment, t.bodies, Lifetime::stage);
    take("bodies.orientation", orientation, t.has_orientations() ? t.bodies : 0, Lifetime::stage);
  }
  template <class Take>
  void composites(const Tables<ScalarOf<T>>& t, Take& take) {
    const int places = t.reduction.composite.places, columns = t.makes_matrix ? t.bodies : 0;
    take("bodies.composite", composite, columns + places > 0 ? t.bodies : 0, Lifetime::stage);
    take("bodies.column_force", column_force, columns, Lifetime::stage);
    take("bodies.column_moment", column_moment, columns, Lifetime::stage);
    take("bodies.composite_force", composite_force, places, Lifetime::stage);
    take("bodies.composite_moment", composite_moment, places, Lifetime::stage);
  }
};

/// Only for plans that factor A by articulated bodies. By place of a wrench, or by body.
template <class T>
struct ArticulatedBodies {
  simd::ArticulatedInertia<T>* inertia;  // [places]
  T* root_block;                         // by floating root: its own part of A (packed)
  T* factored_q;         // [joints] positions at which A was factored: Tile::state's unless these change
  Vec3<T>* hinge_force;  // [bodies] U D^-1
  Vec3<T>* hinge_moment;
  Vec3<T>* wrench_force;  // [places] passed inwards
  Vec3<T>* wrench_moment;
  Vec3<T>* reached_angular;  // [2][bodies] accelerations passed outwards
  Vec3<T>* reached_linear;

  template <class Take>
  void inertias(const Tables<ScalarOf<T>>& t, Take& take) {
    take("articulated.inertia", inertia, t.articulated.places, Lifetime::stage);
  }
  template <class Take>
  void factors(const Tables<ScalarOf<T>>& t, T* q, Take& take) {
    const bool positions_move = t.integrator != Integrator::euler;
    take("articulated.factored_q", factored_q, positions_move ? t.joints : 0);
    if (!positions_move) factored_q = q;
    take("articulated.root_block", root_block, t.roots.count * t.articulated.root.entries);
    take("articulated.hinge_force", hinge_force, t.bodies);
    take("articulated.hinge_moment", hinge_moment, t.bodies);
    take("articulated.wrench_force", wrench_force, t.articulated.places, Lifetime::stage);
    take("articulated.wrench_moment", wrench_moment, t.articulated.places, Lifetime::stage);
    const int vectors = t.solve_twice ? 2 : 1;
    take("articulated.reached_angular", reached_angular, vectors * t.bodies, Lifetime::stage);
    take("articulated.reached_linear", reached_linear, vectors * t.bodies, Lifetime::stage);
  }
};

/// A dv = rhs: the matrix, its factors, the solutions.
template <class T>
struct Dynamics {
  T* joint_inertia;         // [joints] the diagonal A - M (M14)
  T* matrix;                // A (packed), unless A_r is made without it or all bodies are articulated
  T* rhs;                   // [velocities] dt times all forces, and what removes followers' velocity errors by force
  T* bias;                  // [velocities] c; in the array of rhs unless it is used more than once
  T* reduced;               // A_r (packed), with composite columns S^T A w behind it
  T* inverse;               // [solver] 1 / D
  T* half_solved_position;  // [solver] D^-1 L^-T rhs of the position phase
  T* half_solved_velocity;  // the same of the velocity phase, in the same array unless they differ
  T* half_solved_velocity_storage;  // its array where they differ
  T* start;                         // [solver] the velocities that a step starts from
  T* solution;                      // [solver] the velocities of the position phase, or their changes (solve.h)
  T* velocity_solution;             // [solver] those of the velocity phase, only if they differ
  T* scratch;                       // as long as the longest vector, for one stage at a time
  T* product;            // [velocities] momentum to gain, before S^T; unused where errors are removed by force
  T* corrected_product;  // the same less the momentum of the correction

  template <class Take>
  void matrices(const Tables<ScalarOf<T>>& t, Take& take) {
    const bool composite = t.reduction.composite.places > 0, stages = t.integrator != Integrator::euler;
    take("dynamics.joint_inertia", joint_inertia, t.joints);
    take("dynamics.matrix", matrix, t.makes_matrix ? t.matrix.entries : 0);
    take("dynamics.rhs", rhs, t.velocities);
    take("dynamics.bias", bias, stages ? t.velocities : 0);
    if (!stages) bias = rhs;
    const int behind = composite && t.solve_twice ? t.solver.n : 0;
    take("dynamics.reduced", reduced, t.reduction.used() ? t.solver.entries + behind : 0);
    if (!t.reduction.used()) reduced = matrix;
    take("dynamics.inverse", inverse, t.solver.n);
  }
  template <class Take>
  void vectors(const Tables<ScalarOf<T>>& t, Take& take) {
    const int n = t.solver.n, rows = t.rows.count;
    const bool two = t.reduction.eliminates() && t.solve_twice;
    take("dynamics.half_solved_position", half_solved_position, n);
    take("dynamics.half_solved_velocity", half_solved_velocity, two ? n : 0);
    if (!two) half_solved_velocity = half_solved_position;
    half_solved_velocity_storage = half_solved_velocity;
    take("dynamics.start", start, n);
    take("dynamics.solution", solution, n);
    take("dynamics.velocity_solution", velocity_solution, t.solve_twice ? n : 0);
    const int longest = rows > 0 ? RowBlock::most_rows * t.velocities : t.velocities;
    take("dynamics.scratch", scratch, longest > rows ? longest : rows, Lifetime::stage);
    take("dynamics.product", product, t.velocities, Lifetime::stage);
    take("dynamics.corrected_product", corrected_product, t.velocities, Lifetime::stage);
  }
};

/// M + armature, the inertia of softness by frequency; only where A has more than that.
template <class T>
struct Undamped {
  T* matrix;
  T* inverse;
  T* response;    // [velocities]
  T* compliance;  // [undamped rows]

  template <class Take>
  void arrays(const Tables<ScalarOf<T>>& t, Take& take) {
    const bool used = t.undamped.count > 0;
    take("undamped.matrix", matrix, used ? t.matrix.entries : 0, Lifetime::stage);
    take("undamped.inverse", inverse, used ? t.velocities : 0, Lifetime::stage);
    take("undamped.response", response, used ? t.velocities : 0, Lifetime::stage);
    take("undamped.compliance", compliance, t.undamped.count);
  }
};

}  // namespace lockstep::kernels
