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

}  // namespace lockstep
