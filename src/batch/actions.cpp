// Batch::set_actions(): actions become targets or efforts. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "impl.h"
#include "model/joint_motion.h"

namespace lockstep {
namespace {

constexpr double default_change = 0.05;                     // of the range
constexpr double default_turn = 0.5, default_slide = 0.05;  // rad, m: about the start of a joint without a range

struct ActionRange {
  double low, high;

  // Grows by `times` another range.
  void add(double times, const ActionRange& other) {
    const auto [least, most] = std::minmax({times * other.low, times * other.high});
    low += least, high += most;
  }
};

// A map whose numbers fit the plan.
class CheckedMap {
 public:
  CheckedMap(const ActionMap& map, const Plan& plan)
      : map_(map), plan_(plan), model_(fields_of(program_of(plan))), dofs_(dofs_of(map, plan)) {
    for (std::size_t i = 0; i < map.dofs.size(); ++i) check_dof(i);
    check_counts();
    if (!(map.alpha > 0.0 && map.alpha <= 1.0))
      throw UsageError("alpha of actions", fmt::format("is {}", map.alpha), "give a number above 0, up to 1");
    if (map.alpha < 1.0 && map.kind == ActionKind::position_change)
      throw UsageError("alpha of actions", "is no part of changes of position", "leave it at 1, or give positions");
    for (std::size_t i = 0; i < dofs_.size(); ++i) range(i);
  }

  const std::vector<int>& dofs() const { return dofs_; }

  // The position range of the model; of a follower, what those of its leaders leave of it.
  ActionRange positions(int dof) const {
    const ActionRange own = {model_.value(Parameter::position_limits, 2 * dof),
                             model_.value(Parameter::position_limits, 2 * dof + 1)};
    if (joint(dof).kind == JointKind::ball) {  // the first part has the range of the angle
      const double most = model_.value(Parameter::position_limits, 2 * (dof - part_of_ball(joint(dof))) + 1);
      return {-most, most};
    }
    const Following& following = plan_.following(dof);
    if (following.leaders.empty() || following.curved) return own;
    ActionRange led = {following.offset, following.offset};
    for (const Following::Leader& leader : following.leaders) led.add(leader.ratio, positions(leader.dof));
    const ActionRange both = {std::max(own.low, led.low), std::min(own.high, led.high)};
    return both.low <= both.high ? both : own;
  }

  // Of action i: what -1 and 1 stand for.
  ActionRange range(std::size_t i) const {
    const int dof = dofs_[i];
    if (map_.raw) return {-1.0, 1.0};
    if (map_.low.empty() && map_.scale.empty()) return default_range(dof);
    if (!map_.scale.empty()) {
      const double center = map_.center.empty() ? default_center(dof) : map_.center[i], scale = map_.scale[i];
      const ActionRange range = {center - scale, center + scale};
      if (!std::isfinite(range.low) || !std::isfinite(range.high))
        refuse(dof, fmt::format("have the center {} and the scale {}", center, scale), "give finite numbers");
      return range;
    }
    const ActionRange range = {map_.low[i], map_.high[i]};
    if (!std::isfinite(range.low) || !std::isfinite(range.high) || range.low > range.high)
      refuse(dof, fmt::format("have the range {} to {}", range.low, range.high), "give finite numbers, low <= high");
    return range;
  }

 private:
  static const std::vector<int>& dofs_of(const ActionMap& map, const Plan& plan) {
    if (map.kind < ActionKind::position || map.kind > ActionKind::effort)
      throw UsageError("kind of actions", "is none of the enumerators", "give one of ActionKind");
    if (!map.dofs.empty()) return map.dofs;
    return map.kind == ActionKind::effort ? plan.independent_dofs() : plan.driven_dofs();
  }

  [[noreturn]] void refuse(int dof, const std::string& rule, const std::string& remedy) const {
    throw UsageError("actions of joint '" + plan_.dof_names()[static_cast<std::size_t>(dof)] + "'", rule, remedy);
  }

  void check_dof(std::size_t i) const {
    const int dof = map_.dofs[i];
    if (dof < 0 || dof >= plan_.dofs())
      throw UsageError("dof " + std::to_string(dof), "is not part of the plan", "see Plan::dof()");
    if (std::find(map_.dofs.begin(), map_.dofs.begin() + static_cast<std::ptrdiff_t>(i), dof) !=
        map_.dofs.begin() + static_cast<std::ptrdiff_t>(i))
      refuse(dof, "are two", "give each dof once");
    const std::vector<int>& driven = plan_.driven_dofs();
    if (map_.kind != ActionKind::effort && std::find(driven.begin(), driven.end(), dof) == driven.end())
      refuse(dof, "have no drive to command", "give the joint a Drive, or see Plan::driven_dofs()");
  }

  void check_counts() const {
    const std::size_t count = dofs_.size();
    if (map_.raw && !(map_.low.empty() && map_.high.empty() && map_.scale.empty()))
      throw UsageError("range of actions", "is given beside ActionMap::raw, which has none", "give one of the two");
    if (!map_.scale.empty() && !map_.low.empty())
      throw UsageError("range of actions", "is given twice", "give low and high, or scale");
    if (!map_.center.empty() && map_.scale.empty())
      throw UsageError("center of actions", "has no scale", "give ActionMap::scale, too");
    if (map_.low.size() != map_.high.size() || (!map_.low.empty() && map_.low.size() != count))
      throw UsageError("range of actions",
                       fmt::format("has {} lower and {} upper ends", map_.low.size(), map_.high.size()),
                       fmt::format("give {} of each, or none", count));
    for (const auto& [name, numbers] : {std::pair("scale", &map_.scale), std::pair("center", &map_.center)})
      if (!numbers->empty() && numbers->size() != count)
        throw UsageError(std::string(name) + " of actions", fmt::format("has {} numbers", numbers->size()),
                         fmt::format("give {}, or none", count));
  }

  const Joint& joint(int dof) const {
    const Model& model = plan_.model();
    return model.joints[static_cast<std::size_t>(model.joint_index(plan_.dof_names()[static_cast<std::size_t>(dof)]))];
  }

  // Where the model starts. A tendon is where its joints are.
  double start(int dof) const {
    const Following& following = plan_.following(dof);
    if (joint(dof).kind != JointKind::tendon) return joint(dof).position;
    double sum = following.offset;
    for (const Following::Leader& leader : following.leaders) sum += leader.ratio * start(leader.dof);
    return sum;
  }

  double default_reach(int dof) const {
    if (joint(dof).kind != JointKind::tendon)
      return joint(dof).kind == JointKind::prismatic ? default_slide : default_turn;
    double sum = 0.0;
    for (const Following::Leader& leader : plan_.following(dof).leaders)
      sum += std::abs(leader.ratio) * default_reach(leader.dof);
    return sum;
  }

  double default_center(int dof) const { return map_.kind == ActionKind::position ? start(dof) : 0.0; }

  ActionRange default_range(int dof) const {
    const auto limit = [&](Parameter parameter, const char* name) {
      const double most = model_.value(parameter, dof);
      if (!std::isfinite(most))
        refuse(dof, fmt::format("have no range, as the model gives it no {}", name),
               "give ActionMap::low and high, or the model a limit");
      return ActionRange{-most, most};
    };
    if (map_.kind == ActionKind::velocity) return limit(Parameter::velocity_limit, "velocity limit");
    if (map_.kind == ActionKind::effort) return limit(Parameter::effort_limit, "effort limit");
    ActionRange range = positions(dof);
    if (!std::isfinite(range.low)) range.low = std::min(start(dof), range.high) - default_reach(dof);
    if (!std::isfinite(range.high)) range.high = std::max(start(dof), range.low) + default_reach(dof);
    if (map_.kind == ActionKind::position) return range;
    return {-default_change * (range.high - range.low), default_change * (range.high - range.low)};
  }

  const ActionMap& map_;
  const Plan& plan_;
  const Fields& model_;
  const std::vector<int>& dofs_;
};

}  // namespace

// The dofs that the actions are about. Throws where the map does not fit.
template <class S>
const std::vector<int>& Batch<S>::Impl::commanded(const ActionMap& map) const {
  return CheckedMap(map, plan).dofs();
}

template <class S>
void Batch<S>::Impl::set_actions(const StridedRows<const S>& actions, const ActionMap& map,
                                 const EnvironmentSet& which) {
  // The map, the rows and the environments, before anything is written.
  const CheckedMap checked(map, plan);
  const std::vector<int>& dofs = checked.dofs();
  if (!actions.data && !dofs.empty()) throw UsageError("actions", "are null", "give one row for each");
  which.check(environments);

  // An action that is NaN is a fault.
  const auto action = [&](std::size_t i, int e) {
    return actions.data[static_cast<std::ptrdiff_t>(i) * actions.row_stride + e * actions.environment_stride];
  };
  which.for_each(environments, [&](int e) {
    for (std::size_t i = 0; i < dofs.size() && rows.fault.data()[e] == Fault::none; ++i)
      if (std::isnan(action(i, e)))
        rows.fault.data()[e] = Fault::bad_input, rows.place.data()[e] = {FaultStage::values, dofs[i]};
  });

  // From -1 to 1 onto the range, for all times of a step.
  AlignedBlock<S>& inputs = map.kind == ActionKind::effort     ? rows.effort
                            : map.kind == ActionKind::velocity ? rows.velocity_target
                                                               : rows.position_target;
  const simd::StepMode mode;
  for (std::size_t i = 0; i < dofs.size(); ++i) {
    const ActionRange range = checked.range(i), positions = checked.positions(dofs[i]);
    const double middle = 0.5 * range.low + 0.5 * range.high, reach = 0.5 * range.high - 0.5 * range.low;
    const S lower = static_cast<S>(positions.low), upper = static_cast<S>(positions.high);
    for (int time = 0; time < tables.input_times; ++time) {
      S* const row = inputs.data() + (time * tables.joints + dofs[i]) * stride;
      which.for_each(environments, [&](int e) {
        if (rows.fault.data()[e] != Fault::none) return;
        const S given = map.raw ? action(i, e) : std::clamp(action(i, e), S(-1), S(1));
        const S value = static_cast<S>(middle + reach * static_cast<double>(given));
        if (map.kind == ActionKind::position_change)
          row[e] = std::clamp(row[e] + value, lower, upper);
        else
          row[e] = map.alpha < 1.0 ? row[e] + static_cast<S>(map.alpha) * (value - row[e]) : value;
      });
    }
  }
}

template <class S>
void Batch<S>::set_actions(const StridedRows<const S>& actions, const ActionMap& map, const EnvironmentSet& which) {
  const Alone alone(impl().in_use);
  impl().set_actions(actions, map, which);
}

template void Batch<float>::set_actions(const StridedRows<const float>&, const ActionMap&, const EnvironmentSet&);
template void Batch<double>::set_actions(const StridedRows<const double>&, const ActionMap&, const EnvironmentSet&);
template const std::vector<int>& Batch<float>::Impl::commanded(const ActionMap&) const;
template const std::vector<int>& Batch<double>::Impl::commanded(const ActionMap&) const;
template void Batch<float>::Impl::set_actions(const StridedRows<const float>&, const ActionMap&, const EnvironmentSet&);
template void Batch<double>::Impl::set_actions(const StridedRows<const double>&, const ActionMap&,
                                               const EnvironmentSet&);

}  // namespace lockstep
