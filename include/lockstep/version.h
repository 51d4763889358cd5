// The version of lockstep, as compiled in. SPDX-License-Identifier: Apache-2.0
#pragma once

#define LOCKSTEP_VERSION_MAJOR 0
#define LOCKSTEP_VERSION_MINOR 1
#define LOCKSTEP_VERSION_PATCH 0

namespace lockstep {

/// "major.minor.patch" of the library that was linked.
const char* version() noexcept;

}  // namespace lockstep
