// The times of a step. SPDX-License-Identifier: Apache-2.0
#include "layout.h"

namespace lockstep {
namespace {

// Times at which a leapfrog from `begin` over `length` reads its inputs, as shares of the step.
void add_times(double begin, double length, std::vector<double>& times) {
  for (double share : {alexander_gamma, (1.0 + alexander_gamma) / 2.0, 1.0}) times.push_back(begin + length * share);
}

}  // namespace

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
