// What processors this process may use. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

namespace lockstep {

/// How many processors' time the control groups of this process grant it, the groups above them too; infinity where
/// none sets a quota. Reads cgroup v2 and v1 below `root`. Throws nothing but std::bad_alloc.
double processor_quota(const std::filesystem::path& root = "/");

/// Those that the process's affinity mask has, and no more than its quota rounded up. At least 1.
int usable_processors();

}  // namespace lockstep
