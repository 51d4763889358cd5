// Four ways to state how soft a coupling or a limit is. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <variant>

namespace lockstep {

// Each is turned into one kind of constraint row, (M27) and (M28) of docs/mathematics.md: a share `erp` of the position
// error that is corrected per step, and a compliance `cfm` that lets the row yield. Angles are in rad, lengths in m;
// the units of kp and kd follow from those of the coupling's first joint.

/// Never yields. Followers of hard couplings can be eliminated.
struct Hard {
  double erp = 0.2;  ///< share of the position error that is corrected per step, in [0, 2)
};

/// Error reduction parameter and constraint force mixing, as in ODE and Bullet. It is another spring at every step
/// size.
struct ErpCfm {
  double erp = 0.2;  ///< in [0, 1]
  double cfm = 0.0;  ///< >= 0; 0 is hard
};

/// An implicit spring and damper.
struct Spring {
  double kp = 0.0;  ///< stiffness, >= 0
  double kd = 0.0;  ///< damping, >= 0; with both 0 the coupling is absent
};

/// The spring with this frequency and damping at the inertia that the coupling itself moves: (M28).
struct Frequency {
  double rad_per_s = 0.0;      ///< natural frequency, >= 0
  double damping_ratio = 1.0;  ///< >= 0; 1 is critical
};

using Softness = std::variant<Hard, ErpCfm, Spring, Frequency>;

/// True where the coupling cannot yield: Hard, or an ErpCfm whose cfm is 0.
inline bool is_hard(const Softness& softness) {
  if (const auto* mixed = std::get_if<ErpCfm>(&softness)) return mixed->cfm == 0.0;
  return std::holds_alternative<Hard>(softness);
}

}  // namespace lockstep
