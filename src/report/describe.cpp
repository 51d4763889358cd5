// A Plan in words. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <numbers>

#include "../plan/layout.h"
#include "lockstep/plan.h"

namespace lockstep {
namespace {

std::string counted(int count, const char* one, const char* many) {
  return fmt::format("{} {}", count, count == 1 ? one : many);
}

std::string listed(const std::vector<std::string>& names, std::size_t most = 8) {
  const std::size_t shown = std::min(names.size(), most);
  std::string text = fmt::format("{}", fmt::join(names.begin(), names.begin() + static_cast<std::ptrdiff_t>(shown), ", "));
  return names.size() > most ? fmt::format("{} and {} more", text, names.size() - most) : text;
}

std::string said(const Softness& softness) {
  switch (softness.kind) {
    case Softness::Kind::hard: return fmt::format("hard (erp {:g})", softness.first);
    case Softness::Kind::mixing: return fmt::format("erp {:g}, cfm {:g}", softness.first, softness.second);
    case Softness::Kind::spring: return fmt::format("kp {:g}, kd {:g}", softness.first, softness.second);
    case Softness::Kind::frequency:
      return fmt::format("{:g} rad/s ({:.3g} Hz), damping ratio {:g}", softness.first,
                         softness.first / (2.0 * std::numbers::pi), softness.second);
  }
  return "";
}

std::string said(const Coupling& coupling, const std::string& name) {
  std::string form = coupling.joint;
  for (const CouplingTerm& term : coupling.terms)
    form += fmt::format(" {} {:g} {}", term.ratio < 0 ? '-' : '+', std::abs(term.ratio), term.joint);
  if (coupling.offset != 0.0) form += fmt::format(" {} {:g}", coupling.offset < 0 ? '-' : '+', std::abs(coupling.offset));
  return fmt::format("{}: {} = 0, {}", name, form, said(coupling.softness));
}

std::string mechanism_line(const Program& program) {
  const Tables<double>& t = program.f64;
  std::string text = fmt::format("{}: {} base, {}, {}", program.model.name, t.floating ? "floating" : "fixed",
                                 counted(t.joints, "moving joint", "moving joints"),
                                 counted(t.couplings, "coupling", "couplings"));
  if (program.merged_links > 0)
    text += fmt::format("; {} fixed to others and merged", counted(program.merged_links, "link is", "links are"));
  return text + ".\n";
}

std::string coupling_lines(const Program& program) {
  const std::vector<std::string> names = coupling_names(program.model);
  std::string text;
  for (std::size_t c = 0; c < names.size(); ++c) {
    const int index = static_cast<int>(c);
    text += "  " + said(program.model.couplings[c], names[c]);
    if (is_redundant(program, index)) text += "; redundant: it follows from those above and takes no impulse of its own";
    if (is_absent(program, index)) text += "; absent: it has neither stiffness nor damping";
    text += '\n';
  }
  return text;
}

std::string method_lines(const Program& program) {
  const Tables<double>& t = program.f64;
  const StepSettings& s = program.settings;
  const int rows = t.rows.count;
  const std::string once_more = s.velocity_iterations > 0 ? "" : ", without the closing solve (velocity_iterations 0)";
  std::string text = fmt::format("Method: {} ({}), semi-implicit Euler, dt {:.6g} s ({:.4g} Hz).\n", name(program.method),
                                 program.method_reason, s.dt, 1.0 / s.dt);
  switch (program.method) {
    case Method::reduced:
      if (!program.eliminated.empty()) {
        std::vector<std::string> followers;
        for (int dof : program.eliminated) followers.push_back(program.dof_names[dof]);
        text += fmt::format("  eliminated: {}; {} of {} velocities are left to solve.\n", listed(followers), t.solver.n,
                            t.velocities);
      }
      if (rows > 0) text += fmt::format("  {} solved together by L^T D L{}.\n", counted(rows, "soft row is", "soft rows are"), once_more);
      break;
    case Method::direct:
      text += fmt::format("  {} solved together by L^T D L{}.\n", counted(rows, "row is", "rows are"), once_more);
      break;
    default:
      text += fmt::format("  {}, {} {}, then {}.\n", counted(rows, "row", "rows"), s.iterations,
                          program.method == Method::tgs ? "sub-steps of one sweep" : "sweeps",
                          counted(s.velocity_iterations, "velocity iteration", "velocity iterations"));
  }
  return text;
}

std::string stage_lines(const Program& program) {
  const Tables<double>& t = program.f64;
  std::vector<std::string> stages{"kinematics", "bias forces (Newton-Euler)", "mass matrix (composite bodies)", "joint terms"};
  if (t.couplings > 0) stages.push_back("coupling errors");
  if (t.reduction.followers > 0) stages.push_back("elimination");
  stages.push_back("free velocity (L^T D L)");
  if (t.natural.count > 0) stages.push_back("natural responses (a second factorisation, for softness by frequency)");
  if (t.rows.count > 0) stages.insert(stages.end(), {"responses", "row terms", name(t.rows.columns.n > 0 ? Method::direct : program.method)});
  stages.insert(stages.end(), {"integration", "check"});
  std::string text = fmt::format("Stages: {}.\n", fmt::join(stages, ", "));

  std::vector<std::string> absent;
  if (t.rows.count == 0) absent.push_back("solver rows");
  if (t.driven.count == 0) absent.push_back("drives");
  bool damped = false, rotors = false;
  for (int j = 0; j < t.joints; ++j) damped |= t.damping[j] != 0.0, rotors |= t.armature[j] != 0.0;
  if (!damped && !declared(program, Parameter::damping)) absent.push_back("damping");
  if (!rotors) absent.push_back("armature");
  for (int p = 0; p < parameter_count; ++p)
    if (!declared(program, static_cast<Parameter>(p))) absent.push_back(fmt::format("{} per environment", name(static_cast<Parameter>(p))));
  if (!absent.empty()) text += fmt::format("Left out, as the scene has none: {}.\n", fmt::join(absent, ", "));
  return text;
}

// What the model states and a step does not act on.
std::string not_enforced_line(const Program& program) {
  int positions = 0, velocities = 0, efforts = 0, frictions = 0;
  for (const Joint& joint : program.model.joints) {
    if (!joint.moves()) continue;
    positions += joint.lower > -infinity || joint.upper < infinity;
    velocities += joint.velocity_limit < infinity;
    efforts += joint.effort_limit < infinity;
    frictions += joint.friction > 0.0;
  }
  std::vector<std::string> stored;
  if (positions) stored.push_back(counted(positions, "position range", "position ranges"));
  if (velocities) stored.push_back(counted(velocities, "velocity limit", "velocity limits"));
  if (efforts) stored.push_back(counted(efforts, "effort limit", "effort limits"));
  if (frictions) stored.push_back(counted(frictions, "dry friction", "dry frictions"));
  return stored.empty() ? "" : fmt::format("Stored but not enforced by a step: {}.\n", fmt::join(stored, ", "));
}

}  // namespace

std::string Plan::describe() const {
  const Program& p = *program_;
  const long flops = flops_per_step();
  return mechanism_line(p) + coupling_lines(p) + method_lines(p) + stage_lines(p) + not_enforced_line(p) +
         fmt::format("Cost of a step of one environment: {} flops; {} bytes read and written in f32, {} in f64.\n", flops,
                     bytes_per_step(4), bytes_per_step(8));
}

}  // namespace lockstep
