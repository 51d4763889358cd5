// Methods, integrators, parameters and faults: what the library, its kernels and applications name alike.
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "lockstep/export.h"

namespace lockstep {

/// How couplings are solved. docs/choose.md says which to choose, docs/mathematics.md what each does.
enum class Method : int {
  automatic,  ///< reduced where it applies, else direct
  pgs,        ///< projected Gauss-Seidel, (16) of the note (PhysX, Mimic Joints): positions are fixed over the sweeps
  tgs,        ///< temporal Gauss-Seidel, (16) with the error C renewed in each of `iterations` sub-steps
  direct,     ///< all couplings at once by L^T D L; exact for chains and stars of couplings
  reduced,    ///< followers of always-hard couplings are eliminated when compiling; soft ones are solved as in direct
};

/// How positions and velocities are taken through time: docs/mathematics.md, sections 9, 13 and 19. docs/choose.md says
/// which to choose. `euler` takes every scene, the others do not: asking for one that does not apply is a SettingsError
/// that names the obstacle. `automatic` takes euler then, and Plan::describe() says why.
enum class Integrator : int {
  automatic,     ///< leapfrog where it applies, else euler
  euler,         ///< semi-implicit Euler, (M45): first order, for every scene
  leapfrog,      ///< second order, linear terms implicit, (M66) to (M70), bounds in every stage, (M86) to (M90): about
                 ///< twice the cost of euler, four to six times where bounds act
  extrapolated,  ///< third order, from leapfrogs of one and of half a step, (M71): about three times the cost of
                 ///< leapfrog; the erp of hard couplings is at most 1.75
  runge_kutta,  ///< the classical method of fourth order, (M72): every coupling hard and eliminated, drives and damping
                ///< not too stiff for the step at the model's start, (M75). A velocity that violates its coupling is
                ///< corrected over some steps, with 0.375 of the error left by each; the other integrators take one
                ///< step
};

/// What may differ from environment to environment. Each field must be declared in StepSettings::per_environment.
/// The rows of each field in Batch::parameter():
enum class Parameter : unsigned {
  gear_ratio,   ///< per coupling, in order: one row for each of its terms (CouplingTerm::ratio)
  offset,       ///< one row per coupling: gamma
  softness,     ///< two rows per coupling: the numbers of its Softness, of the alternative that the model states. The
                ///< second row of a Hard one is its cfm
  drive_gains,  ///< two rows per dof: kp and kd
  damping,      ///< one row per dof
  mass,         ///< one row per link of the model, kg; the inertia scales with it, the centre of mass stays
  gravity,      ///< three rows: x, y, z in m/s^2, world axes
  link_wrench,  ///< six rows per link of the model: torque about the link frame's origin (N m), then force (N),
                ///< both in world axes; zero at the start, held until changed
  coupling_switch,  ///< one row per coupling: 0 is off, anything else is on; 1 at the start
  armature,         ///< one row per dof, kg m^2 or kg
  stiffness,        ///< one row per dof: of the joint's spring, N m/rad or N/m. Its rest is the model's
  friction,  ///< one row per dof: dry friction, N m or N. Every joint may have some then, so every step solves for
             ///< it; a tendon only if it has some in the model
  position_limits,  ///< two rows per dof: lower and upper. This and the next two are for joints to which the model
                    ///< gives such a limit; rows of others stay infinite
  velocity_limit,   ///< one row per dof, rad/s or m/s
  effort_limit,     ///< one row per dof, N m or N
  center_of_mass,   ///< three rows per link of the model: x, y, z in the link's frame, m
  inertia,  ///< six rows per link of the model: ixx, iyy, izz, ixy, ixz, iyz about the centre of mass, kg m^2, in
            ///< the link's axes. They do not scale with the mass then
  contact_friction,  ///< one row per contact, as in Plan::contacts(): Coulomb's coefficient of the pair, 0 to 100
  loop_switch,       ///< one row per loop: 0 is off, anything else is on; 1 at the start
  loop_frame,        ///< seven rows per loop: Loop::first_pose as x, y, z in m and a quaternion w, x, y, z of any
                     ///< length from 0.001 to 1000; not by leapfrog
  function,     ///< by coupling that has a Function: the coefficients of a Polynomial, CamTable::follower, or mean,
                ///< cosine and sine of a Harmonic
  drive_delay,  ///< one row per dof: Drive::delay, a whole number of steps, at most the model's; randomize() rounds to
                ///< one. This and the next two are for drives to which the model gives one; rows of others stay
  drive_lag,    ///< one row per dof: Drive::lag, s
  motor_curve,  ///< two rows per dof: Drive::stall_effort and no_load_speed
  collider_place,       ///< four rows per collider of the model: x, y, z in m and a turn about z in rad. It moves the
                        ///< collider in the axes of its link, or of the world, before Collider::pose; 0 at the start
  collider_size,        ///< three rows per collider of the model: Shape::size, 0.1 to 10 times the model's; of a hull,
                        ///< factors along its axes about the centre of its volume. Masses and inertias stay. Rows of
                        ///< half-spaces and height fields stay
  contact_restitution,  ///< one row per contact, as in Plan::contacts(): 0 to 1
};
inline constexpr int parameter_count = 27;

/// Why an environment was frozen. It stays until the environment is reset. Batch::explain_fault() says it in words.
enum class Fault : std::uint32_t {
  none = 0,
  not_finite = 1,  ///< the step would have left a position or velocity that is NaN or infinite
  diverged = 2,    ///< the step would have left one beyond StepSettings::position_bound or velocity_bound, a joint that
                   ///< turns for ever beyond the turns that can be counted (see Batch::angles()), or a spatial tendon
                   ///< whose length would leap
  singular = 3,    ///< the mass matrix is not positive definite or not finite: a per-environment parameter is
                   ///< impossible, or the masses are too far apart for this precision
  bad_value = 4,   ///< a per-environment parameter is outside the range that it has in a Model, or a root's quaternion
                   ///< is 0: found when step() is called, before it moves anything
  too_fast = 5,    ///< the motion is too fast for the step, so its energy would not be right: StepSettings::guard
  bad_input = 6,   ///< an action was NaN: found by Batch::set_actions(), which left the environment's inputs alone
};

inline constexpr unsigned fault_count = 7;

/// What found the fault.
enum class FaultStage : std::uint32_t {
  none,
  values,  ///< the look at parameters and quaternions when step() is called, before anything moves, or at actions
  matrix,  ///< the factorisation of the mass matrix
  guard,   ///< the guard, in the finest of its halvings
  energy,  ///< the audit of energy
  state,   ///< the look at the new positions and velocities
};
inline constexpr unsigned fault_stage_count = 6;

/// What a loop holds together: two frames, one on each link.
enum class LoopKind {
  point,   ///< the origins: a ball joint, 3 rows
  hinge,   ///< the origins, and the axis of one along the axis of the other, 5 rows
  slider,  ///< all but the motion along the axis, 5 rows
  weld,    ///< the whole frames, 6 rows
};
inline constexpr LoopKind all_loop_kinds[] = {LoopKind::point, LoopKind::hinge, LoopKind::slider, LoopKind::weld};

/// The enumerator's name: "reduced", "leapfrog", "gear_ratio", "not_finite" ... The string lives forever.
LOCKSTEP_API const char* to_string(Method method) noexcept;
LOCKSTEP_API const char* to_string(Integrator integrator) noexcept;
LOCKSTEP_API const char* to_string(Parameter parameter) noexcept;
LOCKSTEP_API const char* to_string(Fault fault) noexcept;
LOCKSTEP_API const char* to_string(FaultStage stage) noexcept;
LOCKSTEP_API const char* to_string(LoopKind kind) noexcept;

/// Kinds of Shape, whose sizes model.h has. In a pair of colliders the kind that stands first here is the first.
enum class ShapeKind { half_space, height_field, box, hull, cylinder, capsule, ellipsoid, sphere };

/// Whether a shape is solid below a surface, and never moves.
constexpr bool is_ground(ShapeKind kind) { return kind <= ShapeKind::height_field; }

}  // namespace lockstep
