// The times of a step, and whether an integrator applies to a scene. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "layout.h"

namespace lockstep {
namespace {

constexpr double explicit_bound = 2.5;          // (M75)
constexpr double most_extrapolated_erp = 1.75;  // (M71)

// Times at which a leapfrog from `begin` over `length` reads its inputs, as shares of the step.
void add_times(double begin, double length, std::vector<double>& times) {
  for (double share : {alexander_gamma, (1.0 + alexander_gamma) / 2.0, 1.0}) times.push_back(begin + length * share);
}

}  // namespace

std::optional<Obstacle> obstacle_of(const Program& program) {
  if (program.integrator == Integrator::euler) return std::nullopt;
  const Tables<double>& t = program.f64;
  const StepSettings& s = program.settings;
  if (program.method != Method::reduced && program.method != Method::direct)
    return Obstacle{
        fmt::format("{} uses sweeps, which leave an error of their own in every stage", to_string(program.method)),
        "use the method reduced or direct"};
  const bool bounded = t.bounds.rows.count > 0 || t.limited_servos.count > 0 || t.row_servos.count > 0;
  const bool touches = !program.contacts.pairs.empty(), leapfrog = program.integrator == Integrator::leapfrog;
  if (touches && !leapfrog) return Obstacle{"contacts may begin and end within a step", "use leapfrog or euler"};
  if (bounded || touches) {
    if (!leapfrog)
      return Obstacle{"the scene has bounds, which may become active within a step",
                      "use leapfrog or euler, or leave out the bounds by StepSettings::ignore"};
    if (s.velocity_iterations == 0)
      return Obstacle{"velocity_iterations is 0, so corrections of positions would stay in the velocities", "give 1"};
  }
  if (s.record_impulses || s.record_diagnostics)
    return Obstacle{"a step of several stages has no single impulse or balance to record",
                    "use euler, or record nothing"};
  bool hard = false, depends_on_step = false;
  for (const Coupling& coupling : program.model.couplings) {
    const Softness& softness = coupling.softness;
    hard |= is_hard(softness);
    depends_on_step |= kind_of(softness) == SoftnessKind::hard || kind_of(softness) == SoftnessKind::erp_cfm;
    if (program.integrator == Integrator::extrapolated && is_hard(softness) && erp_of(softness) > most_extrapolated_erp)
      return Obstacle{fmt::format("coupling '{}' has an erp of {}, and above {} the extrapolation makes its error grow",
                                  coupling.joint, erp_of(softness), most_extrapolated_erp),
                      "lower the erp"};
  }
  if (hard && s.velocity_iterations == 0 && program.integrator != Integrator::runge_kutta)
    return Obstacle{"velocity_iterations is 0, so corrections of positions would stay in the velocities", "give 1"};
  if (declared(program, Parameter::softness) && depends_on_step)
    return Obstacle{
        "softness differs per environment and is given by erp and cfm, which mean a different spring for each "
        "length of a stage",
        "give it as a spring or by frequency"};
  if (program.integrator != Integrator::runge_kutta) return std::nullopt;
  if (t.rows.count > 0)
    return Obstacle{"some couplings are soft, switched or not eliminated, which takes an implicit step",
                    "use leapfrog or extrapolated, or the method reduced with hard couplings"};
  const double rate = program.explicit_rate, reach = rate * s.dt;
  if (!(reach <= explicit_bound))
    return Obstacle{
        fmt::format(
            "drives, springs and damping cause rates of up to {:.3g} 1/s at the model's start; times dt = {:.4g} s "
            "that is {:.3g}, above {}",
            rate, s.dt, reach, explicit_bound),
        fmt::format("use leapfrog or extrapolated, or a dt of at most {:.3g} s", explicit_bound / rate)};
  return std::nullopt;
}

void lay_out_times(Program& program, Integrator integrator) {
  const double dt = program.settings.dt;
  program.integrator = integrator;
  program.length = dt;
  switch (integrator) {
    case Integrator::leapfrog:
    case Integrator::extrapolated:
      program.length = alexander_gamma * dt;
      add_times(0.0, 1.0, program.stage_times);
      break;
    case Integrator::runge_kutta: program.stage_times = {0.0, 0.5, 1.0}; break;
    default: program.stage_times = {1.0};
  }
  if (integrator == Integrator::extrapolated)
    for (double begin : {0.0, 0.5}) add_times(begin, 0.5, program.stage_times);
  Tables<double>& t = program.f64;
  t.integrator = integrator;
  t.step = dt;
  t.dt = program.length;
  t.ahead = integrator == Integrator::runge_kutta ? 0.0 : program.length;
  t.input_times = program.settings.stage_inputs ? static_cast<int>(program.stage_times.size()) : 1;
}

}  // namespace lockstep
