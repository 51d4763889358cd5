// Joints and couplings as linear forms over the solver's velocities. SPDX-License-Identifier: Apache-2.0
#include "plan/layout.h"

namespace lockstep {

Forms::Forms(const Program& program, const Reduction<double>& reduction)
    : program_(program),
      reduction_(reduction),
      solver_(program.f64.velocities, -1),
      measured_(reduction.measured_coupling.count > 0 ? program.f64.couplings : 0, -1) {
  const int n = reduction.used() ? reduction.independent.count : program.f64.velocities;
  for (int z = 0; z < n; ++z) solver_[reduction.velocity_of(z)] = z;
  for (int f = 0; f < reduction.measured_coupling.count; ++f) measured_[reduction.measured_coupling[f]] = f;
}

void Forms::add_joint(int joint, int term, RowForm& form) const {
  const Tables<double>& t = program_.f64;
  form.tree = t.body[t.joint_body[joint]].tree;
  if (const int z = solver_of(t.velocity_of(joint)); z >= 0) form.terms[z].push_back({term, -1});
  const int f = reduction_.used() ? reduction_.follower_of[joint] : -1;
  for (int s = f < 0 ? 0 : reduction_.start[f]; f >= 0 && s < reduction_.start[f + 1]; ++s)
    form.terms[reduction_.column[s]].push_back({term, s});
}

RowForm Forms::of_joint(int joint) const {
  RowForm form{-1, {}, {}};
  add_joint(joint, -1, form);
  return form;
}

RowForm Forms::of_coupling(int coupling) const {
  const Tables<double>& t = program_.f64;
  RowForm form{coupling, program_.model.couplings[coupling].softness};
  if (const int f = measured_.empty() ? -1 : measured_[coupling]; f >= 0) {
    form.terms[reduction_.constraint_velocity[f]] = {{-1, -1}};
    form.tree = t.body[t.joint_body[reduction_.follower[f]]].tree;
    return form;
  }
  for (int k = t.term_start[coupling]; k < t.term_start[coupling + 1]; ++k) add_joint(t.term_joint[k], k, form);
  return form;
}

}  // namespace lockstep
