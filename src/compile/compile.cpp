// compile(): from a Model to the tables of a step. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "lockstep/error.h"
#include "lockstep/plan.h"
#include "measure/inertia_at_start.h"
#include "model/functions.h"
#include "model/tendons.h"
#include "plan/layout.h"
#include "plan/limits.h"

namespace lockstep {
namespace {

constexpr double least_turn = 0.02;  // in a step that is audited, rad
constexpr double most_gain = 0.04;   // from nowhere, as a share of the largest kinetic energy

void require(bool holds, const char* setting, const std::string& rule, const char* remedy) {
  if (!holds) throw SettingsError(setting, rule, remedy);
}

void check(const StepSettings& s) {
  require(s.dt >= 1e-9 && s.dt <= 1e3, "dt", fmt::format("is {} s, outside 1e-9 to 1000", s.dt),
          "give for instance 1.0 / 240");
  require(s.iterations >= 1 && s.iterations <= 1000, "iterations",
          fmt::format("is {}, outside 1 to 1000", s.iterations), "give for instance 4");
  require(s.velocity_iterations >= 0 && s.velocity_iterations <= 1000, "velocity_iterations",
          fmt::format("is {}, outside 0 to 1000", s.velocity_iterations), "give for instance 1");
  require(s.position_bound > 0.0 && s.position_bound <= 1e30, "position_bound", "is outside (0, 1e30]",
          "give for instance 1e5");
  require(s.velocity_bound > 0.0 && s.velocity_bound <= 1e30, "velocity_bound", "is outside (0, 1e30]",
          "give for instance 1e5");
  require(s.guard > 0.0, "guard", fmt::format("is {}, not above 0", s.guard), "give for instance 0.01, or infinity");
  const ContactSettings& c = s.contacts;
  require(c.passes >= 1 && c.passes <= 100, "contacts.passes", fmt::format("is {}, outside 1 to 100", c.passes),
          "give for instance 3");
  require(c.rounds >= 1 && c.rounds <= 1000, "contacts.rounds", fmt::format("is {}, outside 1 to 1000", c.rounds),
          "give for instance 30");
  require(c.tolerance > 0.0 && c.tolerance <= 0.1, "contacts.tolerance",
          fmt::format("is {}, outside (0, 0.1]", c.tolerance), "give for instance 1e-4");
  require(s.method >= Method::automatic && s.method <= Method::reduced, "method",
          fmt::format("is {}, none of the enumerators", static_cast<int>(s.method)), "give one of Method");
  require(s.integrator >= Integrator::automatic && s.integrator <= Integrator::runge_kutta, "integrator",
          fmt::format("is {}, none of the enumerators", static_cast<int>(s.integrator)), "give one of Integrator");
  require(!s.per_environment.has_unknown(), "per_environment", "holds a field that is none of the enumerators",
          "give some of Parameter");
}

void check_ignored(const Ignored& ignore, const Model& model) {
  for (const JointSet* set :
       {&ignore.position_limits, &ignore.velocity_limits, &ignore.effort_limits, &ignore.friction})
    for (const std::string& name : set->names)
      require(std::any_of(model.joints.begin(), model.joints.end(),
                          [&](const Joint& joint) { return joint.name == name && joint.moves(); }),
              "ignore", fmt::format("names '{}', which is no moving joint of the model", name).c_str(),
              "name moving joints");
}

// The force of a kinematic drive is that of a bound, which it shares with limits and friction.
void check_records(const StepSettings& settings, const Model& model) {
  for (const Joint& joint : model.joints)
    require(
        !settings.record_efforts || !joint.drive.kinematic, "record_efforts",
        fmt::format("is set, and joint '{}' has a kinematic drive, whose effort is not known apart from that of its "
                    "limits and its friction",
                    joint.name),
        "give the joint a servo, or record nothing");
}

// A drive that is late has one input for each step.
void check_stage_inputs(const StepSettings& settings, const Model& model) {
  if (!settings.stage_inputs) return;
  for (const Joint& joint : model.joints)
    require(joint.drive.delay == 0 && joint.drive.lag == 0.0, "stage_inputs",
            fmt::format("is set, but the drive of joint '{}' is late, and has one input for each step", joint.name),
            "hold the inputs over the step, or compile a model without delays and lags");
}

// A link's inertia scales with its mass.
void check_masses(const StepSettings& settings, const Model& model) {
  if (!settings.per_environment.contains(Parameter::mass) || settings.per_environment.contains(Parameter::inertia))
    return;
  for (const Link& link : model.links)
    require(link.inertia.mass > 0.0 || link.inertia.about_center.isZero(0.0), "per_environment",
            fmt::format("has the mass, but link '{}' has an inertia and no mass to scale it with", link.name),
            "give the link a mass, or its inertia to the link that it is fixed to");
}

// What a step solves, and how its matrix is made.
void lay_out_solver(Program& program) {
  Tables<double>& t = program.f64;
  t.reduction = {};
  t.solver = t.matrix;
  set_inertia(program, std::vector<bool>(static_cast<std::size_t>(t.tree.count), true), InertiaKind::matrix);
  if (program.method == Method::reduced) eliminate_followers(program);
  if (!t.reduction.used() && !program.folded.empty()) lay_out_basis(program, {}, false);
  lay_out_rows(program);
  take_composite_columns(program);
  take_articulated_bodies(program);
}

std::shared_ptr<Program> compiled(const Model& model, const StepSettings& settings, Integrator integrator) {
  auto program = std::make_shared<Program>();
  program->model = model;
  program->model.roots = Trees(model).roots;  // named, if the model leaves them out
  program->settings = settings;
  Tables<double>& t = program->f64;
  for (unsigned p = 0; p < parameter_count; ++p)  // what is laid out depends on it
    if (settings.per_environment.contains(static_cast<Parameter>(p))) t.per_environment |= 1u << p;

  // What moves, which joints follow others, and the method: plan/bodies and plan/couplings.
  lay_out_times(*program, integrator);
  lay_out_bodies(*program, Trees(program->model));
  program->contacts = contact_pairs(program->model, Trees(program->model));
  lay_out_couplings(*program);
  lay_out_spatial_tendons(*program);
  choose_followers(*program);
  close_start(*program);
  place_curved(program->model);
  place_tendons(program->model);
  lay_out_joint_terms(*program);
  lay_out_actuators(*program);
  find_redundant_couplings(*program);
  choose_method(*program);
  check_bounds_of_functions(*program);

  // What a step solves: plan/matrix, and plan/rows over its velocities. Two choices need the tables that they replace.
  lay_out_solver(*program);
  choose_folding(*program, largest_folded_shares);
  if (!program->folded.empty()) lay_out_solver(*program);
  take_constraint_velocities(*program, first_joints_shares);
  lay_out_factoring(*program);

  // What acts only at times, what a step reports, and which joints turn: plan/rows and plan/couplings.
  lay_out_loops(*program);
  lay_out_rounds(*program);
  lay_out_contacts(*program);
  lay_out_report(*program);
  lay_out_turns(*program);

  // Settings, and the guard.
  t.method = program->method;
  t.iterations = settings.iterations;
  t.velocity_iterations = settings.velocity_iterations;
  t.position_bound = settings.position_bound;
  t.velocity_bound = settings.velocity_bound;
  t.guarded = integrator == Integrator::leapfrog && settings.guard < infinity;
  find_audit_obstacles(*program);
  t.audited = !find_obstacle(*program, Axis::audit);
  t.coarse_above = t.guarded ? settings.guard * settings.guard : 0.0;
  t.too_fast_above = 100.0 * t.coarse_above;
  t.fast_above = least_turn / settings.dt;
  t.most_gain = most_gain;
  t.record_impulses = settings.record_impulses;
  t.record_diagnostics = settings.record_diagnostics;
  t.record_efforts = settings.record_efforts;
  t.record_contacts = settings.record_contacts;
  t.record_accelerations = settings.record_accelerations;

  // From all tables: single precision, and what keeps integrators from applying.
  narrow(*program);
  if (integrator == Integrator::runge_kutta) program->explicit_rate = largest_rate(*program);
  find_integrator_obstacles(*program);
  return program;
}

// What the stages of a leapfrog cannot hold is solved at the midpoint.
void take_midpoint(Program& program) {
  if (program.integrator != Integrator::leapfrog || !program.f64.rounds.at_midpoint) return;
  const std::shared_ptr<Program> solve = midpoint_solve(program);
  program.f64.midpoint = &solve->f64;
  program.f32.midpoint = &solve->f32;
  program.fits_single = program.fits_single && solve->fits_single;
  program.midpoint = solve;
}

// An extrapolated step takes two of half the length. A guarded one takes them in lanes where it is too coarse.
void take_halves(Program& program, int deep) {
  take_midpoint(program);
  if (deep == 0) return;
  const std::shared_ptr<Program> half = half_step(program);
  take_halves(*half, deep - 1);
  program.f64.half = &half->f64;
  program.f32.half = &half->f32;
  program.fits_single = program.fits_single && half->fits_single;
  program.half = half;
}

}  // namespace

Plan compile(const Model& model, const StepSettings& settings) {
  check(settings);
  model.validate();
  check_ignored(settings.ignore, model);
  check_stage_inputs(settings, model);
  check_masses(settings, model);
  check_records(settings, model);
  const bool automatic = settings.integrator == Integrator::automatic;
  std::shared_ptr<Program> program = compiled(model, settings, automatic ? Integrator::leapfrog : settings.integrator);
  program->integrator_reason = automatic ? "its errors are of second order" : "as asked for";
  if (const PlanObstacle* obstacle = find_obstacle(*program, Axis::stages))
    program->integrator_reason += ", and bounds act at its midpoint: " + obstacle->reason;
  if (const PlanObstacle* obstacle = find_obstacle(*program, Axis::integrator, to_string(program->integrator))) {
    if (!automatic) refuse(*obstacle);
    const std::string reason = obstacle->reason;
    program = compiled(model, settings, Integrator::euler);
    program->integrator_reason = reason;
  }
  const Tables<double>& t = program->f64;
  if (const long bounds = t.bounds.rows.count; !t.rounds.used())
    require_room(*program, bounds * bounds, the_response_matrix);
  take_halves(*program, program->integrator == Integrator::extrapolated ? 1 : program->f64.guarded ? guard_depth : 0);
  return Plan(std::move(program));
}

}  // namespace lockstep
