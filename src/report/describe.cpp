// A Plan in words. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstddef>
#include <numbers>

#include "describe_contacts.h"
#include "jit/compile.h"
#include "lockstep/generate.h"
#include "lockstep/plan.h"
#include "plan/layout.h"
#include "targets/reduced_matrix.h"
#include "targets/registry.h"
#include "words.h"

namespace lockstep {
namespace {

std::string words_of(const Softness& softness) {
  struct Words {
    std::string operator()(const Hard& s) const { return fmt::format("hard (erp {:g})", s.erp); }
    std::string operator()(const ErpCfm& s) const { return fmt::format("erp {:g}, cfm {:g}", s.erp, s.cfm); }
    std::string operator()(const Spring& s) const { return fmt::format("kp {:g}, kd {:g}", s.kp, s.kd); }
    std::string operator()(const Frequency& s) const {
      return fmt::format("{:g} rad/s ({:.3g} Hz), damping ratio {:g}", s.rad_per_s,
                         s.rad_per_s / (2.0 * std::numbers::pi), s.damping_ratio);
    }
  };
  return std::visit(Words{}, softness);
}

const char* words_of(Integrator integrator) {
  switch (integrator) {
    case Integrator::leapfrog: return "leapfrog with an implicit linear part";
    case Integrator::extrapolated: return "extrapolated from leapfrogs of one step and of two halves";
    case Integrator::runge_kutta: return "Runge-Kutta 4";
    default: return "semi-implicit Euler";
  }
}

// How often a step runs which of its stages, where not once.
const char* evaluations_of(Integrator integrator) {
  switch (integrator) {
    case Integrator::leapfrog: return " (at the midpoint; bias forces twice, solved four times)";
    case Integrator::extrapolated: return " (of three leapfrogs, each with bias forces twice and four solves)";
    case Integrator::runge_kutta: return " (four times over)";
    default: return "";
  }
}

std::string words_of(const Function& function) {
  if (const auto* polynomial = std::get_if<Polynomial>(&function))
    return fmt::format("a polynomial of degree {}", polynomial->coefficients.size() - 1);
  if (const auto* table = std::get_if<CamTable>(&function))
    return fmt::format("a table of {} points", table->leader.size());
  const Harmonic& h = std::get<Harmonic>(function);
  return fmt::format("{:g} + {:g} cos(x) + {:g} sin(x), x = {:g} times the position", h.mean, h.cosine, h.sine, h.rate);
}

std::string words_of(const Coupling& coupling, const std::string& name) {
  if (coupling.function)
    return fmt::format("{}: {} follows {} as {}", name, coupling.joint, coupling.terms[0].joint,
                       words_of(*coupling.function));
  std::string form = coupling.joint;
  for (const CouplingTerm& term : coupling.terms)
    form += fmt::format(" {} {:g} {}", term.ratio < 0 ? '-' : '+', std::abs(term.ratio), term.joint);
  if (coupling.offset != 0.0)
    form += fmt::format(" {} {:g}", coupling.offset < 0 ? '-' : '+', std::abs(coupling.offset));
  return fmt::format("{}: {} = 0, {}", name, form, words_of(coupling.softness));
}

std::string mechanism_line(const Program& program) {
  const Tables<double>& t = program.f64;
  std::string base = t.roots.count > 0 ? "floating base" : "fixed base";
  if (program.trees.size() > 1)
    base = fmt::format(
        "{} trees, {}", program.trees.size(),
        t.roots.count == 0 ? "all bolted" : joined(program.root_names) + (t.roots.count == 1 ? " floats" : " float"));
  std::string text =
      fmt::format("{}: {}, {}, {}", program.model.name, base,
                  count_of(t.joints - t.tendons.count - t.spatial.tendons.count, "moving joint", "moving joints"),
                  count_of(t.couplings, "coupling", "couplings"));
  if (t.tendons.count > 0)
    text += fmt::format("; {} of the couplings {} what the position of a tendon is", t.tendons.count,
                        t.tendons.count == 1 ? "says" : "say");
  if (t.spatial.used())
    text += fmt::format("; {}", count_of(t.spatial.tendons.count, "spatial tendon", "spatial tendons"));
  if (program.merged_links > 0)
    text += fmt::format("; {} fixed to others and merged", count_of(program.merged_links, "link is", "links are"));
  const auto sharing = std::count_if(program.model.links.begin(), program.model.links.end(),
                                     [](const Link& link) { return link.gravity != 1.0; });
  if (sharing > 0)
    text += fmt::format("; {} of gravity",
                        count_of(static_cast<int>(sharing), "link has its own share", "links have their own shares"));
  return text + ".\n";
}

std::string coupling_lines(const Program& program) {
  const std::vector<std::string> names = coupling_names(program.model);
  std::string text;
  for (std::size_t c = 0; c < names.size(); ++c) {
    const int index = static_cast<int>(c);
    text += "  " + words_of(program.model.couplings[c], names[c]);
    if (is_redundant(program, index))
      text += "; redundant: it follows from those above and takes no impulse of its own";
    if (is_absent(program, index)) text += "; absent: it has neither stiffness nor damping";
    text += '\n';
  }
  return text;
}

std::string locked_lines(const Program& program) {
  const std::vector<std::string> names = coupling_names(program.model);
  std::string text;
  for (const LockedJoints& locked : program.locked) {
    std::vector<std::string> joints, couplings;
    for (int dof : locked.dofs) joints.push_back(program.dof_names[dof]);
    for (int c : locked.couplings) couplings.push_back(names[c]);
    text += fmt::format("  {} cannot move: couplings {} leave one position.\n", joined(joints), joined(couplings));
  }
  return text;
}

std::string method_lines(const Program& program) {
  const Tables<double>& t = program.f64;
  const StepSettings& s = program.settings;
  const int rows = t.rows.count;
  const std::string once_more =
      s.velocity_iterations > 0 ? "" : ", without the solve of the velocity phase (velocity_iterations 0)";
  std::string text =
      fmt::format("Method: {} ({}).\nIntegrator: {} ({}), dt {:.6g} s ({:.4g} Hz).\n", to_string(program.method),
                  program.method_reason, words_of(program.integrator), program.integrator_reason, s.dt, 1.0 / s.dt);
  const int folded = t.folded.count;
  if (folded > 0)
    text += fmt::format("  {} into the matrix{}.\n",
                        count_of(folded, "soft coupling is folded", "soft couplings are folded"),
                        rows > 0 ? "" : ", so that no row is left to solve");
  if (const PlanObstacle* obstacle = find_obstacle(program, Axis::folding))
    text += fmt::format("  {}soft couplings are not folded into the matrix: {}.\n", folded > 0 ? "other " : "",
                        obstacle->reason);
  const std::string solved = "solved together by L^T D L";
  const std::string met = !t.rows.known_suffice ? solved
                          : t.bounds.rows.count > 0
                              ? "met by known constraint velocities, " + solved + " where bounds are active"
                              : "met by known constraint velocities";
  switch (program.method) {
    case Method::reduced:
      if (!program.eliminated.empty()) {
        std::vector<std::string> followers;
        for (int dof : program.eliminated) followers.push_back(program.dof_names[dof]);
        text += fmt::format("  eliminated: {}; {} of {} velocities are left to solve.\n", joined(followers), t.solver.n,
                            t.velocities);
      }
      if (rows > 0)
        text += fmt::format("  {} {}{}.\n", count_of(rows, "soft row is", "soft rows are"), solved, once_more);
      break;
    case Method::direct:
      if (rows > 0 || folded == 0)
        text += fmt::format("  {} {}{}.\n", count_of(rows, "row is", "rows are"), met, once_more);
      break;
    default:
      text += fmt::format("  {}, {} {}, then {}.\n", count_of(rows, "row", "rows"), s.iterations,
                          program.method == Method::tgs ? "sub-steps of one sweep" : "sweeps",
                          count_of(s.velocity_iterations, "velocity iteration", "velocity iterations"));
  }
  return text;
}

std::string input_line(const Program& program) {
  const std::size_t times = program.stage_times.size();
  std::string text;
  if (program.settings.stage_inputs)
    text = fmt::format("Targets and efforts: rows for {} of the step, {}.\n", times == 1 ? "the end" : "each time",
                       fmt::format("at shares of {:.4g}", fmt::join(program.stage_times, ", ")));
  if (program.integrator == Integrator::runge_kutta)
    text += fmt::format(
        "Explicit terms: motions of {:.3g} 1/s at the model's start, times dt {:.3g}, where up to 2.5 is stable; "
        "per-environment gains, damping and masses are not checked.\n",
        program.explicit_rate, program.explicit_rate * program.settings.dt);
  return text;
}

std::string stage_lines(const Program& program) {
  const Tables<double>& t = program.f64;
  std::vector<std::string> stages{"kinematics", "bias forces (Newton-Euler)", "joint terms"};
  if (t.own_weights.count > 0)
    stages.insert(stages.begin() + 2, fmt::format("weights of {} that differ from their trees' in the share of gravity",
                                                  count_of(t.own_weights.count, "link", "links")));
  if (t.couplings > 0) stages.insert(stages.begin() + 1, "coupling errors");
  if (t.makes_matrix) stages.push_back("mass matrix (composite bodies)");
  if (t.reduction.composite.places > 0) stages.push_back("reduced mass matrix (composite bodies, composite columns)");
  if (t.undamped.count > 0)
    stages.push_back("responses of the undamped inertia (a second factorisation, for softness by frequency)");
  if (t.reduction.by_entries() && t.reduction.followers > 0)
    stages.push_back(t.reduction.has_constraint_velocities() ? "constraint velocities in place of followers'"
                                                             : "elimination");
  if (t.folded.count > 0) stages.push_back("soft couplings folded into the matrix");
  std::vector<std::string> ways;
  if (t.articulated.used()) ways.push_back("articulated bodies");
  if (t.factored.count > 0 || !t.articulated.used()) ways.push_back("L^T D L");
  stages.push_back(fmt::format("free velocity ({})", fmt::join(ways, ", ")));
  if (t.rows.known_suffice)
    stages.push_back("known constraint velocities");
  else if (t.rows.count > 0)
    stages.insert(stages.end(),
                  {"responses", "row terms", to_string(t.rows.columns.n > 0 ? Method::direct : program.method)});
  if (t.bounds.rows.count > 0) stages.push_back("bounds");
  if (t.limited_servos.count + t.row_servos.count > 0) stages.push_back("limited servos");
  if (t.loops.used()) stages.push_back("loops");
  if (t.contacts.used()) stages.push_back("contacts");
  stages.insert(stages.end(), {"integration", "check"});
  std::string text = fmt::format("Stages{}: {}.\n", evaluations_of(program.integrator), fmt::join(stages, ", "));

  if (t.reduction.consistent_is_shorter)
    text +=
        fmt::format("Where all followers of a tile are consistent, a step leaves out their corrections{}.\n",
                    t.reduction.mirrors.count > 0
                        ? fmt::format(" and the sines of {} that turn as their leaders do", t.reduction.mirrors.count)
                        : "");
  std::vector<std::string> absent;
  if (t.rows.count == 0 && t.folded.count == 0) absent.push_back("solver rows");
  if (t.servos.count + t.limited_servos.count + t.row_servos.count == 0) absent.push_back("drives");
  bool damped = false, rotors = false;
  for (int j = 0; j < t.joints; ++j) damped |= t.damping[j] != 0.0, rotors |= t.armature[j] != 0.0;
  if (!damped && !declared(program, Parameter::damping)) absent.push_back("damping");
  if (!rotors && !declared(program, Parameter::armature)) absent.push_back("armature");
  if (t.springs.count == 0) absent.push_back("springs");
  std::vector<std::string> fields;
  for (int p = 0; p < parameter_count; ++p)
    if (declared(program, static_cast<Parameter>(p))) fields.push_back(to_string(static_cast<Parameter>(p)));
  if (fields.empty()) absent.push_back("fields per environment");
  if (!absent.empty()) text += fmt::format("Left out, because the scene has none: {}.\n", fmt::join(absent, ", "));
  if (!fields.empty()) text += fmt::format("May differ per environment: {}.\n", fmt::join(fields, ", "));
  return text;
}

// What a step holds, and what it leaves out as asked.
struct BoundCount {
  int held = 0, ignored = 0;
};

std::string bounds_lines(const Program& program) {
  const Ignored& ignore = program.settings.ignore;
  const Bounds<double>& b = program.f64.bounds;
  BoundCount position, velocity, effort, friction, kinematic, force;
  for (const Joint& joint : program.model.joints) {
    if (!joint.moves()) continue;
    const auto count = [&](bool has, BoundCount& counted, const JointSet& left_out) {
      if (has) ++(leaves_out(program, left_out, joint) ? counted.ignored : counted.held);
    };
    count(joint.lower > -infinity || joint.upper < infinity, position, ignore.position_limits);
    count(joint.velocity_limit < infinity, velocity, ignore.velocity_limits);
    count(joint.effort_limit < infinity, effort, ignore.effort_limits);
    count(joint.friction > 0.0 || declared(program, Parameter::friction), friction, ignore.friction);
    count(joint.drive.kinematic, kinematic, {});
  }
  for (const Coupling& coupling : program.model.couplings) force.held += coupling.force_limit < infinity;
  std::vector<std::string> held, ignored;
  const auto say = [&](const BoundCount& count, const char* one, const char* many) {
    if (count.held > 0) held.push_back(count_of(count.held, one, many));
    if (count.ignored > 0) ignored.push_back(count_of(count.ignored, one, many));
  };
  say(position, "position range", "position ranges");
  say(velocity, "velocity limit", "velocity limits");
  say(effort, "effort limit", "effort limits");
  say(friction, "dry friction", "dry frictions");
  say(kinematic, "kinematic drive", "kinematic drives");
  say(force, "coupling with a force limit", "couplings with a force limit");
  std::string text;
  if (!held.empty()) {
    text = fmt::format("Bounds: {}", fmt::join(held, ", "));
    if (b.rows.count > 0) {
      const bool exact = program.method == Method::direct || program.method == Method::reduced;
      text += fmt::format(
          "; {}, {}", count_of(b.rows.count, "row", "rows"),
          exact ? "active ones solved exactly through the couplings" : "active ones swept after the couplings");
    }
    if (program.f64.rounds.slots.count > 0)
      text += fmt::format("; {} over several velocities, where drives yield first, then loops, then limits",
                          count_of(program.f64.rounds.slots.count, "row", "rows"));
    else if (b.may_depend)
      text += "; hard ones that contradict each other share the violation";
    text += ".\n";
  }
  if (!ignored.empty()) text += fmt::format("Left out by StepSettings::ignore: {}.\n", fmt::join(ignored, ", "));
  return text;
}

std::string actuator_line(const Program& program) {
  const ActuatorStructure& a = program.f64.actuators;
  if (!a.used()) return "";
  std::vector<std::string> parts;
  int most = 0;
  for (int i = 0; i < a.delayed.count; ++i) most = std::max(most, a.delayed[i].most);
  if (a.delayed.count > 0)
    parts.push_back(fmt::format("{} of up to {}, {:.4g} s", count_of(a.delayed.count, "delay", "delays"),
                                count_of(most, "step", "steps"), most * program.settings.dt));
  if (a.lagged.count > 0) parts.push_back(count_of(a.lagged.count, "lag", "lags"));
  if (a.motors.count > 0)
    parts.push_back(
        count_of(a.motors.count, "motor whose effort falls with speed", "motors whose effort falls with speed"));
  return fmt::format("Drives: {}.\n", fmt::join(parts, ", "));
}

std::string loop_lines(const Program& program) {
  if (program.plan_loops.empty()) return "";
  int rows = 0, redundant = 0;
  std::vector<std::string> names, dependent;
  for (std::size_t l = 0; l < program.plan_loops.size(); ++l) {
    const PlanLoop& loop = program.plan_loops[l];
    rows += loop.rows, redundant += loop.redundant;
    names.push_back(fmt::format("{} ({}, {})", loop.name, to_string(program.model.loops[l].kind),
                                words_of(program.model.loops[l].softness)));
  }
  for (const int dof : program.loop_dependent_dofs)
    dependent.push_back(program.dof_names[static_cast<std::size_t>(dof)]);
  std::string text = fmt::format("Loops: {}; {}", joined(names), count_of(rows, "row", "rows"));
  if (redundant > 0) text += fmt::format(", of which {} follow from others where the model starts", redundant);
  if (!dependent.empty()) text += fmt::format("; by them {} depend on the other joints", joined(dependent));
  return text + ".\n";
}

// What finds motion that cannot be right.
std::string watch_line(const Program& program) {
  std::string text = "Watched: ";
  text += program.f64.guarded ? fmt::format("steps with an eta above {:g} are taken in halves", program.settings.guard)
                              : std::string("no step is taken in halves");
  const PlanObstacle* const obstacle = find_obstacle(program, Axis::audit);
  return text + (obstacle ? fmt::format("; energy is not watched: {}.\n", obstacle->reason)
                          : "; energy from nowhere is a fault.\n");
}

// Why there is no generated kernel of a plan.
std::string kernel_obstacle(const Plan& plan) {
  try {
    generate_kernel(plan);
  } catch (const SettingsError& error) {
    return error.element() + " " + error.rule();
  }
  return "";
}

std::string engine_line(const Plan& plan) {
  const Program& program = program_of(plan);
  const bool touches = program.f64.contacts.used(), loops = program.f64.loops.used();
  if (jit::has_routines(program))
    return fmt::format("Engine: compiled, in routines; the tables {}.\n",
                       touches ? "solve contacts"
                       : loops ? "hold loops"
                               : "solve what the stages of leapfrog cannot hold");
  if (touches || loops)
    return fmt::format("Engine: tables, which alone {}; compiled does not apply: {}.\n",
                       touches ? "solve contacts" : "hold loops", jit::plan_obstacle(program));
  // Without generated code.
  std::string engine = to_string(Engine::tables), reason;
  if (const char* obstacle = jit::speed_obstacle(program))
    reason = fmt::format("compiled is not taken by itself: {}", obstacle);
  else if (const std::string& obstacle = jit::plan_obstacle(program); obstacle.empty())
    engine = to_string(Engine::compiled);
  else
    reason = fmt::format("compiled does not apply: {}", obstacle);
  const std::string because = reason.empty() ? "" : fmt::format("  {}.\n", reason);

  const std::uint64_t hash = kernel_hash(plan);
  if (hash == 0)
    return fmt::format("Engine: {}; no kernel can be generated: {}.\n{}", engine, kernel_obstacle(plan), because);
  std::vector<std::string> generated;
  for (const GeneratedKernel* kernel : find_kernels(hash)) {
    if (kernel->f32) generated.push_back(fmt::format("{} for {} in f32", kernel->name, kernel->target));
    if (kernel->f64) generated.push_back(fmt::format("{} for {} in f64", kernel->name, kernel->target));
  }
  if (generated.empty())
    return fmt::format("Engine: {}; this program holds no kernel that was generated for this step ({:016x}).\n{}",
                       engine, hash, because);
  return fmt::format("Engine: generated for this step ({:016x}): {}; {} otherwise.\n{}", hash,
                     fmt::join(generated, ", "), engine, because);
}

}  // namespace

std::string Plan::describe() const {
  const Program& p = *program_;
  const long flops = flops_per_step();
  return mechanism_line(p) + coupling_lines(p) + locked_lines(p) + method_lines(p) + input_line(p) + stage_lines(p) +
         bounds_lines(p) + actuator_line(p) + loop_lines(p) + contact_lines(p) + watch_line(p) + engine_line(*this) +
         fmt::format("Cost of a step of one environment: {} flops; {} bytes read and written in f32, {} in f64.\n",
                     flops, bytes_per_step(4), bytes_per_step(8)) +
         fmt::format("Memory of one environment: {} bytes in f32, {} in f64.\n", bytes_per_environment(4),
                     bytes_per_environment(8));
}

}  // namespace lockstep
