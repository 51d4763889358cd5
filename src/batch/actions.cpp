// Batch::set_actions(): actions become targets or efforts. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "impl.h"

namespace lockstep {
namespace {

constexpr double default_change = 0.05;  // of the range

struct ActionRange {
  double low, high;
};

// The model's; of a tendon, what the ranges of its joints leave of it.
ActionRange position_range(const Program& program, const Fields& model, int dof) {
  ActionRange range = {model.value(Parameter::position_limits, 2 * dof),
                       model.value(Parameter::position_limits, 2 * dof + 1)};
  const Tables<double>& t = program.f64;
  for (int i = 0; i < t.tendons.count; ++i) {
    const int c = t.tendons[i], first = t.term_start[c];
    if (t.dof[t.term_joint[first]] != dof) continue;
    ActionRange sum = {-t.offset[c], -t.offset[c]};
    for (int k = first + 1; k < t.term_start[c + 1]; ++k) {
      const ActionRange joint = position_range(program, model, t.dof[t.term_joint[k]]);
      const auto [low, high] = std::minmax({-t.term_value[k] * joint.low, -t.term_value[k] * joint.high});
      sum.low += low, sum.high += high;
    }
    range = {std::max(range.low, sum.low), std::min(range.high, sum.high)};
  }
  return range;
}

ActionRange default_range(ActionKind kind, const Program& program, const Fields& model, int dof) {
  const auto [lower, upper] = position_range(program, model, dof);
  switch (kind) {
    case ActionKind::position: return {lower, upper};
    case ActionKind::position_change: return {-default_change * (upper - lower), default_change * (upper - lower)};
    case ActionKind::velocity: {
      const double limit = model.value(Parameter::velocity_limit, dof);
      return {-limit, limit};
    }
    case ActionKind::effort: break;
  }
  const double limit = model.value(Parameter::effort_limit, dof);
  return {-limit, limit};
}

const char* limit_of(ActionKind kind) {
  switch (kind) {
    case ActionKind::position:
    case ActionKind::position_change: return "position range";
    case ActionKind::velocity: return "velocity limit";
    case ActionKind::effort: break;
  }
  return "effort limit";
}

// The range of action i, which moves this dof.
ActionRange range_of(const ActionMap& map, const Plan& plan, const Fields& model, std::size_t i, int dof) {
  const std::string& joint = plan.dof_names()[static_cast<std::size_t>(dof)];
  if (map.low.empty()) {
    const ActionRange range = default_range(map.kind, program_of(plan), model, dof);
    if (!std::isfinite(range.high - range.low))
      throw UsageError("actions of joint '" + joint + "'",
                       fmt::format("have no range, as the model gives it no {}", limit_of(map.kind)),
                       "give ActionMap::low and high, or the model a limit");
    return range;
  }
  const ActionRange range = {map.low[i], map.high[i]};
  if (!std::isfinite(range.low) || !std::isfinite(range.high) || range.low > range.high)
    throw UsageError("actions of joint '" + joint + "'", fmt::format("have the range {} to {}", range.low, range.high),
                     "give finite numbers, low <= high");
  return range;
}

}  // namespace

template <class S>
void Batch<S>::set_actions(const StridedRows<const S>& actions, const ActionMap& map, const EnvironmentSet& which) {
  Impl& batch = impl();
  const Alone alone(batch.in_use);
  const Plan& plan = batch.plan;

  // The map, the rows and the environments, before anything is written.
  if (map.kind < ActionKind::position || map.kind > ActionKind::effort)
    throw UsageError("kind of actions", "is none of the enumerators", "give one of ActionKind");
  const std::vector<int>& dofs = map.kind == ActionKind::effort ? plan.independent_dofs() : plan.driven_dofs();
  for (const std::vector<double>* bounds : {&map.low, &map.high})
    if (bounds->size() != (map.low.empty() && map.high.empty() ? 0 : dofs.size()))
      throw UsageError("range of actions",
                       fmt::format("has {} lower and {} upper ends", map.low.size(), map.high.size()),
                       fmt::format("give {} of each, or none", dofs.size()));
  const Fields& model = fields_of(program_of(plan));
  for (std::size_t i = 0; i < dofs.size(); ++i) range_of(map, plan, model, i, dofs[i]);
  if (!actions.data && !dofs.empty()) throw UsageError("actions", "are null", "give one row for each");
  which.check(batch.environments);

  // An action that is NaN is a fault.
  const auto action = [&](std::size_t i, int e) {
    return actions.data[static_cast<std::ptrdiff_t>(i) * actions.row_stride + e * actions.environment_stride];
  };
  which.for_each(batch.environments, [&](int e) {
    for (std::size_t i = 0; i < dofs.size() && batch.rows.fault.data()[e] == Fault::none; ++i)
      if (std::isnan(action(i, e)))
        batch.rows.fault.data()[e] = Fault::bad_input, batch.rows.place.data()[e] = {FaultStage::values, dofs[i]};
  });

  // From -1 to 1 onto the range, for all times of a step.
  AlignedBlock<S>& inputs = map.kind == ActionKind::effort     ? batch.rows.effort
                            : map.kind == ActionKind::velocity ? batch.rows.velocity_target
                                                               : batch.rows.position_target;
  const simd::StepMode mode;
  for (std::size_t i = 0; i < dofs.size(); ++i) {
    const ActionRange range = range_of(map, plan, model, i, dofs[i]);
    const double middle = 0.5 * range.low + 0.5 * range.high, reach = 0.5 * range.high - 0.5 * range.low;
    const ActionRange positions = position_range(program_of(plan), model, dofs[i]);
    const S lower = static_cast<S>(positions.low), upper = static_cast<S>(positions.high);
    for (int time = 0; time < batch.tables.input_times; ++time) {
      S* const row = inputs.data() + (time * batch.tables.joints + dofs[i]) * batch.stride;
      which.for_each(batch.environments, [&](int e) {
        if (batch.rows.fault.data()[e] != Fault::none) return;
        const S value = static_cast<S>(middle + reach * static_cast<double>(std::clamp(action(i, e), S(-1), S(1))));
        row[e] = map.kind == ActionKind::position_change ? std::clamp(row[e] + value, lower, upper) : value;
      });
    }
  }
}

template void Batch<float>::set_actions(const StridedRows<const float>&, const ActionMap&, const EnvironmentSet&);
template void Batch<double>::set_actions(const StridedRows<const double>&, const ActionMap&, const EnvironmentSet&);

}  // namespace lockstep
