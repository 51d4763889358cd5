// Rollouts, linearisation, inverse kinematics and matrices in independent coordinates for Python.
// SPDX-License-Identifier: Apache-2.0
#include <pybind11/stl.h>

#include <algorithm>
#include <limits>
#include <optional>

#include "batch.h"

namespace lockstep::python {
namespace {

using namespace pybind11::literals;

// An array of the batch's precision as it stands in memory of the caller.
template <class S>
py::array_t<S> given_array(const py::object& given, const char* name, bool writable) {
  if (!py::array_t<S>::check_(given) || !py::cast<bool>(given.attr("flags").attr("aligned")) ||
      (writable && !py::cast<py::array>(given).writeable()))
    throw py::type_error(std::string(name) + " must be " + (writable ? "a writable, aligned" : "an aligned") +
                         " array of " + text_of(py::dtype::of<S>()));
  return py::reinterpret_borrow<py::array_t<S>>(given);
}

void require_shape(const py::array& array, const char* name, std::initializer_list<py::ssize_t> shape) {
  if (std::equal(shape.begin(), shape.end(), array.shape(), array.shape() + array.ndim())) return;
  std::string wanted;
  for (const py::ssize_t size : shape) wanted += (wanted.empty() ? "" : ", ") + std::to_string(size);
  throw UsageError(name, "has the shape " + text_of(array.attr("shape")), "give [" + wanted + "]");
}

template <class S, class Number>
StridedSteps<Number> steps_of(Number* data, const py::array& array) {
  constexpr py::ssize_t item = sizeof(S);
  return {data, array.strides(0) / item, array.strides(1) / item, array.strides(2) / item};
}

py::tuple rollout(AnyBatch& any, const py::object& start, const py::object& controls, const py::object& record,
                  int substeps, const std::string& kind, bool raw, const py::object& low, const py::object& high,
                  const py::object& out) {
  return any.use([&]<class S>(Batch<S>& batch) -> py::tuple {
    RolloutOptions options;
    options.substeps = substeps;
    options.map = action_map_of(kind, low, high, raw);
    const std::vector<Query> queries = queries_of(batch.plan(), record);
    const py::ssize_t columns =
        static_cast<py::ssize_t>(options.map.kind == ActionKind::effort ? batch.plan().independent_dofs().size()
                                                                        : batch.plan().driven_dofs().size());
    const py::array_t<S> from = py::isinstance<py::array>(controls) ? given_array<S>(controls, "controls", false)
                                                                    : array_of<S>(controls, "controls");
    if (from.ndim() != 3)
      throw UsageError("actions", "have the shape " + text_of(from.attr("shape")),
                       "give [rollouts, steps, " + std::to_string(columns) + "]");
    require_shape(from, "actions", {from.shape(0), from.shape(1), columns});
    if (std::max(from.shape(0), from.shape(1)) > std::numeric_limits<int>::max())
      throw UsageError("actions", "have the shape " + text_of(from.attr("shape")), "give fewer than 2^31 of each");
    options.rollouts = static_cast<int>(from.shape(0)), options.steps = static_cast<int>(from.shape(1));
    py::ssize_t rows = 0;
    for (const Query& query : queries) rows += batch.plan().query_rows(query);
    py::array_t<S> to =
        out.is_none() ? py::array_t<S>({from.shape(0), from.shape(1), rows}) : given_array<S>(out, "out", true);
    require_shape(to, "out", {from.shape(0), from.shape(1), rows});

    // Bytes, environments of the batch, or all as they stand.
    std::vector<std::byte> saved;
    std::span<const std::byte> blob;
    if (py::isinstance<py::bytes>(start)) {
      const std::string_view bytes = start.cast<std::string_view>();
      blob = {reinterpret_cast<const std::byte*>(bytes.data()), bytes.size()};
      if (blob.empty()) throw UsageError("blob", "is empty", "give what Batch.save() returned");
    } else if (!start.is_none()) {
      saved = batch.save(environments_of(start, batch.environments()));
      blob = saved;
    }
    const auto controls_at = steps_of<S>(from.data(), from);
    const auto out_at = steps_of<S>(to.mutable_data(), to);
    std::vector<Fault> faults;
    {
      const py::gil_scoped_release release;
      faults = batch.rollout(blob, controls_at, queries, out_at, options);
    }
    py::array_t<std::int32_t> numbers(static_cast<py::ssize_t>(faults.size()));
    for (std::size_t i = 0; i < faults.size(); ++i)
      numbers.mutable_at(static_cast<py::ssize_t>(i)) = static_cast<std::int32_t>(faults[i]);
    return py::make_tuple(to, numbers);
  });
}

py::array_t<double> stacked(const std::vector<Linearization>& all, Eigen::MatrixXd Linearization::*part) {
  const Eigen::Index rows = all.empty() ? 0 : (all[0].*part).rows(), columns = all.empty() ? 0 : (all[0].*part).cols();
  py::array_t<double> array(
      {static_cast<py::ssize_t>(all.size()), static_cast<py::ssize_t>(rows), static_cast<py::ssize_t>(columns)});
  double* to = array.mutable_data();
  for (const Linearization& one : all)
    for (Eigen::Index r = 0; r < rows; ++r)
      for (Eigen::Index c = 0; c < columns; ++c) *to++ = (one.*part)(r, c);
  return array;
}

py::dict linearize(AnyBatch& any, const py::object& which, const std::string& inputs, int substeps,
                   const py::object& parameters, const py::object& record, double step) {
  return any.use([&](auto& batch) {
    LinearizeOptions options;
    options.inputs = action_map_of(inputs, py::none(), py::none(), false).kind;
    options.substeps = substeps, options.step = step;
    options.record = queries_of(batch.plan(), record);
    for (const py::handle& given : parameters) {
      const auto [name, row] = value_of<std::pair<std::string, std::string>>(given, "parameters");
      const Parameter field = parameter_of(name);
      const std::vector<std::string>& rows = batch.plan().parameter_row_names(field);
      const auto found = std::find(rows.begin(), rows.end(), row);
      if (found == rows.end())
        throw UsageError("field " + name, "has no row '" + row + "'", "see Plan.parameter_rows()");
      options.parameters.push_back({field, static_cast<int>(found - rows.begin())});
    }
    const std::vector<int> ids = environments_of(which, batch.environments());
    std::vector<Linearization> all;
    {
      const py::gil_scoped_release release;
      all = batch.linearize(ids, options);
    }
    py::array_t<std::int32_t> faults(static_cast<py::ssize_t>(all.size()));
    for (std::size_t i = 0; i < all.size(); ++i)
      faults.mutable_at(static_cast<py::ssize_t>(i)) = static_cast<std::int32_t>(all[i].fault);
    return py::dict("A"_a = stacked(all, &Linearization::state_by_state),
                    "B"_a = stacked(all, &Linearization::state_by_input),
                    "P"_a = stacked(all, &Linearization::state_by_parameter),
                    "record_A"_a = stacked(all, &Linearization::record_by_state),
                    "record_B"_a = stacked(all, &Linearization::record_by_input),
                    "record_P"_a = stacked(all, &Linearization::record_by_parameter), "fault"_a = faults);
  });
}

py::array inverse_kinematics(AnyBatch& any, const std::string& site, const py::object& targets, const py::object& which,
                             int iterations, double tolerance) {
  return any.use([&]<class S>(Batch<S>& batch) -> py::array {
    const py::array_t<S> given = array_of<S>(targets, "targets");
    if (given.ndim() != 2 || given.shape(0) != batch.environments() || (given.shape(1) != 3 && given.shape(1) != 7))
      throw UsageError("targets", "have the shape " + text_of(given.attr("shape")),
                       "give [" + std::to_string(batch.environments()) + ", 3 or 7]");
    typename Batch<S>::Array columns(given.shape(1), given.shape(0));
    for (py::ssize_t e = 0; e < given.shape(0); ++e)
      for (py::ssize_t k = 0; k < given.shape(1); ++k) columns(k, e) = given.at(e, k);
    const int index = batch.plan().site(site);
    const std::vector<int> ids = environments_of(which, batch.environments());
    typename Batch<S>::Array left;
    {
      const py::gil_scoped_release release;
      left = batch.inverse_kinematics(index, columns, ids, {iterations, tolerance});
    }
    py::array_t<S> result({left.cols(), left.rows()});
    for (Eigen::Index e = 0; e < left.cols(); ++e)
      for (Eigen::Index k = 0; k < left.rows(); ++k) result.mutable_at(e, k) = left(k, e);
    return result;
  });
}

// [rows][environments] as [environments, ...].
template <class S>
py::array_t<S> by_environment(const typename Batch<S>::Array& rows, std::vector<py::ssize_t> shape) {
  shape.insert(shape.begin(), static_cast<py::ssize_t>(rows.cols()));
  py::array_t<S> array(shape);
  S* to = array.mutable_data();
  for (Eigen::Index e = 0; e < rows.cols(); ++e)
    for (Eigen::Index k = 0; k < rows.rows(); ++k) *to++ = rows(k, e);
  return array;
}

py::ssize_t coordinates_of(const Plan& plan) {
  return static_cast<py::ssize_t>(6 * plan.root_names().size() + open_coordinate_dofs(plan).size());
}

py::array mass_matrix(AnyBatch& any, const py::object& which) {
  return any.use([&]<class S>(Batch<S>& batch) -> py::array {
    const std::vector<int> ids = environments_of(which, batch.environments());
    typename Batch<S>::Array rows;
    {
      const py::gil_scoped_release release;
      rows = batch.mass_matrices(ids);
    }
    const py::ssize_t n = coordinates_of(batch.plan());
    return by_environment<S>(rows, {n, n});
  });
}

py::array bias_forces(AnyBatch& any, const py::object& which) {
  return any.use([&]<class S>(Batch<S>& batch) -> py::array {
    const std::vector<int> ids = environments_of(which, batch.environments());
    typename Batch<S>::Array rows;
    {
      const py::gil_scoped_release release;
      rows = batch.bias_forces(ids);
    }
    return by_environment<S>(rows, {coordinates_of(batch.plan())});
  });
}

py::array jacobian(AnyBatch& any, const py::object& which, const std::optional<std::string>& link,
                   const std::optional<std::string>& site) {
  return any.use([&]<class S>(Batch<S>& batch) -> py::array {
    if (link.has_value() == site.has_value())
      throw UsageError("frame", link ? "is a link and a site" : "is missing", "give link= or site=");
    const std::vector<int> ids = environments_of(which, batch.environments());
    const int index = link ? batch.plan().link(*link) : batch.plan().site(*site);
    typename Batch<S>::Array rows;
    {
      const py::gil_scoped_release release;
      rows = link ? batch.reduced_link_jacobians(index, ids) : batch.reduced_site_jacobians(index, ids);
    }
    const py::object by_column = by_environment<S>(rows, {coordinates_of(batch.plan()), 6});
    return by_column.attr("transpose")(0, 2, 1);
  });
}

}  // namespace

void bind_planning(py::class_<AnyBatch>& batch) {
  batch.def("rollout", &rollout, "start"_a, "controls"_a, py::kw_only(), "record"_a = py::make_tuple("q", "qd"),
            "substeps"_a = 1, "kind"_a = "position", "raw"_a = false, "low"_a = py::none(), "high"_a = py::none(),
            "out"_a = py::none(),
            "(records [n, T, k], faults int32 [n]) of n rollouts of T control steps: controls [n, T, u] become inputs "
            "as act() does it, or, if raw, are rad, m, N m ... themselves; `substeps` steps are taken; then the "
            "queries of `record` are read. n may be more or less than num_envs. start: bytes of save(), of one "
            "environment or of n; environments of this batch, one or n; or None: rollout i starts from environment i "
            "as it stands, with its parameters, and n is num_envs. The batch is the workspace: its environments are "
            "overwritten; save() them before if they are needed. Controls and `out` are used where they lie, whatever "
            "their strides are. Other Python threads run meanwhile. Raises UsageError, and changes nothing, for "
            "shapes that do not fit and controls that are NaN.");
  batch.def("linearize", &linearize, "which"_a = py::none(), py::kw_only(), "inputs"_a = "position", "substeps"_a = 1,
            "parameters"_a = py::tuple(), "record"_a = py::tuple(), "step"_a = 1e-6,
            "Derivatives of the next `substeps` steps of each of k environments, by centred differences: a dict of A "
            "[k, s, s], B [k, s, u] and P [k, s, parameters] of the state, record_A, record_B and record_P of the "
            "queries after the steps, and fault [k], where numbers are NaN. The state: positions of "
            "Plan.coordinates, the motion of each floating root in its axes, angular then linear; then their "
            "velocities. inputs: 'position' or 'velocity' (targets of Plan.driven_dofs) or 'effort' (of "
            "Plan.independent_dofs). "
            "parameters: pairs of a field and the name of a row. The batch stays as it is. Needs dtype 'f8', and with "
            "contacts compile(contact_tolerance=1e-10, contact_rounds=100).");
  batch.def("inverse_kinematics", &inverse_kinematics, "site"_a, "targets"_a, "which"_a = py::none(), py::kw_only(),
            "iterations"_a = 100, "tolerance"_a = 1e-6,
            "Writes q so that the site comes as near to its target as it can from where it is, within the ranges; "
            "followers are placed. targets: [num_envs, 3] positions, m, or [num_envs, 7] poses. Returns what is left, "
            "[num_envs, 2]: distance, m, and angle, rad; 0 for others than `which`.");
  batch.def("mass_matrix", &mass_matrix, "which"_a = py::none(),
            "[k, n, n] of each of k environments in independent coordinates: the six velocities of each floating root, "
            "as root_twist, then the joints Plan.open_coordinates. Followers, functions and tendons are in it with "
            "the environment's own numbers, armatures too. Loops are open: they are constraints on it. Other Python "
            "threads run meanwhile. Raises UsageError where a hard coupling is off or soft.");
  batch.def("bias_forces", &bias_forces, "which"_a = py::none(),
            "[k, n] N m or N, what keeps the rates of these coordinates 0: gravity, Coriolis and centrifugal forces. "
            "Without springs, drives, damping, friction, efforts, wrenches, contacts and loops.");
  batch.def(
      "jacobian", &jacobian, "which"_a = py::none(), py::kw_only(), "link"_a = py::none(), "site"_a = py::none(),
      "[k, 6, n] angular, then linear velocity of a link's frame or a site, in world axes, by these coordinates.");
}

}  // namespace lockstep::python
