// Which kernels this machine runs. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernel_set.h"
#include "lockstep/batch.h"

namespace lockstep {

/// The target that `wanted` stands for here: automatic looks at LOCKSTEP_TARGET, then at the machine.
/// Throws SettingsError for one that the machine cannot run, or an unknown name in the variable.
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

/// Adds a target that the library is not built with, and that automatic never takes. Tests add their scalar twins so,
/// before they use any. Not thread-safe.
void add_target(const TargetKernels& kernels);

}  // namespace lockstep
