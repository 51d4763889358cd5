// Batch: what the last step did with its rows and with the energy. SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "impl.h"
#include "model/tendons.h"
#include "spatial_tendons.h"

namespace lockstep {

namespace {

void require_recorded(bool recorded) {
  if (!recorded) throw UsageError("diagnostics", "are not kept by this plan", "set StepSettings::record_diagnostics");
}

}  // namespace

// Rows of positions or velocities, with tendons where their joints are.
template <class S, class Impl, class View>
auto with_tendons(const Impl& impl, const View& rows, bool of_positions) {
  typename Batch<S>::Array placed = rows;
  const TableStructure& t = impl.tables;
  const auto field = [&](Parameter parameter) -> const AlignedBlock<S>& { return impl.rows.field(parameter); };
  for (int i = 0; i < t.tendons.count; ++i) {
    const int c = t.tendons[i];
    auto tendon = placed.row(t.dof[t.term_joint[t.term_start[c]]]);
    if (!of_positions)
      tendon.setZero();
    else if (field(Parameter::offset).size() > 0)
      tendon = -impl.const_view(field(Parameter::offset)).row(c);
    else
      tendon.setConstant(-impl.tables.offset[c]);
    for (int k = t.term_start[c] + 1; k < t.term_start[c + 1]; ++k) {
      const auto other = placed.row(t.dof[t.term_joint[k]]);
      if (field(Parameter::gear_ratio).size() > 0)
        tendon -= impl.const_view(field(Parameter::gear_ratio)).row(t.term_gear[k]) * other;
      else
        tendon -= impl.tables.term_value[k] * other;
    }
  }
  const Program& program = program_of(impl.plan);
  if (!impl.tables.spatial.used()) return placed;
  const Trees trees(program.model);
  for (Eigen::Index e = 0; e < placed.cols(); ++e)
    each_spatial_tendon(program, trees, impl.state_pointers(), static_cast<int>(e),
                        [&](int joint, double length, const Eigen::RowVectorXd& jacobian, const LoopState& state) {
                          placed(t.dof[joint], e) =
                              static_cast<S>(of_positions ? length : jacobian.dot(state.velocity));
                        });
  return placed;
}

template <class S>
auto Batch<S>::limit_violations() const -> Array {
  const Model& model = impl().plan.model();
  const Array q = with_tendons<S>(impl(), positions(), true);
  Array worst = Array::Zero(1, environments());
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    const int dof = program_of(impl().plan).dof_of_joint[j];
    if (dof < 0 || has_slack_spring(model.joints[j])) continue;
    if (model.joints[j].kind == JointKind::ball) continue;  // below
    if (const AlignedBlock<S>& limits = impl().rows.field(Parameter::position_limits); limits.size() > 0) {
      const ConstView own = impl().const_view(limits);
      worst = worst.max((own.row(2 * dof) - q.row(dof)).max(q.row(dof) - own.row(2 * dof + 1)));
      continue;
    }
    const S lower = static_cast<S>(model.joints[j].lower), upper = static_cast<S>(model.joints[j].upper);
    worst = worst.max((lower - q.row(dof)).max(q.row(dof) - upper));
  }
  // The range of a ball is that of its angle.
  const TableStructure& t = impl().tables;
  for (int b = 0; b < t.balls.count; ++b) {
    const int dof = t.dof[t.balls[b].joint];
    const Array angle = q.middleRows(dof, 3).square().colwise().sum().sqrt();
    if (const AlignedBlock<S>& limits = impl().rows.field(Parameter::position_limits); limits.size() > 0)
      worst = worst.max(angle - impl().const_view(limits).row(2 * dof + 1));
    else
      worst = worst.max(angle - static_cast<S>(model.joints[model.joint_index(impl().plan.dof_names()[dof])].upper));
  }
  return worst;
}

template <class S>
auto Batch<S>::speeds() const -> Array {
  Array fastest = Array::Zero(1, environments());
  const Array v = with_tendons<S>(impl(), velocities(), false);
  for (Eigen::Index dof = 0; dof < impl().tables.joints; ++dof) fastest = fastest.max(v.row(dof).abs());
  return fastest;
}

template <class S>
auto Batch<S>::row_residuals() const -> Array {
  require_recorded(impl().tables.record_diagnostics);
  return impl().view(impl().rows.residual);
}

template <class S>
auto Batch<S>::row_states() const -> Array {
  require_recorded(impl().tables.record_diagnostics);
  return impl().view(impl().rows.row_state);
}

template <class S>
auto Batch<S>::energy_balances() const -> Array {
  require_recorded(impl().tables.record_diagnostics);
  return impl().view(impl().rows.energy);
}

// A row that was not met, and what stood in its way: rows that act on the same velocity, or the couplings that a
// redundant one follows from.
template <class S>
std::vector<std::string> Batch<S>::conflicts(int environment) const {
  require_recorded(impl().tables.record_diagnostics);
  impl().check_id(environment);
  const Program& program = program_of(impl().plan);
  const auto residual = impl().view(impl().rows.residual).col(environment);
  const auto state = impl().view(impl().rows.row_state).col(environment);
  std::vector<bool> named(program.row_names.size(), false);
  for (std::size_t r = 0; r < named.size(); ++r) {
    if (!(residual[static_cast<Eigen::Index>(r)] > rounding<S>)) continue;
    named[r] = true;
    const Reported& row = program.reported[r];
    for (std::size_t other = 0; other < named.size(); ++other)
      if (row.bounded >= 0 && program.reported[other].bounded == row.bounded &&
          std::abs(state[static_cast<Eigen::Index>(other)]) == S(1))
        named[other] = true;
    if (row.kind != Reported::coupling) continue;
    const auto redundant = std::find(program.redundant.begin(), program.redundant.end(), row.index);
    if (redundant == program.redundant.end()) continue;
    for (int c : program.follows_from[redundant - program.redundant.begin()]) named[c] = true;
  }
  std::vector<std::string> names;
  for (std::size_t r = 0; r < named.size(); ++r)
    if (named[r]) names.push_back(program.row_names[r]);
  return names;
}

template auto Batch<float>::limit_violations() const -> Array;
template auto Batch<double>::limit_violations() const -> Array;
template auto Batch<float>::speeds() const -> Array;
template auto Batch<double>::speeds() const -> Array;
template auto Batch<float>::row_residuals() const -> Array;
template auto Batch<double>::row_residuals() const -> Array;
template auto Batch<float>::row_states() const -> Array;
template auto Batch<double>::row_states() const -> Array;
template auto Batch<float>::energy_balances() const -> Array;
template auto Batch<double>::energy_balances() const -> Array;
template std::vector<std::string> Batch<float>::conflicts(int) const;
template std::vector<std::string> Batch<double>::conflicts(int) const;

}  // namespace lockstep
