// Batch::rollout(): sequences of controls from saved states. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "impl.h"

namespace lockstep {
namespace {

template <class S>
StridedRows<S> step_rows(const StridedSteps<S>& numbers, std::ptrdiff_t rollout, std::ptrdiff_t step) {
  return {numbers.data + rollout * numbers.rollout_stride + step * numbers.step_stride, numbers.row_stride,
          numbers.rollout_stride};
}

template <class S>
void require_finite(const StridedSteps<const S>& controls, int rollouts, int steps, int columns) {
  for (int i = 0; i < rollouts; ++i)
    for (int t = 0; t < steps; ++t)
      for (int k = 0; k < columns; ++k)
        if (const S number = *(step_rows(controls, i, t).data + k * controls.row_stride); !std::isfinite(number))
          throw UsageError("actions", fmt::format("are {} in column {} of step {} of rollout {}", number, k, t, i),
                           "give finite numbers");
}

template <class Number>
Extent extent_of(const StridedSteps<Number>& of, const RolloutOptions& options, int rows) {
  return Extent(of.data,
                {{options.rollouts, of.rollout_stride}, {options.steps, of.step_stride}, {rows, of.row_stride}});
}

// Whether both stand side by side in one array, of rollouts and steps in any order.
template <class S>
bool are_side_by_side(const StridedSteps<const S>& controls, int columns, const StridedSteps<S>& out, int rows,
                      const RolloutOptions& options) {
  std::ptrdiff_t smaller = 0, larger = 0;  // strides
  const auto are_alike = [&](int count, std::ptrdiff_t own, std::ptrdiff_t other) {
    if (count == 1) return true;
    smaller = smaller == 0 ? own : std::min(smaller, own), larger = std::max(larger, own);
    return own == other && own > 0;
  };
  if (!are_alike(options.rollouts, controls.rollout_stride, out.rollout_stride) ||
      !are_alike(options.steps, controls.step_stride, out.step_stride) || controls.row_stride != 1 ||
      out.row_stride != 1 || smaller == 0 || larger % smaller != 0)
    return false;
  const std::ptrdiff_t between = out.data - controls.data;
  return between > 0 ? between >= columns && between + rows <= smaller
                     : -between >= rows && columns - between <= smaller;
}

void require_positive(int number, const char* element) {
  if (number < 1) throw UsageError(element, fmt::format("is {}", number), "give 1 or more");
}

}  // namespace

template <class S>
std::vector<Fault> Batch<S>::rollout(std::span<const std::byte> start, const StridedSteps<const S>& controls,
                                     std::span<const Query> record, const StridedSteps<S>& out,
                                     const RolloutOptions& options) {
  Impl& batch = impl();
  const Alone alone(batch.in_use);
  const int all = options.rollouts;

  // Everything is looked at before anything is written.
  require_positive(all, "number of rollouts");
  require_positive(options.steps, "number of steps");
  require_positive(options.substeps, "number of substeps");
  const int columns = static_cast<int>(batch.commanded(options.map).size());
  int rows = 0;
  for (const Query& query : record) rows += batch.plan.query_rows(query);
  if (rows > 0 && !out.data)
    throw UsageError("memory of the queries", "is null", fmt::format("give {} rows of each step", rows));
  if (columns > 0 && !controls.data)
    throw UsageError("actions", "are null", fmt::format("give {} of each step", columns));
  const Extent read = extent_of(controls, options, columns), written = extent_of(out, options, rows);
  batch.require_foreign(read, "actions");
  batch.require_foreign(written, "memory of the queries");
  if (read.overlaps(written) && !are_side_by_side(controls, columns, out, rows, options))
    throw UsageError("memory of the queries", "overlaps that of the actions, which are read later",
                     "give memory of its own");
  require_finite(controls, all, options.steps, columns);
  const Blob blob = start.empty() ? Blob{} : read_blob(start);
  const int saved = start.empty() ? batch.environments : static_cast<int>(blob.head.environments);
  if (saved != all && (start.empty() || saved != 1))
    throw UsageError(start.empty() ? "batch" : "blob", fmt::format("has {} environments for {} rollouts", saved, all),
                     start.empty() ? "give a blob to start from, or as many rollouts"
                                   : "save one environment, or one for each rollout");

  std::vector<Fault> faults(static_cast<std::size_t>(all));
  std::vector<int> places(static_cast<std::size_t>(std::min(all, batch.environments))), from(places.size());
  std::iota(places.begin(), places.end(), 0);
  for (int first = 0; first < all; first += batch.environments) {
    const int count = std::min(batch.environments, all - first);
    const std::span<const int> taken(places.data(), static_cast<std::size_t>(count));
    if (!start.empty()) {
      for (const int place : taken) from[static_cast<std::size_t>(place)] = saved == 1 ? 0 : first + place;
      batch.restore(blob, taken, std::span(from).first(taken.size()), false);
    }
    for (int t = 0; t < options.steps; ++t) {
      batch.set_actions(step_rows(controls, first, t), options.map, taken);
      batch.step(options.substeps, count);
      batch.read(record, step_rows(out, first, t), count);
    }
    std::copy_n(batch.rows.fault.data(), count, faults.begin() + first);
  }
  return faults;
}

template std::vector<Fault> Batch<float>::rollout(std::span<const std::byte>, const StridedSteps<const float>&,
                                                  std::span<const Query>, const StridedSteps<float>&,
                                                  const RolloutOptions&);
template std::vector<Fault> Batch<double>::rollout(std::span<const std::byte>, const StridedSteps<const double>&,
                                                   std::span<const Query>, const StridedSteps<double>&,
                                                   const RolloutOptions&);

}  // namespace lockstep
