// The tables of half the step. SPDX-License-Identifier: Apache-2.0
//
// They have the structure of the whole step. Only the numbers that depend on its length are made anew.
#include "layout.h"

namespace lockstep {
namespace {

// ErpCfm depends on the length of a step, so it becomes the same spring.
void keep_springs(Model& model, double dt) {
  for (Coupling& coupling : model.couplings) {
    const auto* stated = std::get_if<ErpCfm>(&coupling.softness);
    if (!stated || is_hard(coupling.softness)) continue;
    const double erp = stated->erp, cfm = stated->cfm;
    coupling.softness = Spring{erp / (dt * dt * cfm), (1.0 - erp) / (dt * cfm)};  // (M29)
  }
}

Span<RowSoftness<double>> softness_of(Program& program, const Rows<double>& rows) {
  std::vector<RowSoftness<double>> softness;
  for (int r = 0; r < rows.count; ++r)
    softness.push_back(row_softness(program, program.model.couplings[rows.coupling[r]].softness, program.length, 1));
  return program.storage.keep(std::move(softness));
}

}  // namespace

std::shared_ptr<Program> half_step(const Program& whole) {
  auto half = std::make_shared<Program>(whole);
  Tables<double>& t = half->f64;
  half->kernel_hash = {}, half->interpreted = {}, half->identity = {}, half->half = nullptr;
  t.half = nullptr;
  keep_springs(half->model, half->settings.dt);
  half->settings.dt /= 2.0;
  half->stage_times.clear();
  lay_out_times(*half, Integrator::leapfrog);
  lay_out_joint_terms(*half);
  lay_out_joint_bounds(*half);
  t.rows.softness = softness_of(*half, t.rows);
  t.undamped.softness = softness_of(*half, t.undamped);
  for (Span<double>* rates : {&t.hard_rate, &t.reduction.rate}) {
    std::vector<double> doubled(rates->data, rates->data + rates->count);
    for (double& rate : doubled) rate *= 2.0;
    *rates = half->storage.keep(std::move(doubled));
  }
  t.fast_above *= 2.0;
  narrow(*half);
  return half;
}

}  // namespace lockstep
