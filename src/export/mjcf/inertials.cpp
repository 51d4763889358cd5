// Principal axes, and the least change that MuJoCo asks for. SPDX-License-Identifier: Apache-2.0
#include "inertials.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <set>

#include "model/inertia.h"

namespace lockstep::exporter::mjcf {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double least_taken = 1e-15;  // kg and kg m^2, MuJoCo's mjMINVAL
constexpr double least_given = 1e-14;
constexpr double rounding = 1e-12;  // of the largest moment

bool keep_triangle(const Vector3d& m) {
  return m[0] + m[1] >= m[2] && m[1] + m[2] >= m[0] && m[2] + m[0] >= m[1] && m.minCoeff() >= 0.0;
}

// MuJoCo allows no rounding: a plate's largest moment must not exceed the sum of the others. `moments` ascend.
Vector3d rounded(Vector3d moments) {
  const double tolerance = rounding * moments[2];
  if (moments[0] < 0.0 && moments[0] > -tolerance) moments[0] = 0.0;
  const double excess = triangle_excess(moments);
  if (excess > 0.0 && excess <= tolerance) moments[2] = moments[0] + moments[1];
  return moments;
}

Inertial inertial_of(const Inertia& inertia) {
  const Matrix3d tensor = 0.5 * (inertia.about_center + inertia.about_center.transpose());
  Inertial result{inertia.mass, inertia.center, tensor.diagonal()};
  if (tensor == Matrix3d(result.moments.asDiagonal()) && keep_triangle(result.moments)) return result;
  const Eigen::SelfAdjointEigenSolver<Matrix3d> principal(tensor);
  Matrix3d axes = principal.eigenvectors();
  if (axes.determinant() < 0.0) axes.col(0) = -axes.col(0);
  result.moments = rounded(principal.eigenvalues());
  result.axes = Eigen::Quaterniond(axes).normalized();
  return result;
}

bool is_taken(const Inertial& inertial, bool moves) {
  return keep_triangle(inertial.moments) &&
         (!moves || (inertial.mass >= least_taken && inertial.moments.minCoeff() >= least_taken));
}

Inertial taken(Inertial inertial, bool moves, const std::string& link, Report& report) {
  if (is_taken(inertial, moves)) return inertial;
  if (!keep_triangle(inertial.moments)) {  // these ascend
    inertial.moments = rounded(nearest_possible(inertial.moments));
    report.warn("inertias that MuJoCo refuses, changed to the nearest that it takes", link);
  }
  if (is_taken(inertial, moves)) return inertial;
  inertial.mass = std::max(inertial.mass, least_given);
  inertial.moments = inertial.moments.cwiseMax(least_given);
  report.warn(fmt::format("moving bodies that MuJoCo finds too light, given at least {:g} kg and {:g} kg m^2",
                          least_given, least_given),
              link);
  return inertial;
}

// Of links that become one body: what makes it weigh as much as they do.
double mean_gravity(const Model& model, const std::vector<std::size_t>& links, Report& report) {
  std::set<double> shares;
  double mass = 0.0, weight = 0.0;
  for (const std::size_t i : links) {
    const Link& link = model.links[i];
    if (link.inertia.mass > 0.0) shares.insert(link.gravity);
    mass += link.inertia.mass, weight += link.gravity * link.inertia.mass;
  }
  if (shares.size() <= 1) return shares.empty() ? 1.0 : *shares.begin();
  report.warn("shares of gravity of links that become one body, which gets their mean",
              model.links[links.front()].name);
  return weight / mass;
}

}  // namespace

std::vector<Inertial> inertials(const Model& model, const Trees& trees, const std::vector<bool>& folded,
                                Report& report) {
  std::vector<Inertial> result;
  for (const Link& link : model.links) {
    result.push_back(inertial_of(link.inertia));
    result.back().gravity = link.gravity;
  }
  const std::vector<Inertia> bodies = rigid_bodies(model, trees);
  for (std::size_t c = 0; c < bodies.size(); ++c) {
    const auto carrier = static_cast<int>(c);
    if (trees.carrier[c] != carrier || folded[c]) continue;
    const bool moves = !trees.is_bolted(carrier);
    bool are_taken = true;
    std::vector<std::size_t> members;
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      if (trees.carrier[i] != carrier) continue;
      members.push_back(i);
      are_taken = are_taken && is_taken(result[i], moves && i == c);
    }
    if (are_taken) continue;
    for (const std::size_t i : members) {
      if (!moves) {
        result[i] = taken(result[i], false, model.links[i].name, report);
        continue;
      }
      if (i != c && !result[i].is_none())
        report.remark("inertias of fixed links, added to the link that carries them", model.links[i].name);
      result[i] = i == c ? taken(inertial_of(bodies[c]), true, model.links[c].name, report) : Inertial();
    }
    if (moves) result[c].gravity = mean_gravity(model, members, report);
  }
  return result;
}

}  // namespace lockstep::exporter::mjcf
