// The alternatives of Softness, for tables and kernels. SPDX-License-Identifier: Apache-2.0
#pragma once

namespace lockstep {

/// In the order of the variant.
enum class SoftnessKind : int { hard, erp_cfm, spring, frequency };

}  // namespace lockstep
