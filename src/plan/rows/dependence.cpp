// SPDX-License-Identifier: Apache-2.0
#include "dependence.h"

#include <Eigen/QR>

#include "plan/parts.h"

namespace lockstep {
namespace {

// Directions that share velocities with each other, and with no others.
bool depend_within(const std::vector<const std::map<int, double>*>& directions) {
  std::map<int, Eigen::Index> column;  // by velocity
  for (const auto* direction : directions)
    for (const auto& [velocity, number] : *direction) column.emplace(velocity, 0);
  Eigen::Index columns = 0;
  for (auto& [velocity, own] : column) own = columns++;
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(directions.size()), columns);
  if (rows.rows() > rows.cols()) return true;
  for (Eigen::Index r = 0; r < rows.rows(); ++r) {
    for (const auto& [velocity, number] : *directions[static_cast<std::size_t>(r)])
      rows(r, column.at(velocity)) = number;
    rows.row(r).normalize();
  }
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> factored(rows.transpose());
  factored.setThreshold(1e-9);
  return factored.rank() < rows.rows();
}

}  // namespace

bool depend(const std::vector<std::map<int, double>>& directions, int n) {
  Parts parts(n);
  for (const auto& direction : directions)
    for (const auto& [velocity, number] : direction) parts.join(direction.begin()->first, velocity);
  std::map<int, std::vector<const std::map<int, double>*>> together;  // by part
  for (const auto& direction : directions) {
    if (direction.empty()) return true;
    together[parts.of(direction.begin()->first)].push_back(&direction);
  }
  for (const auto& [part, own] : together)
    if (depend_within(own)) return true;
  return false;
}

}  // namespace lockstep
