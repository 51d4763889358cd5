// SPDX-License-Identifier: Apache-2.0
#include "targets.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "state.h"
#include "tool.h"

namespace lockstep::tool {
namespace {

const Joint& joint_of(const Plan& plan, int dof) {
  const Model& model = plan.model();
  return model.joints[model.joint_index(plan.dof_names()[dof])];
}

}  // namespace

Targets::Targets(Table table, const Plan& plan) : table_(std::move(table)) {
  const auto time = std::find(table_.columns.begin(), table_.columns.end(), "time");
  if (time == table_.columns.end()) throw InputError(table_.file + ":1: has no column 'time'");
  if (table_.columns.size() == 1)
    throw InputError(table_.file + ":1: has times and no targets; add a column with the name of a joint");
  time_ = time - table_.columns.begin();

  std::vector<StateColumn> known = state_columns(plan);
  known.resize(2 * static_cast<std::size_t>(plan.dofs()));  // those of joints
  for (std::size_t c = 0; c < table_.columns.size(); ++c) {
    columns_.push_back({-1, false});
    if (c == time_) continue;
    const std::string where = fmt::format("{}:1:{}", table_.file, c + 1), &name = table_.columns[c];
    const auto found =
        std::find_if(known.begin(), known.end(), [&](const auto& column) { return column.name == name; });
    if (found == known.end())
      throw InputError(fmt::format("{}: model '{}' has no moving joint '{}'", where, plan.model().name, name));
    const Drive& drive = joint_of(plan, found->row).drive;
    if (!drive.kinematic && drive.kp == 0.0 && drive.kd == 0.0)
      throw InputError(
          fmt::format("{}: joint '{}' has no drive that could follow a target; give it one with --drive "
                      "or --kinematic",
                      where, plan.dof_names()[found->row]));
    columns_.back() = {found->row, found->kind == StateColumn::Kind::velocity};
  }
  for (std::size_t row = 1; row < table_.rows.size(); ++row)
    if (table_.rows[row][time_] < table_.rows[row - 1][time_])
      throw InputError(fmt::format("{}: the time decreases from {} to {}", table_.at(row, time_),
                                   table_.rows[row - 1][time_], table_.rows[row][time_]));
}

int Targets::row_at(long step_index, double dt) const {
  const double latest = static_cast<double>(step_index) * dt + dt / 1000.0;
  const auto after = std::upper_bound(table_.rows.begin(), table_.rows.end(), latest,
                                      [&](double time, const auto& row) { return time < row[time_]; });
  return static_cast<int>(after - table_.rows.begin()) - 1;
}

template <class S>
void Targets::apply(int row, Batch<S>& batch) const {
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    if (columns_[c].dof < 0) continue;
    const S target = static_cast<S>(table_.rows[row][c]);
    if (!std::isfinite(target))
      throw InputError(fmt::format("{}: {} is too large for this precision", table_.at(row, c), table_.rows[row][c]));
    auto targets = columns_[c].velocity ? batch.velocity_targets() : batch.position_targets();
    targets.row(columns_[c].dof).setConstant(target);
  }
}

template void Targets::apply(int, Batch<float>&) const;
template void Targets::apply(int, Batch<double>&) const;

}  // namespace lockstep::tool
