// A Softness as a kind and two numbers, for tables and fields. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lockstep/softness.h"
#include "softness_kind.h"

namespace lockstep {

inline SoftnessKind kind_of(const Softness& softness) { return static_cast<SoftnessKind>(softness.index()); }

struct SoftnessNumbers {
  double first, second;  ///< erp and cfm (0 if hard), kp and kd, or frequency and damping ratio
};

inline SoftnessNumbers numbers_of(const Softness& softness) {
  struct Numbers {
    SoftnessNumbers operator()(const Hard& s) const { return {s.erp, 0.0}; }
    SoftnessNumbers operator()(const ErpCfm& s) const { return {s.erp, s.cfm}; }
    SoftnessNumbers operator()(const Spring& s) const { return {s.kp, s.kd}; }
    SoftnessNumbers operator()(const Frequency& s) const { return {s.rad_per_s, s.damping_ratio}; }
  };
  return std::visit(Numbers{}, softness);
}

/// The erp of a Hard or ErpCfm.
inline double erp_of(const Softness& softness) { return numbers_of(softness).first; }

/// Neither stiffness nor damping: the row does nothing.
inline bool is_absent(const Softness& softness) {
  if (const auto* spring = std::get_if<Spring>(&softness)) return spring->kp == 0.0 && spring->kd == 0.0;
  const auto* frequency = std::get_if<Frequency>(&softness);
  return frequency && frequency->rad_per_s == 0.0;
}

}  // namespace lockstep
