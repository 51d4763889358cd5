// A Batch of either precision, for Python. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pybind11/numpy.h>

#include <memory>
#include <variant>

#include "convert.h"

namespace lockstep::python {

/// Views point into the Batch, so it is never moved.
struct AnyBatch {
  std::variant<std::unique_ptr<Batch<float>>, std::unique_ptr<Batch<double>>> batch;
  int threads;  // as given

  template <class Use>
  decltype(auto) use(Use&& use) {
    return std::visit([&](auto& own) -> decltype(auto) { return use(*own); }, batch);
  }
};

std::unique_ptr<AnyBatch> make_batch(const Plan& plan, int environments, int threads, std::uint64_t seed,
                                     std::uint32_t first_id, const py::object& dtype, const std::string& target,
                                     const std::string& engine, int memory_domain);

/// The environments that None (all), a mask of bool or a sequence of ids stands for. Only bool is a mask. Throws
/// UsageError for ids outside the batch, and TypeError for other types.
std::vector<int> environments_of(const py::object& which, int environments);

/// From True (hard), False (none) or a name; throws UsageError for another one.
Couplings couplings_of(const py::object& project);

/// (environment, coupling, error, velocity error) of each.
py::list unmet_to_python(const Plan& plan, const std::vector<UnmetCoupling>& unmet);

/// What actions mean: see Batch.act(). Throws UsageError for an unknown kind.
ActionMap action_map_of(const std::string& kind, const py::object& low, const py::object& high, bool raw);

/// From names and lockstep.Query objects; those that ask for nothing are left out.
std::vector<Query> queries_of(const Plan& plan, const py::object& given);

void bind_control(py::class_<AnyBatch>& batch);
void bind_planning(py::class_<AnyBatch>& batch);
void bind_plan(py::module_& module);
void bind_ranks(py::module_& module);
void bind_step_draws(py::module_& module);
void bind_import(py::module_& module);
void bind_view(py::module_& module);

/// From {"position_limits": True | ["joint", ...] | "followers", ...}, or the names of bounds that all joints leave
/// out.
Ignored ignored_of(const py::object& given);

void bind_batch(py::module_& module);

}  // namespace lockstep::python
