// SPDX-License-Identifier: Apache-2.0
#include "functions.h"

#include <cmath>

#include "couplings.h"

namespace lockstep::reference {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

FunctionValue value_of(const Polynomial& polynomial, double x) {
  FunctionValue f{0.0, 0.0, 0.0};
  for (std::size_t k = 0; k < polynomial.coefficients.size(); ++k) {
    const double c = polynomial.coefficients[k], n = static_cast<double>(k);
    f.value += c * std::pow(x, n);
    if (k >= 1) f.slope += c * n * std::pow(x, n - 1.0);
    if (k >= 2) f.bend += c * n * (n - 1.0) * std::pow(x, n - 2.0);
  }
  return f;
}

FunctionValue value_of(const Harmonic& h, double x) {
  const double amplitude = std::hypot(h.cosine, h.sine), phase = std::atan2(h.sine, h.cosine);
  return {h.mean + amplitude * std::cos(h.rate * x - phase), -amplitude * h.rate * std::sin(h.rate * x - phase),
          -amplitude * h.rate * h.rate * std::cos(h.rate * x - phase)};
}

// Between two points the second derivative is linear, and zero at both ends.
FunctionValue value_of(const CamTable& table, double x) {
  const auto n = static_cast<Eigen::Index>(table.leader.size());
  const Eigen::Map<const VectorXd> at(table.leader.data(), n), y(table.follower.data(), n);
  MatrixXd system = MatrixXd::Identity(n, n);
  VectorXd right = VectorXd::Zero(n);
  for (Eigen::Index i = 1; i + 1 < n; ++i) {
    const double before = at[i] - at[i - 1], after = at[i + 1] - at[i];
    system.row(i).segment<3>(i - 1) << before / 6.0, (before + after) / 3.0, after / 6.0;
    right[i] = (y[i + 1] - y[i]) / after - (y[i] - y[i - 1]) / before;
  }
  const VectorXd m = system.fullPivLu().solve(right);
  const auto inside = [&](Eigen::Index i, double p) {
    const double h = at[i + 1] - at[i], a = (at[i + 1] - p) / h, b = (p - at[i]) / h;
    return FunctionValue{
        a * y[i] + b * y[i + 1] + h * h / 6.0 * ((a * a * a - a) * m[i] + (b * b * b - b) * m[i + 1]),
        (y[i + 1] - y[i]) / h + h / 6.0 * ((1.0 - 3.0 * a * a) * m[i] + (3.0 * b * b - 1.0) * m[i + 1]),
        a * m[i] + b * m[i + 1]};
  };
  if (x < at[0]) {
    const FunctionValue end = inside(0, at[0]);
    return {end.value + end.slope * (x - at[0]), end.slope, 0.0};
  }
  for (Eigen::Index i = 0; i + 1 < n; ++i)
    if (x < at[i + 1]) return inside(i, x);
  const FunctionValue end = inside(n - 2, at[n - 1]);
  return {end.value + end.slope * (x - at[n - 1]), end.slope, 0.0};
}

}  // namespace

FunctionValue value_of(const Function& function, double x) {
  return std::visit([&](const auto& kind) { return value_of(kind, x); }, function);
}

std::vector<bool> curved(const Model& model) {
  std::vector<bool> result;
  for (const Coupling& coupling : model.couplings) result.push_back(coupling.function.has_value());
  for (std::size_t round = 0; round < result.size(); ++round)
    for (std::size_t c = 0; c < result.size(); ++c)
      for (std::size_t other = 0; other < result.size(); ++other)
        for (const CouplingTerm& term : model.couplings[c].terms)
          if (result[other] && term.joint == model.couplings[other].joint && is_hard(model.couplings[c].softness) &&
              model.couplings[c].force_limit == infinity)
            result[c] = true;
  return result;
}

State placed(const Mechanism& mechanism, State state) {
  const std::vector<Coupling>& all = mechanism.model().couplings;
  const std::vector<bool> is_curved = curved(mechanism.model());
  const Eigen::Index first_joint = mechanism.root_velocities();
  for (std::size_t round = 0; round < all.size(); ++round)  // a chain is placed link by link
    for (std::size_t c = 0; c < all.size(); ++c) {
      if (!is_curved[c]) continue;
      const int follower = mechanism.dof(all[c].joint);
      double q = -all[c].offset, v = 0.0;
      for (const CouplingTerm& term : all[c].terms) {
        const int leader = mechanism.dof(term.joint);
        const FunctionValue f = all[c].function ? value_of(*all[c].function, state.q[leader])
                                                : FunctionValue{-term.ratio * state.q[leader], -term.ratio, 0.0};
        q += f.value, v += f.slope * state.v[first_joint + leader];
      }
      state.q[follower] = q, state.v[first_joint + follower] = v;
    }
  return state;
}

VectorXd curved_acceleration(const Mechanism& mechanism, const State& state) {
  VectorXd acceleration = VectorXd::Zero(mechanism.velocities());
  const std::vector<Coupling>& all = mechanism.model().couplings;
  const Couplings couplings(mechanism, {}, state.q);
  const MatrixXd j = couplings.velocity_jacobian();
  std::vector<int> rows, followers;
  std::vector<double> bends;
  bool bent = false;
  for (std::size_t c = 0; c < all.size(); ++c) {
    if (!is_hard(all[c].softness) || all[c].force_limit < infinity || couplings.redundant[c]) continue;
    rows.push_back(static_cast<int>(c));
    followers.push_back(mechanism.root_velocities() + mechanism.dof(all[c].joint));
    bends.push_back(0.0);
    if (!all[c].function) continue;
    const int leader = mechanism.dof(all[c].terms[0].joint);
    const double v = state.v[mechanism.root_velocities() + leader];
    bends.back() = value_of(*all[c].function, state.q[leader]).bend * v * v;
    bent = true;
  }
  if (!bent) return acceleration;
  const MatrixXd j_f = j(rows, followers);
  acceleration(followers) =
      j_f.fullPivLu().solve(Eigen::Map<const VectorXd>(bends.data(), static_cast<Eigen::Index>(bends.size())));
  return acceleration;
}

}  // namespace lockstep::reference
