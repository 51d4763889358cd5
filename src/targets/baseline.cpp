// The instructions that every processor has: multiply-adds round twice. SPDX-License-Identifier: Apache-2.0
#include "called_stages.h"
#include "instantiate.h"
#include "reduced_matrix.h"
#include "start_gaps.h"

namespace lockstep {

const KernelSet<float> baseline_f32 = kernel_set<registers::baseline::f32>();
const KernelSet<double> baseline_f64 = kernel_set<registers::baseline::f64>();

LOCKSTEP_CALLED_STAGES(, registers::baseline::f32);
LOCKSTEP_CALLED_STAGES(, registers::baseline::f64);

namespace {

// A tile in `scratch` with the model's masses and ratios, at positions q by joint.
kernels::Tile<registers::baseline::f32> tile_at(const Tables<float>& t, const float* q, void* scratch) {
  using T = registers::baseline::f32;
  kernels::Tile<T> x;
  kernels::lay_out(t, scratch, x);
  kernels::uniform_masses(t, x);
  kernels::uniform_ratios(t, x);
  for (int j = 0; j < t.joints; ++j) x.state.q[j] = T(q[j]);
  return x;
}

}  // namespace

std::size_t reduced_matrix_bytes(const Tables<float>& t) {
  kernels::Tile<registers::baseline::f32> x;
  return kernels::lay_out(t, nullptr, x);
}

void reduced_matrix(const Tables<float>& t, const float* q, const float* joint_inertia, float* packed, void* scratch) {
  using T = registers::baseline::f32;
  kernels::Tile<T> x = tile_at(t, q, scratch);
  kernels::kinematics(t, x);
  for (int j = 0; j < t.joints; ++j) x.dynamics.joint_inertia[j] = T(joint_inertia[j]);
  kernels::inertia_matrix(t, StatePointers<float>(), x);
  if (t.reduction.by_entries()) kernels::reduce_matrix(t, x);
  for (int e = 0; e < t.solver.entries; ++e) packed[e] = x.dynamics.reduced[e].lane(0);
}

void start_gaps(const Tables<float>& t, const float* q, const float* root_poses, float* gaps, void* scratch) {
  using T = registers::baseline::f32;
  kernels::Tile<T> x = tile_at(t, q, scratch);
  for (int i = 0; i < 7 * t.roots.count; ++i) x.state.pose[i] = T(root_poses[i]);
  for (int i = 0; i < t.velocities; ++i) x.state.v[i] = T(0);
  x.frozen = x.contacts.kept = x.contacts.known = T::none();
  kernels::load_colliders(t, StatePointers<float>(), x);
  kernels::kinematics(t, x);
  kernels::collide(t.midpoint ? *t.midpoint : t, x);
  for (int c = 0; c < t.contacts.contacts.count; ++c) gaps[c] = static_cast<float>(unlimited);
  for (int p = 0; p < t.contacts.pairs.count; ++p) {
    const TouchingPair<float>& pair = t.contacts.pairs[p];
    float& gap = gaps[pair.contact];
    for (int s = pair.slot; s < pair.slot + pair.slots; ++s)
      if (any(x.contacts.slot[s].live)) gap = kernels::smaller(T(gap), x.contacts.slot[s].gap).lane(0);
  }
}

}  // namespace lockstep
