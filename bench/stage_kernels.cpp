// SPDX-License-Identifier: Apache-2.0
#include "stage_kernels.h"

#include "simd/floating_point_mode.h"
#include "stages.h"

namespace lockstep::bench {
namespace {

// A wide type of this file, so that its kernels are instantiated here and the linker does not take the library's.
struct Timed : simd::Fused {};
using Wide = simd::Wide<float, StageKernels::lanes, Timed>;

}  // namespace

std::size_t StageKernels::scratch_bytes(const Tables<float>& t) {
  kernels::Tile<Wide> x;
  return kernels::lay_out(t, nullptr, x);
}

void StageKernels::run(const Tables<float>& t, const StatePointers<float>& start, const StatePointers<float>& batch,
                       void* scratch, int stages, long repeats) {
  const simd::StepMode mode;
  kernels::Tile<Wide> x;
  kernels::lay_out(t, scratch, x);
  kernels::uniform_masses(t, x);
  kernels::uniform_ratios(t, x);
  for (long r = 0; r < repeats; ++r) {
    const auto restore = [&](float* to, const float* from, int rows) {
      for (int i = 0; i < rows; ++i) store(to + i * batch.stride, Wide::load(from + i * start.stride));
    };
    restore(batch.position, start.position, t.joints);
    restore(batch.velocity, start.velocity, t.joints);
    const int roots = t.roots.count;
    if (roots > 0)
      restore(batch.root_pose, start.root_pose, 7 * roots),
          restore(batch.root_velocity, start.root_velocity, 6 * roots);
    Stages<Wide>::run(t, batch, x, stages);
  }
}

}  // namespace lockstep::bench
