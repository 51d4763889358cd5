// The C interface: actions of any kind, rollouts, matrices in independent coordinates. SPDX-License-Identifier:
// Apache-2.0
#include "border.h"

namespace lockstep::c {
namespace {

std::vector<double> list_of(const double* numbers, int64_t count) {
  return numbers ? std::vector<double>(numbers, numbers + count) : std::vector<double>();
}

ActionMap map_of(const lockstep_action_map* map) {
  const lockstep_action_map from = known(map, lockstep_action_map_init, "action map");
  require_bits(from.reserved, 0, "reserved member of the action map");
  if (from.count < 0) throw UsageError("count", "is negative", "give the number of actions");
  const bool has_lists = from.dofs || from.low || from.high || from.scale || from.center;
  if (from.count > 0 && !has_lists)
    throw UsageError("count", "is above 0 without a list", "give dofs, low and high or scale, or 0");
  if (from.count == 0 && has_lists)
    throw UsageError("count", "is 0 beside a list", "give the number of actions, or no list");
  ActionMap to;
  to.kind = numbered("kind of actions", from.kind, ActionKind::effort);
  if (from.dofs) to.dofs.assign(from.dofs, from.dofs + from.count);
  to.low = list_of(from.low, from.count), to.high = list_of(from.high, from.count);
  to.scale = list_of(from.scale, from.count), to.center = list_of(from.center, from.count);
  to.alpha = from.alpha, to.raw = truth(from.raw, "raw");
  return to;
}

template <class S>
int64_t actions_of(const Batch<S>& batch, const ActionMap& map) {
  if (!map.dofs.empty()) return static_cast<int64_t>(map.dofs.size());
  const Plan& plan = batch.plan();
  return static_cast<int64_t>((map.kind == ActionKind::effort ? plan.independent_dofs() : plan.driven_dofs()).size());
}

template <class S>
StridedSteps<S> steps_of(const lockstep_records* given_steps, const int64_t (&shape)[3], const char* name) {
  const lockstep_records& steps = *given(given_steps, name);
  constexpr int64_t item = sizeof(S);
  if (steps.type != type_of<std::remove_const_t<S>>)
    throw UsageError(name, "has another type than the batch", "give the batch's precision");
  for (int k = 0; k < 3; ++k)
    if (steps.shape[k] != shape[k])
      throw UsageError(name,
                       "has the shape " + std::to_string(steps.shape[0]) + " x " + std::to_string(steps.shape[1]) +
                           " x " + std::to_string(steps.shape[2]),
                       "give " + std::to_string(shape[0]) + " rollouts x " + std::to_string(shape[1]) + " steps x " +
                           std::to_string(shape[2]));
  bool aligned = reinterpret_cast<std::uintptr_t>(steps.data) % item == 0;
  for (const int64_t stride : steps.stride) aligned = aligned && stride % item == 0;
  if (!aligned) throw UsageError(name, "has data or strides that are no multiples of its numbers", "align the numbers");
  return {static_cast<S*>(given(steps.data, name)), steps.stride[0] / item, steps.stride[1] / item,
          steps.stride[2] / item};
}

// Rows of a result to memory of the caller.
template <class S>
void put(const typename Batch<S>::Array& rows, const lockstep_array* out) {
  const StridedRows<S> to = rows_of<S>(out, rows.rows(), rows.cols(), "out");
  for (Eigen::Index row = 0; row < rows.rows(); ++row)
    for (Eigen::Index e = 0; e < rows.cols(); ++e)
      to.data[row * to.row_stride + e * to.environment_stride] = rows(row, e);
}

}  // namespace
}  // namespace lockstep::c

using namespace lockstep;
using namespace lockstep::c;

void lockstep_action_map_init(lockstep_action_map* map) {
  if (map)
    *map = {
        sizeof(lockstep_action_map), LOCKSTEP_ACT_POSITION, nullptr, nullptr, nullptr, nullptr, nullptr, 0, 1.0, 0, 0};
}
int lockstep_act_as(lockstep_batch* batch, const lockstep_action_map* map, const lockstep_array* actions,
                    const uint8_t* mask, int64_t n) {
  return guarded([&] {
    const ActionMap to = map_of(map);
    batches().at(batch, "batch").use([&]<class S>(Batch<S>& own) {
      own.set_actions(rows_of<const S>(actions, actions_of(own, to), own.environments(), "actions"), to,
                      environments(mask, n));
    });
  });
}

int lockstep_mass_matrix(lockstep_batch* batch, const uint8_t* mask, int64_t length, const lockstep_array* out) {
  return guarded([&] {
    batches().at(batch, "batch").use([&]<class S>(Batch<S>& own) {
      put<S>(own.mass_matrices(environments(mask, length)), out);
    });
  });
}
int lockstep_bias_forces(lockstep_batch* batch, const uint8_t* mask, int64_t length, const lockstep_array* out) {
  return guarded([&] {
    batches().at(batch, "batch").use([&]<class S>(Batch<S>& own) {
      put<S>(own.bias_forces(environments(mask, length)), out);
    });
  });
}
int lockstep_jacobian(lockstep_batch* batch, int list, int64_t index, const uint8_t* mask, int64_t length,
                      const lockstep_array* out) {
  return guarded([&] {
    if (list != LOCKSTEP_LINKS && list != LOCKSTEP_SITES)
      throw UsageError("list " + std::to_string(list), "is neither links nor sites",
                       "give LOCKSTEP_LINKS or LOCKSTEP_SITES");
    const int frame = index >= 0 && index <= INT32_MAX ? static_cast<int>(index) : -1;
    batches().at(batch, "batch").use([&]<class S>(Batch<S>& own) {
      const EnvironmentSet which = environments(mask, length);
      put<S>(
          list == LOCKSTEP_LINKS ? own.reduced_link_jacobians(frame, which) : own.reduced_site_jacobians(frame, which),
          out);
    });
  });
}

void lockstep_rollout_options_init(lockstep_rollout_options* options) {
  if (options) *options = {sizeof(lockstep_rollout_options), 1, nullptr};
}
int lockstep_rollout(lockstep_batch* batch, const void* from, uint64_t bytes, const lockstep_rollout_options* options,
                     const lockstep_records* controls, const lockstep_query* queries, int64_t count,
                     const lockstep_records* out, uint32_t* faults) {
  return guarded([&] {
    const lockstep_rollout_options chosen = known(options, lockstep_rollout_options_init, "rollout options");
    RolloutOptions to;
    to.substeps = chosen.substeps, to.map = map_of(chosen.map);
    const int64_t all = given(controls, "controls")->shape[0], steps = controls->shape[1];
    if (all < 1 || all > INT32_MAX || steps < 1 || steps > INT32_MAX)
      throw UsageError("controls",
                       "are of " + std::to_string(all) + " rollouts and " + std::to_string(steps) + " steps",
                       "give 1 or more of each");
    to.rollouts = static_cast<int>(all), to.steps = static_cast<int>(steps);
    const std::vector<Query> record = queries_of(queries, count);
    const std::span<const std::byte> blob(static_cast<const std::byte*>(bytes > 0 ? given(from, "from") : nullptr),
                                          bytes);
    batches().at(batch, "batch").use([&]<class S>(Batch<S>& own) {
      int64_t rows = 0;
      for (const Query& query : record) rows += own.plan().query_rows(query);
      const StridedSteps<const S> inputs =
          steps_of<const S>(controls, {all, steps, actions_of(own, to.map)}, "controls");
      const StridedSteps<S> results = rows > 0 ? steps_of<S>(out, {all, steps, rows}, "out") : StridedSteps<S>{};
      const std::vector<Fault> ended = own.rollout(blob, inputs, record, results, to);
      for (std::size_t i = 0; faults && i < ended.size(); ++i) faults[i] = static_cast<uint32_t>(ended[i]);
    });
  });
}
