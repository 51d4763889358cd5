// Which of Softness' alternatives: what tables and kernels know of it. SPDX-License-Identifier: Apache-2.0
#pragma once

namespace lockstep {

/// In their order.
enum class SoftnessKind : int { hard, erp_cfm, spring, frequency };

}  // namespace lockstep
