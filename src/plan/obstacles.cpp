// Each rule that keeps something from applying, beside what, why, and what to do. SPDX-License-Identifier: Apache-2.0
#include "obstacles.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "layout.h"
#include "lockstep/error.h"

namespace lockstep {
namespace {

constexpr double largest_share = 1e3;           // (M97)
constexpr double explicit_bound = 2.5;          // (M75)
constexpr double most_extrapolated_erp = 1.75;  // (M71)

constexpr Integrator staged[] = {Integrator::leapfrog, Integrator::extrapolated, Integrator::runge_kutta};

void note(Program& program, Axis axis, const char* applies_to, const char* feature, const std::string& reason,
          const std::string& remedy) {
  program.obstacles.push_back({{feature, applies_to, reason, remedy}, axis});
}

}  // namespace

// ---------------------------------------------------------------- methods, and fields per environment

void find_method_obstacles(Program& program) {
  const StepSettings& s = program.settings;
  const Model& model = program.model;
  const bool has_tendons = program.f64.tendons.count > 0 || program.f64.spatial.used(),
             has_functions = program.f64.functions.used();

  // Which couplings are redundant is known for the model's ratios alone.
  if (declared(program, Parameter::gear_ratio) && !program.redundant.empty()) {
    const char* const feature = "gear ratios per environment";
    const std::string reason = "gear ratios differ per environment, and some couplings are redundant";
    if (has_tendons)
      note(program, Axis::per_environment, "per_environment", feature,
           "does not fit tendons, which take eliminated couplings: " + reason, "leave it out, or remove the tendons");
    if (has_functions)
      note(program, Axis::per_environment, "per_environment", feature,
           "does not fit functions of joints, which take eliminated couplings: " + reason,
           "leave it out, or remove the redundant couplings");
    note(program, Axis::method, to_string(Method::reduced), feature, reason, "use direct");
  }

  // Tendons, which only elimination places.
  if (has_tendons)
    for (const Method method : {Method::direct, Method::pgs, Method::tgs})
      note(program, Axis::method, to_string(method), "tendons", "tendons have no inertia of their own, which it needs",
           "use reduced, or automatic");

  // Functions of joints, whose followers only elimination places.
  if (has_functions) {
    for (const Method method : {Method::direct, Method::pgs, Method::tgs})
      note(program, Axis::method, to_string(method), "functions of joints",
           "followers that are functions of a joint are eliminated, which it does not do", "use reduced, or automatic");
    for (const Parameter varied : {Parameter::softness, Parameter::coupling_switch})
      if (declared(program, varied))
        note(program, Axis::per_environment, "per_environment", "functions of joints",
             fmt::format("has the {}, but some followers are functions of a joint, which always hold",
                         to_string(varied)),
             "leave it out, or make these couplings linear");
  }

  // Sub-steps, whose rate (M36) an erp above 1 does not have.
  const auto divide = [&](const Softness& softness, const char* kind, const std::string& name) {
    if (s.iterations > 1 && is_hard(softness) && erp_of(softness) > 1.0)
      note(program, Axis::sub_steps, to_string(Method::tgs), "high erp",
           fmt::format("tgs with {} sub-steps cannot divide the erp {} of {} '{}': it is above 1", s.iterations,
                       erp_of(softness), kind, name),
           "lower the erp, or use one iteration or another method");
  };
  for (const Coupling& coupling : model.couplings) divide(coupling.softness, "coupling", coupling.joint);
  for (const Joint& joint : model.joints)
    if ((joint.lower > -infinity || joint.upper < infinity) && !leaves_out(program, s.ignore.position_limits, joint))
      divide(joint.limit_softness, "the limits of joint", joint.name);

  // Force limits beside softness per environment.
  for (const Coupling& coupling : model.couplings)
    if (coupling.force_limit < infinity && declared(program, Parameter::softness))
      note(
          program, Axis::per_environment, "per_environment", "softness per environment",
          fmt::format("has the softness, but coupling '{}' has a force limit, which needs the same softness everywhere",
                      coupling.joint),
          "leave out the softness or the force limit");

  // What does not go with sweeps.
  if (program.method == Method::pgs || program.method == Method::tgs)
    for (const Integrator integrator : staged)
      note(program, Axis::integrator, to_string(integrator), "sweeps",
           fmt::format("{} uses sweeps, which leave an error of their own in every stage", to_string(program.method)),
           "use the method reduced or direct");
  if (!program.contacts.pairs.empty())
    note(program, Axis::sub_steps, to_string(Method::tgs), "contacts",
         "does not apply to a model with contacts: tgs renews couplings and bounds in its sub-steps, and contacts not "
         "yet",
         "use pgs, or automatic");
  for (const Method method : {Method::pgs, Method::tgs})
    if (!model.loops.empty())
      note(
          program, Axis::method, to_string(method), "loops",
          "sweeps leave too much of a loop open: the rows of a loop are redundant, and each is coupled with all joints "
          "around it",
          "use reduced or direct, or automatic");
}

// ---------------------------------------------------------------- parts of a step

std::optional<PlanObstacle> obstacle_to_folding(const Program& program) {
  const auto stands = [](const char* feature, const char* reason, const char* remedy = "") {
    return PlanObstacle{{feature, "folding", reason, remedy}, Axis::folding};
  };
  if (program.integrator != Integrator::euler)
    return stands("stages", "an integrator with several stages has them as rows", "use euler");
  if (declared(program, Parameter::softness))
    return stands("softness per environment", "the softness differs per environment");
  if (declared(program, Parameter::coupling_switch))
    return stands("switches per environment", "couplings are switched per environment");
  return std::nullopt;
}

std::optional<PlanObstacle> obstacle_to_folding(const Program& program, int row, double share) {
  const Tables<double>& t = program.f64;
  const int c = t.rows.coupling[row];
  const auto stands = [&](const char* feature, const char* rest) {
    const std::string name = coupling_names(program.model)[static_cast<std::size_t>(c)];
    return PlanObstacle{{feature, "folding", fmt::format("coupling '{}' {}", name, rest), ""}, Axis::folding};
  };
  if (!t.rows.softness[row].soft) return stands("hard couplings", "is hard");
  if (t.tree_of_joint(t.term_joint[t.term_start[c]]).inertia == InertiaKind::articulated_bodies)
    return stands("articulated bodies", "is on a tree that is solved by articulated bodies");
  if (!(share <= largest_share))
    return stands("stiff couplings", "is so stiff that the inertia of a joint would drown in single precision");
  return std::nullopt;
}

std::optional<PlanObstacle> obstacle_to_single_velocities(const Program& program) {
  const Tables<double>& t = program.f64;
  const auto stands = [](const char* feature, const std::string& reason) {
    return PlanObstacle{{feature, "stages", reason, ""}, Axis::stages};
  };
  if (t.loops.used()) return stands("loops", "loops are rows over several velocities");
  if (t.rows.count > 0) return stands("kept couplings", "couplings that are not eliminated compete with the bounds");
  std::vector<std::string> several;
  const auto add_joint_name = [&](int joint) {
    several.push_back(program.dof_names[static_cast<std::size_t>(t.dof[joint])]);
  };
  for (int i = 0; i < t.limited_servos.count; ++i)
    if (!acts_on_one_velocity(t, t.limited_servos[i])) add_joint_name(t.limited_servos[i]);
  for (int r = t.bounds.single; r < t.bounds.rows.count; ++r) {
    const BoundKind kind = t.bounds.kind[r];
    if (kind == BoundKind::joint && t.bounds.rows.term_start[r + 1] - t.bounds.rows.term_start[r] == 1 &&
        !is_spatial(t, t.bounds.member[t.bounds.member_start[r]].joint))
      continue;
    if (kind != BoundKind::joint && kind != BoundKind::servo && kind != BoundKind::drive)
      return stands("soft bounds", "a limit, a kinematic drive or a coupling's force limit is soft");
    add_joint_name(t.bounds.member[t.bounds.member_start[r]].joint);
  }
  if (!several.empty())
    return stands("bounds of followers of several joints",
                  fmt::format("what has bounds or a limited servo follows several joints, or a path: {}",
                              fmt::join(several, ", ")));
  if (t.articulated.used())
    return stands("articulated bodies", "the bounds act on trees that are solved by articulated bodies");
  return std::nullopt;
}

void find_audit_obstacles(Program& program) {
  const auto stands = [&](const char* feature, const char* reason, const char* remedy = "") {
    note(program, Axis::audit, "audit", feature, reason, remedy);
  };
  if (program.settings.guard == infinity) stands("guard", "guard is infinity", "give for instance 0.01");
  if (program.integrator == Integrator::euler && program.f64.contacts.used())
    stands("contacts", "velocities of euler are half a step late, which beside contacts looks like energy",
           "use leapfrog");
  if (program.f64.loops.used())
    stands("loops", "a step over a pose in which a loop is folded flat may gain or lose some");
  if (declared(program, Parameter::loop_frame))
    stands("frames of loops per environment", "moved frames may do any work");
  const Bounds<double>& b = program.f64.bounds;
  bool drives = false, soft = false;
  for (int r = 0; r < b.rows.count; ++r)
    drives |= b.kinematic[r] || b.kind[r] == BoundKind::soft_drive || b.kind[r] == BoundKind::drive;
  for (const Coupling& coupling : program.model.couplings) soft |= !is_hard(coupling.softness);
  for (const Loop& loop : program.model.loops) soft |= !is_hard(loop.softness);
  if (drives) stands("kinematic drives", "kinematic drives may do any work");
  if (soft) stands("soft couplings", "soft couplings and loops keep energy");
  if (declared(program, Parameter::softness) || declared(program, Parameter::coupling_switch) ||
      declared(program, Parameter::loop_switch))
    stands("softness or switches per environment", "couplings or loops are soft or switched per environment");
  if (declared(program, Parameter::link_wrench)) stands("wrenches per environment", "wrenches may do any work");
}

// ---------------------------------------------------------------- integrators

void find_integrator_obstacles(Program& program) {
  const Tables<double>& t = program.f64;
  const StepSettings& s = program.settings;

  // What the scene has that stages may not be able to hold.
  const bool touches = !program.contacts.pairs.empty();
  const bool bounded = t.bounds.rows.count > 0 || t.limited_servos.count > 0 || t.row_servos.count > 0;
  bool hard = false, depends_on_step = false;
  for (const Coupling& coupling : program.model.couplings) {
    const SoftnessKind kind = kind_of(coupling.softness);
    hard |= is_hard(coupling.softness);
    depends_on_step |= kind == SoftnessKind::hard || kind == SoftnessKind::erp_cfm;
  }
  for (const Integrator integrator : staged) {
    const bool leapfrog = integrator == Integrator::leapfrog, runge_kutta = integrator == Integrator::runge_kutta;
    const auto stands = [&](const char* feature, const std::string& reason, const std::string& remedy) {
      note(program, Axis::integrator, to_string(integrator), feature, reason, remedy);
    };
    const auto corrections_stay = [&] {
      stands("velocity_iterations",
             "velocity_iterations is 0, so corrections of positions would stay in the velocities", "give 1");
    };

    // Loops.
    if (!program.model.loops.empty() && !leapfrog)
      stands("loops", "loops are held by rows, which its stages do not have", "use leapfrog or euler");
    if (!program.model.loops.empty() && leapfrog && declared(program, Parameter::loop_frame))
      stands(
          "frames of loops per environment",
          "loop_frame is declared, and a leapfrog does not know the speed of frames that are moved between its steps",
          "use euler");

    // Contacts and bounds.
    if (touches && !leapfrog) stands("contacts", "contacts may begin and end within a step", "use leapfrog or euler");
    if (bounded && !leapfrog)
      stands("bounds", "the scene has bounds, which may become active within a step",
             "use leapfrog or euler, or leave out the bounds by StepSettings::ignore");
    const bool holds = leapfrog && (bounded || touches || !program.model.loops.empty());
    if (holds && s.velocity_iterations == 0) corrections_stay();

    // Records of a single solve.
    if (s.record_impulses || s.record_diagnostics)
      stands("recorded impulses or diagnostics", "a step of several stages has no single impulse or balance to record",
             "use euler, or record nothing");

    if (s.record_efforts && !leapfrog)
      stands("recorded efforts", "its weights of stages make no mean force of a drive",
             "use leapfrog or euler, or record no efforts");

    // Couplings: corrections that stay or grow, and softness that depends on the length of a stage.
    if (integrator == Integrator::extrapolated)
      for (const Coupling& coupling : program.model.couplings)
        if (is_hard(coupling.softness) && erp_of(coupling.softness) > most_extrapolated_erp)
          stands("high erp",
                 fmt::format("coupling '{}' has an erp of {}, and above {} the extrapolation makes its error grow",
                             coupling.joint, erp_of(coupling.softness), most_extrapolated_erp),
                 "lower the erp");
    if (hard && !holds && !runge_kutta && s.velocity_iterations == 0) corrections_stay();
    if (declared(program, Parameter::softness) && depends_on_step)
      stands("softness per environment",
             "softness differs per environment and is given by erp and cfm, which mean a different spring for each "
             "length of a stage",
             "give it as a spring or by frequency");

    // What has to be explicit: rows, and the rates of (M75).
    if (!runge_kutta) continue;
    if (t.rows.count + t.folded.count > 0)
      stands("kept couplings", "some couplings are soft, switched or not eliminated, which takes an implicit step",
             "use leapfrog or extrapolated, or the method reduced with hard couplings");
    const double rate = program.explicit_rate, reach = rate * s.dt;
    if (!(reach <= explicit_bound))
      stands("stiff drives, springs or damping",
             fmt::format("drives, springs and damping cause rates of up to {:.3g} 1/s at the model's start; times dt = "
                         "{:.4g} s that is {:.3g}, above {}",
                         rate, s.dt, reach, explicit_bound),
             fmt::format("use leapfrog or extrapolated, or a dt of at most {:.3g} s", explicit_bound / rate));
  }
}

// ---------------------------------------------------------------- who asks

const PlanObstacle* find_obstacle(const Program& program, Axis axis, const char* applies_to) {
  for (const PlanObstacle& obstacle : program.obstacles)
    if (obstacle.axis == axis && (!applies_to || obstacle.applies_to == applies_to)) return &obstacle;
  return nullptr;
}

void refuse(const PlanObstacle& obstacle) {
  const bool is_whole = obstacle.axis == Axis::per_environment || obstacle.axis == Axis::sub_steps;
  const char* const setting = obstacle.axis == Axis::per_environment ? "per_environment"
                              : obstacle.axis == Axis::integrator    ? "integrator"
                                                                     : "method";
  throw SettingsError(setting, is_whole ? obstacle.reason : obstacle.applies_to + " does not apply: " + obstacle.reason,
                      obstacle.remedy);
}

}  // namespace lockstep
