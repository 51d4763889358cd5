// Tables with the structure of a step whose solves take another time: half the step, or the whole step at a leapfrog's
// midpoint. SPDX-License-Identifier: Apache-2.0
//
// Only the numbers that depend on the time are made anew.
#include "layout.h"

namespace lockstep {
namespace {

// ErpCfm depends on the length of a step, so it becomes the same spring.
void keep_spring(Softness& softness, double dt) {
  const auto* stated = std::get_if<ErpCfm>(&softness);
  if (!stated || is_hard(softness)) return;
  const double erp = stated->erp, cfm = stated->cfm;
  softness = Spring{erp / (dt * dt * cfm), (1.0 - erp) / (dt * cfm)};  // (M29)
}

void keep_springs(Program& program) {
  const double dt = program.settings.dt;
  for (Coupling& coupling : program.model.couplings) keep_spring(coupling.softness, dt);
  for (Joint& joint : program.model.joints)
    keep_spring(joint.limit_softness, dt), keep_spring(joint.drive.softness, dt);
  for (Softness& softness : program.bound_softness) keep_spring(softness, dt);
  for (Loop& loop : program.model.loops) keep_spring(loop.softness, dt);
}

Span<RowSoftness<double>> softness_of(Program& program, const Rows<double>& rows) {
  std::vector<RowSoftness<double>> softness;
  for (int r = 0; r < rows.count; ++r)
    softness.push_back(rows.coupling[r] < 0 ? rows.softness[r]
                                            : row_softness(program, program.model.couplings[rows.coupling[r]].softness,
                                                           program.length, 1));
  return program.storage.keep(std::move(softness));
}

Span<double> scaled(Program& program, const Span<double>& numbers, double scale) {
  std::vector<double> result(numbers.data, numbers.data + numbers.count);
  for (double& number : result) number *= scale;
  return program.storage.keep(std::move(result));
}

std::shared_ptr<Program> copy_of(const Program& whole) {
  auto copy = std::make_shared<Program>(whole);
  copy->kernel_hash = {}, copy->compiled = {}, copy->identity = {};
  copy->half = copy->midpoint = nullptr;
  copy->f64.half = copy->f64.midpoint = nullptr;
  copy->stage_times.clear();
  return copy;
}

// What depends on the length of the step and on that of its solves.
void lay_out_lengths(Program& program, Integrator integrator) {
  Tables<double>& t = program.f64;
  const int input_times = t.input_times;
  const Span<int> limited_servos = t.limited_servos, row_servos = t.row_servos;
  lay_out_times(program, integrator);
  lay_out_joint_terms(program);
  lay_out_joint_bounds(program);
  t.input_times = input_times;
  t.limited_servos = limited_servos, t.row_servos = row_servos;
  t.rows.softness = softness_of(program, t.rows);
  t.undamped.softness = softness_of(program, t.undamped);
  std::vector<RowSoftness<double>> bounds;
  std::vector<double> soft_rate;
  for (const Softness& softness : program.bound_softness) {
    bounds.push_back(row_softness(program, softness, program.length, 1));
    soft_rate.push_back(row_softness(program, softness, program.settings.dt, 1).rate);
  }
  t.bounds.rows.softness = program.storage.keep(std::move(bounds));
  t.bounds.soft_rate = program.storage.keep(std::move(soft_rate));
  lay_out_loop_softness(program);
}

}  // namespace

std::shared_ptr<Program> half_step(const Program& whole) {
  const std::shared_ptr<Program> half = copy_of(whole);
  Tables<double>& t = half->f64;
  keep_springs(*half);
  half->settings.dt /= 2.0;
  lay_out_lengths(*half, Integrator::leapfrog);
  t.hard_rate = scaled(*half, t.hard_rate, 2.0);
  t.reduction.rate = scaled(*half, t.reduction.rate, 2.0);
  // (M125): spring and damper of a contact stay those of the whole step, so that a body at rest stays where it is.
  std::vector<TouchingPair<double>> pairs(t.contacts.pairs.data, t.contacts.pairs.data + t.contacts.pairs.count);
  for (TouchingPair<double>& pair : pairs) pair.cfm *= 2.0, pair.cfm_per_response *= 2.0;
  t.contacts.pairs = half->storage.keep(std::move(pairs));
  t.fast_above *= 2.0;
  narrow(*half);
  return half;
}

std::shared_ptr<Program> midpoint_solve(const Program& whole) {
  const std::shared_ptr<Program> solve = copy_of(whole);
  Tables<double>& t = solve->f64;
  lay_out_lengths(*solve, Integrator::euler);
  t.reduction.rate = scaled(*solve, t.reduction.rate, whole.length / solve->length);
  t.solves_midpoint = true;
  narrow(*solve);
  return solve;
}

}  // namespace lockstep
