// Chooses the kernels that this machine runs. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernel_set.h"
#include "lockstep/batch.h"

namespace lockstep {

/// The target that `wanted` stands for here: automatic takes LOCKSTEP_TARGET, else the best one of the machine.
/// Throws SettingsError if the machine cannot run the target, or if the variable has an unknown name.
Target resolve(Target wanted);

template <class S>
const KernelSet<S>& kernels_for(Target target);

/// The kernels of one target.
struct TargetKernels {
  Target target;
  const char* name;
  bool (*runs_here)();
  const KernelSet<float>& f32;
  const KernelSet<double>& f64;
};

/// Adds a target that automatic never takes. Tests add their scalar twins this way, before they use any target. Not
/// thread-safe.
void add_target(const TargetKernels& kernels);

}  // namespace lockstep
