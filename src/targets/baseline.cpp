// The instructions that every processor has: multiply-adds round twice. SPDX-License-Identifier: Apache-2.0
#include "called_stages.h"
#include "instantiate.h"
#include "reduced_matrix.h"

namespace lockstep {

const KernelSet<float> baseline_f32 = kernel_set<registers::baseline::f32>();
const KernelSet<double> baseline_f64 = kernel_set<registers::baseline::f64>();

LOCKSTEP_CALLED_STAGES(, registers::baseline::f32);
LOCKSTEP_CALLED_STAGES(, registers::baseline::f64);

std::size_t reduced_matrix_bytes(const Tables<float>& t) {
  kernels::Tile<registers::baseline::f32> x;
  return kernels::lay_out(t, nullptr, x);
}

void reduced_matrix(const Tables<float>& t, const float* q, const float* joint_inertia, float* packed, void* scratch) {
  using T = registers::baseline::f32;
  kernels::Tile<T> x;
  kernels::lay_out(t, scratch, x);
  kernels::uniform_masses(t, x);
  kernels::uniform_ratios(t, x);
  for (int j = 0; j < t.joints; ++j) x.state.q[j] = T(q[j]);
  kernels::kinematics(t, x);
  for (int j = 0; j < t.joints; ++j) x.dynamics.joint_inertia[j] = T(joint_inertia[j]);
  kernels::inertia_matrix(t, StatePointers<float>(), x);
  if (t.reduction.by_entries()) kernels::reduce_matrix(t, x);
  for (int e = 0; e < t.solver.entries; ++e) packed[e] = x.dynamics.reduced[e].lane(0);
}

}  // namespace lockstep
