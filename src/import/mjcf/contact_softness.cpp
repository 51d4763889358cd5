// solref and solimp of contacts as springs. SPDX-License-Identifier: Apache-2.0
#include "contact_softness.h"

#include <algorithm>
#include <cmath>

namespace lockstep::importer::mjcf {
namespace {

constexpr double least_impedance = 1e-4, least_share = 1e-15, least_friction = 1e-5;  // MuJoCo's
constexpr double own_compliance = 1e-3;                                               // (M104)

// MuJoCo's acceleration of the depth r at the impedance d is (1 - d) a_free - damping r' - stiffness d r.
struct Reference {
  double stiffness, damping;  // 1/s^2, 1/s
};

Reference reference_of(const Yielding& yielding, const SolverSettings& solver) {
  const double most = std::clamp(yielding.solimp[1], least_impedance, 1.0 - least_impedance);
  double first = yielding.solref[0], second = yielding.solref[1];
  if ((first > 0.0) != (second > 0.0)) first = Yielding().solref[0], second = Yielding().solref[1];
  if (first <= 0.0) return {-first / (most * most), -second / most};
  if (solver.is_safe) first = std::max(first, 2.0 * solver.time_step);
  return {1.0 / (most * most * first * first * second * second), 2.0 / (most * first)};
}

double impedance(const Yielding& yielding, double depth) {
  const auto& [least, most, width, middle, power] = yielding.solimp;
  const auto bounded = [](double share) { return std::clamp(share, least_impedance, 1.0 - least_impedance); };
  const double first = bounded(least), last = bounded(most), m = bounded(middle), p = std::max(1.0, power);
  if (first == last || width <= least_share) return 0.5 * (first + last);
  const double x = std::min(depth / width, 1.0);
  const double y = x <= m ? m * std::pow(x / m, p) : 1.0 - (1.0 - m) * std::pow((1.0 - x) / (1.0 - m), p);
  return first + y * (last - first);
}

// (M164): of a pyramid's edges together, in that of the normal.
double response_of_cone(const YieldingPoint& point, const SolverSettings& solver) {
  if (solver.is_elliptic || point.dimension == 1) return point.response;
  const double mu = std::max(point.friction, least_friction), edges = 2.0 * (point.dimension - 1);
  return point.response * 2.0 * mu * mu * (1.0 + mu * mu) / (edges * solver.friction_ratio);
}

}  // namespace

GeomYielding geom_yielding_of(const Element& geom) {
  return {yielding_of(geom, "solref", "solimp"), geom.number("solmix", 1.0), geom.whole("priority", 0),
          std::max(0.0, geom.number("margin", 0.0) - geom.number("gap", 0.0))};
}

Yielding mixed(const GeomYielding& a, const GeomYielding& b) {
  if (a.priority != b.priority) return a.priority > b.priority ? a.yielding : b.yielding;
  const bool counts = a.mix >= least_share, other_counts = b.mix >= least_share;
  const double share = counts && other_counts ? a.mix / (a.mix + b.mix) : counts == other_counts ? 0.5 : counts;
  const auto between = [&](double one, double other) { return std::lerp(other, one, share); };
  const bool are_times = a.yielding.solref[0] > 0.0 && b.yielding.solref[0] > 0.0;
  Yielding result;
  for (int i = 0; i < 2; ++i) {
    const double one = a.yielding.solref[i], other = b.yielding.solref[i];
    result.solref[i] = are_times ? between(one, other) : std::min(one, other);
  }
  for (int i = 0; i < 5; ++i) result.solimp[i] = between(a.yielding.solimp[i], b.yielding.solimp[i]);
  return result;
}

bool is_default(const Yielding& yielding) {
  const Yielding own;
  return std::equal(own.solref, own.solref + 2, yielding.solref) &&
         std::equal(own.solimp, own.solimp + 5, yielding.solimp);
}

Softness softness_of(const Yielding& yielding, const YieldingPoint& point, const SolverSettings& solver) {
  if (!(point.response > 0.0 && point.response < infinity)) return Hard{};
  const Reference reference = reference_of(yielding, solver);
  const double response = response_of_cone(point, solver);
  const auto force = [&](double depth) {
    const double d = impedance(yielding, depth);
    return reference.stiffness * d * d * depth / (response * (1.0 - d));
  };
  double sunk = std::max(yielding.solimp[2], 1.0), overlap = sunk;  // where the impedance has reached its end
  if (point.load < infinity) {
    double high = 1e-12;
    while (force(high) < point.load && high < 1e9) high *= 2.0;
    double low = 0.5 * high;
    for (int i = 0; i < 55; ++i) (force(0.5 * (low + high)) < point.load ? low : high) = 0.5 * (low + high);
    sunk = high, overlap = sunk - point.margin;
  }
  if (!(reference.stiffness > 0.0) || !(overlap > 0.0)) return Hard{};
  const double kp = force(sunk) / overlap, h = solver.time_step;
  const double kd = kp * reference.damping / (reference.stiffness * impedance(yielding, sunk));
  // lockstep's own contact yields by more (M104).
  if (1.0 / (h * (h * kp + kd)) < own_compliance * point.response) return Hard{};
  return Spring{kp, kd};
}

}  // namespace lockstep::importer::mjcf
