// Four ways to say how soft a coupling is. SPDX-License-Identifier: Apache-2.0
#pragma once

namespace lockstep {

/// How strictly a coupling holds. However it is said, the solver makes one kind of row of it,
/// (M27) and (M28) of docs/mathematics.md: a share `erp` of the error that is corrected per step, and
/// a compliance `cfm` (constraint force mixing) that lets the row yield.
///
/// Angles in rad, lengths in m; the units of kp and kd follow from those of the coupling's first joint.
struct Softness {
  enum class Kind {
    hard,       ///< never yields; first = erp, the share of the error corrected per step, in [0, 2)
    mixing,     ///< first = erp in [0, 1], second = cfm >= 0; cfm = 0 is hard
    spring,     ///< first = kp >= 0, second = kd >= 0; both 0: the coupling is absent
    frequency,  ///< first = natural frequency mu >= 0 in rad/s, second = damping ratio zeta >= 0;
                ///< both refer to the inertia that the coupling itself feels, (26) and (27) of the note
  };

  static constexpr double default_erp = 0.2;

  Kind kind = Kind::hard;
  double first = default_erp;
  double second = 0.0;

  static constexpr Softness hard(double erp = default_erp) { return {Kind::hard, erp, 0.0}; }
  static constexpr Softness mixing(double erp, double cfm) { return {Kind::mixing, erp, cfm}; }
  static constexpr Softness spring(double kp, double kd) { return {Kind::spring, kp, kd}; }
  static constexpr Softness frequency(double mu_rad_per_s, double zeta) {
    return {Kind::frequency, mu_rad_per_s, zeta};
  }

  /// True where the coupling cannot yield, so that its followers can be eliminated.
  constexpr bool is_hard() const {
    return kind == Kind::hard || (kind == Kind::mixing && second == 0.0);
  }
};

}  // namespace lockstep
