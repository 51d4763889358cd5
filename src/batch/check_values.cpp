// Looks for values that no Model could have before a step, and normalises quaternions. SPDX-License-Identifier:
// Apache-2.0
#include "impl.h"

namespace lockstep {

// A pose has seven rows, the last four are the quaternion. Returns false where there may be one of length 0.
template <class S>
bool Batch<S>::Impl::normalise_roots(std::ptrdiff_t first, std::ptrdiff_t last) {
  constexpr S slack = sizeof(S) == 4 ? S(1e-5) : S(1e-12);  // far above what a step leaves
  bool all_unit = true;
  for (int pose = 0; pose < 7 * tables.roots.count; pose += 7) {
    S *const w = rows.root_pose.data() + (pose + 3) * stride, *const x = w + stride, *const y = x + stride,
             *const z = y + stride;
    const auto excess = [&](std::ptrdiff_t e) { return w[e] * w[e] + x[e] * x[e] + y[e] * y[e] + z[e] * z[e] - S(1); };
    if (all_within(first, last, -slack, slack, excess)) continue;
    all_unit = false;
    for (std::ptrdiff_t e = first; e < last; ++e) {
      if (std::abs(excess(e)) <= slack || rows.fault.data()[e] != Fault::none) continue;
      double length = 0.0;
      for (const S* part : {w, x, y, z}) length = std::hypot(length, static_cast<double>(part[e]));
      for (S* part : {w, x, y, z})
        if (length > 0.0 && std::isfinite(length)) part[e] = static_cast<S>(static_cast<double>(part[e]) / length);
    }
  }
  return all_unit;
}

template <class S>
bool Batch<S>::Impl::has_turn(std::ptrdiff_t e, int root) const {
  const S* const w = rows.root_pose.data() + (7 * root + 3) * stride + e;
  return w[0] != S(0) || w[stride] != S(0) || w[2 * stride] != S(0) || w[3 * stride] != S(0);
}

// Normalises quaternions, and flags environments [first, last) with values that cannot be.
template <class S>
void Batch<S>::Impl::check_values(std::ptrdiff_t first, std::ptrdiff_t last) {
  const auto flag_unless = [&](const auto& holds) {
    for (std::ptrdiff_t e = first; e < last; ++e)
      if (!holds(e) && rows.fault.data()[e] == Fault::none)
        rows.fault.data()[e] = Fault::bad_value, rows.place.data()[e] = {FaultStage::values, -1};
  };
  if (!normalise_roots(first, last))
    flag_unless([&](std::ptrdiff_t e) {
      for (int root = 0; root < tables.roots.count; ++root)
        if (!has_turn(e, root)) return false;
      return true;
    });
  for (const ValueRule<S>& rule : rules.rows) {
    const S* const values = rows.field(rule.field).data() + rule.row * stride;
    const bool hold =
        rule.field == Parameter::gear_ratio || rule.field == Parameter::drive_delay
            ? all_within(first, last, rule.least, rule.most, [&](std::ptrdiff_t e) { return rule.checked(values[e]); })
            : all_within(first, last, rule.least, rule.most, [&](std::ptrdiff_t e) { return values[e]; });
    if (!hold) flag_unless([&](std::ptrdiff_t e) { return rule.holds(values[e]); });
  }
  for (const LimitPair& pair : rules.pairs) {
    const S* const lower = rows.field(Parameter::position_limits).data() + pair.row * stride;
    flag_unless([&](std::ptrdiff_t e) { return lower[e] <= lower[stride + e]; });
  }
  for (const TurnRows& turn : rules.turns) {
    const S* const frames = rows.field(Parameter::loop_frame).data();
    flag_unless([&](std::ptrdiff_t e) { return turn.hold([&](int row) { return frames[row * stride + e]; }); });
  }
  for (const InertiaRule<S>& rule : rules.inertias) flag_unless([&](std::ptrdiff_t e) { return is_possible(rule, e); });
  for (const BodyLinks& body : rules.bodies) {
    const S* const one = rows.field(Parameter::mass).data() + body.links[0] * stride;
    constexpr S least = std::numeric_limits<S>::min(), most = std::numeric_limits<S>::max();
    if (!all_within(first, last, least, most, [&](std::ptrdiff_t e) { return one[e]; }))
      flag_unless([&](std::ptrdiff_t e) { return mass_of(body, e) > S(0); });
  }
}

template <class S>
S Batch<S>::Impl::mass_of(const BodyLinks& body, std::ptrdiff_t e) const {
  const AlignedBlock<S>& masses = rows.field(Parameter::mass);
  S sum = S(0);
  for (int link : body.links) sum += masses.data()[link * stride + e];
  return sum;
}

// Whether matter could have the inertia of the links that move together: see Model::validate().
template <class S>
bool Batch<S>::Impl::is_possible(const InertiaRule<S>& rule, std::ptrdiff_t e) const {
  const auto number = [&](Parameter parameter, std::ptrdiff_t row, double model) {
    const AlignedBlock<S>& block = rows.field(parameter);
    return block.size() > 0 ? static_cast<double>(block.data()[row * stride + e]) : model;
  };
  return rule.holds(number);
}

template bool Batch<float>::Impl::normalise_roots(std::ptrdiff_t, std::ptrdiff_t);
template bool Batch<float>::Impl::has_turn(std::ptrdiff_t, int) const;
template void Batch<float>::Impl::check_values(std::ptrdiff_t, std::ptrdiff_t);
template float Batch<float>::Impl::mass_of(const BodyLinks&, std::ptrdiff_t) const;
template bool Batch<float>::Impl::is_possible(const InertiaRule<float>&, std::ptrdiff_t) const;

template bool Batch<double>::Impl::normalise_roots(std::ptrdiff_t, std::ptrdiff_t);
template bool Batch<double>::Impl::has_turn(std::ptrdiff_t, int) const;
template void Batch<double>::Impl::check_values(std::ptrdiff_t, std::ptrdiff_t);
template double Batch<double>::Impl::mass_of(const BodyLinks&, std::ptrdiff_t) const;
template bool Batch<double>::Impl::is_possible(const InertiaRule<double>&, std::ptrdiff_t) const;

}  // namespace lockstep
