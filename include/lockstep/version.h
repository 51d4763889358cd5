// The version of lockstep, as compiled in. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lockstep/export.h"

#define LOCKSTEP_VERSION_MAJOR 0
#define LOCKSTEP_VERSION_MINOR 2
#define LOCKSTEP_VERSION_PATCH 0

namespace lockstep {

/// "major.minor.patch" of the library that was linked.
LOCKSTEP_API const char* version() noexcept;

}  // namespace lockstep
