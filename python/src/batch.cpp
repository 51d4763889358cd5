// Batch for Python: live views and steps. SPDX-License-Identifier: Apache-2.0
#include "batch.h"

#include <pybind11/stl.h>

namespace lockstep::python {
namespace {

using namespace pybind11::literals;

// --- live views ----------------------------------------------------------------------------------

enum class Layout { items, rows };  // [num_envs, k] or [k, num_envs]

template <class S>
py::array view_of(S* data, Eigen::Index rows, Eigen::Index stride, Eigen::Index count, Layout layout,
                  const py::object& owner) {
  constexpr py::ssize_t item = sizeof(S);
  if (layout == Layout::rows) return py::array_t<S>({rows, count}, {stride * item, item}, data, owner);
  return py::array_t<S>({count, rows}, {item, stride * item}, data, owner);
}

template <class Eigen>
py::array view_of(const Eigen& view, Layout layout, const py::object& owner) {
  return view_of(const_cast<typename Eigen::Scalar*>(view.data()), view.rows(), view.outerStride(), view.cols(), layout,
                 owner);
}

template <class Number, class From>
py::array live(std::span<From> numbers, const py::object& owner) {
  static_assert(sizeof(Number) == sizeof(From));
  return py::array_t<Number>({static_cast<py::ssize_t>(numbers.size())}, {static_cast<py::ssize_t>(sizeof(Number))},
                             reinterpret_cast<const Number*>(numbers.data()), owner);
}

template <class Number, class From>
py::array read_only(std::span<From> numbers, const py::object& owner) {
  py::array array = live<Number>(numbers, owner);
  py::detail::array_proxy(array.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
  return array;
}

using Field = py::array (*)(AnyBatch&, Layout, const py::object&);

template <auto view>
py::array field(AnyBatch& batch, Layout layout, const py::object& owner) {
  return batch.use([&](auto& own) { return view_of(view(own), layout, owner); });
}

struct NamedField {
  const char* name;
  Field view;
  const char* help;
};

constexpr NamedField fields[] = {
    {"q", field<[](auto& b) { return b.positions(); }>, "[num_envs, nv] positions, rad or m; live"},
    {"qd", field<[](auto& b) { return b.velocities(); }>, "[num_envs, nv] velocities, rad/s or m/s; live"},
    {"q_target", field<[](auto& b) { return b.position_targets(); }>,
     "[num_envs, nv for each of Plan.stage_times] position targets, rad or m; live; for joints with a drive"},
    {"qd_target", field<[](auto& b) { return b.velocity_targets(); }>,
     "[num_envs, nv for each of Plan.stage_times] velocity targets, rad/s or m/s; live; for joints with a drive"},
    {"effort", field<[](auto& b) { return b.efforts(); }>,
     "[num_envs, nv for each of Plan.stage_times] feed-forward efforts, N m or N; live"},
    {"root_pose", field<[](auto& b) { return b.root_poses(); }>,
     "[num_envs, 7 per floating root] x, y, z (m), quaternion w, x, y, z; live"},
    {"root_twist", field<[](auto& b) { return b.root_velocities(); }>,
     "[num_envs, 6 per floating root] angular, then linear velocity in the root's axes; live"},
};

void assign(const py::array& view, const py::object& value, const char* name) {
  if (value.ptr() == view.ptr()) return;
  view[py::ellipsis()] = plain_numbers(value, name);
}

/// The same arrays as those of a Batch, as [k, num_envs].
struct Rows {
  py::object batch;
};

// --- which environments --------------------------------------------------------------------------

std::vector<int> ids_of_mask(const py::array_t<bool>& mask, int environments) {
  if (mask.ndim() != 1 || mask.shape(0) != environments)
    throw UsageError("mask", "has the shape " + text_of(mask.attr("shape")),
                     "give one bool for each of the " + std::to_string(environments) + " environments");
  std::vector<int> ids;
  const auto at = mask.unchecked<1>();
  for (int e = 0; e < environments; ++e)
    if (at(e)) ids.push_back(e);
  return ids;
}

// --- resets --------------------------------------------------------------------------------------

// A state for each of these environments, [k, nv] or [nv] for all of them.
template <class S>
typename Batch<S>::Array states_of(const py::object& given, const char* name, Eigen::Index environments,
                                   Eigen::Index dofs) {
  const py::module_ numpy = py::module_::import("numpy");
  const py::object array = array_of<S>(given, name);
  const py::ssize_t dimensions = array.attr("ndim").cast<py::ssize_t>();
  const py::tuple shape = array.attr("shape");
  const bool fits = (dimensions == 1 || dimensions == 2) && shape[dimensions - 1].cast<Eigen::Index>() == dofs &&
                    (dimensions == 1 || shape[0].cast<Eigen::Index>() == environments);
  if (!fits)
    throw UsageError(name, "has the shape " + text_of(shape),
                     "give [" + std::to_string(environments) + ", " + std::to_string(dofs) + "]");
  const py::array_t<S> full = numpy.attr("broadcast_to")(array, py::make_tuple(environments, dofs));
  typename Batch<S>::Array states(dofs, environments);
  const auto at = full.template unchecked<2>();
  for (Eigen::Index e = 0; e < environments; ++e)
    for (Eigen::Index dof = 0; dof < dofs; ++dof) states(dof, e) = at(e, dof);
  return states;
}

template <class S>
typename Batch<S>::Array model_states(const Plan& plan, Eigen::Index environments, double Joint::*number) {
  typename Batch<S>::Array states(plan.dofs(), environments);
  for (int dof = 0; dof < plan.dofs(); ++dof) {
    const Model& model = plan.model();
    states.row(dof) = static_cast<S>(model.joints[model.joint_index(plan.dof_names()[dof])].*number);
  }
  return states;
}

py::list reset(AnyBatch& batch, const py::object& which, const py::object& q, const py::object& qd, bool keep_inputs,
               const py::object& project) {
  return batch.use([&]<class S>(Batch<S>& own) {
    const ResetOptions options{keep_inputs, couplings_of(project)};
    const std::vector<int> ids = environments_of(which, own.environments());
    if (q.is_none() && qd.is_none()) {
      own.reset(ids, options);
      return py::list();
    }
    const Eigen::Index count = static_cast<Eigen::Index>(ids.size()), dofs = own.plan().dofs();
    const auto states = [&](const py::object& given, const char* name, double Joint::*number) {
      return given.is_none() ? model_states<S>(own.plan(), count, number) : states_of<S>(given, name, count, dofs);
    };
    const auto positions = states(q, "q", &Joint::position), velocities = states(qd, "qd", &Joint::velocity);
    return unmet_to_python(own.plan(), own.reset(ids, positions, velocities, options));
  });
}

py::list project(AnyBatch& batch, const py::object& which, bool soft) {
  return batch.use([&](auto& own) {
    return unmet_to_python(
        own.plan(), own.project(environments_of(which, own.environments()), soft ? Couplings::all : Couplings::hard));
  });
}

// --- readbacks -----------------------------------------------------------------------------------

template <class Array>
py::array items(const Array& rows) {  // [num_envs, k], C-contiguous
  using S = typename Array::Scalar;
  py::array_t<S> result({rows.cols(), rows.rows()});
  S* to = result.mutable_data();
  for (Eigen::Index e = 0; e < rows.cols(); ++e)
    for (Eigen::Index row = 0; row < rows.rows(); ++row) *to++ = rows(row, e);
  return result;
}

template <auto readback>
py::array read_back(AnyBatch& batch) {
  return batch.use([](auto& own) { return items(readback(own)); });
}

// --- what Python sees ----------------------------------------------------------------------------

using Class = py::class_<AnyBatch>;

void bind_views(py::class_<Rows>& rows, Class& batch) {
  for (const NamedField& f : fields) {
    const Field view = f.view;
    rows.def_property(
        f.name, [view](const Rows& self) { return view(self.batch.cast<AnyBatch&>(), Layout::rows, self.batch); },
        [f](const Rows& self, const py::object& value) {
          assign(f.view(self.batch.cast<AnyBatch&>(), Layout::rows, self.batch), value, f.name);
        },
        f.help);
    batch.def_property(f.name, py::cpp_function([view](const py::object& self) {
                         return view(self.cast<AnyBatch&>(), Layout::items, self);
                       }),
                       py::cpp_function([f](const py::object& self, const py::object& value) {
                         assign(f.view(self.cast<AnyBatch&>(), Layout::items, self), value, f.name);
                       }),
                       f.help);
  }
  const auto parameter = [](AnyBatch& own, const std::string& name, Layout layout, const py::object& owner) {
    return own.use([&](auto& b) { return view_of(b.parameter(parameter_of(name)), layout, owner); });
  };
  rows.def(
      "parameter",
      [parameter](const Rows& self, const std::string& name) {
        return parameter(self.batch.cast<AnyBatch&>(), name, Layout::rows, self.batch);
      },
      "name"_a, "as Batch.parameter(), [k, num_envs]");
  const auto items = [parameter](const py::object& self, const std::string& name) {
    return parameter(self.cast<AnyBatch&>(), name, Layout::items, self);
  };
  batch.def(
      "parameter", items, "name"_a,
      "[num_envs, k] a field of compile(vary=...); live. Columns: Plan.parameter_rows(name). Raises UsageError for "
      "a field that does not vary.");
  batch.def("expand", items, "name"_a, "as parameter()");
  batch.def(
      "bind",
      [items](const py::object& self, const std::string& name) {
        for (const NamedField& f : fields)
          if (name == f.name) return f.view(self.cast<AnyBatch&>(), Layout::items, self);
        return items(self, name);
      },
      "name"_a, "the live array of that name: bind('q') is q, bind('mass') is parameter('mass')");
  batch.def_property_readonly(
      "rows", [](const py::object& self) { return Rows{self}; }, "the same arrays as [k, num_envs]");
  const auto read = [](const auto& numbers) {
    return py::cpp_function([numbers](const py::object& self) {
      return self.cast<AnyBatch&>().use([&](auto& own) { return numbers(own, self); });
    });
  };
  const auto read_only_counts = [&](const char* name, const auto& numbers, const char* help) {
    batch.def_property_readonly(name, read(numbers), help);
  };
  const auto counts = [&](const char* name, const auto& numbers, const char* help) {
    const auto write = [name, numbers](const py::object& self, const py::object& value) {
      const py::array view = self.cast<AnyBatch&>().use([&](auto& own) { return numbers(own, self); });
      if (value.ptr() == view.ptr()) return;
      // NumPy would take large and small integers of a list for floats.
      const py::object numpy = py::module_::import("numpy");
      const py::array given = py::isinstance<py::array>(value)
                                  ? py::reinterpret_borrow<py::array>(value)
                                  : py::array(numpy.attr("asarray")(value, "dtype"_a = "O"));
      const char kind = given.dtype().kind();
      if (kind == 'O')
        for (const py::handle& number : given.attr("flat"))
          if (!py::hasattr(number, "__index__") || is_bool(number))
            throw py::type_error(std::string(name) + " are whole numbers, not " + text_of(py::repr(number)));
      if (kind != 'O' && kind != 'i' && kind != 'u')
        throw py::type_error(std::string(name) + " are whole numbers, not " + text_of(given.dtype()));
      const auto refuse = [&] {
        throw UsageError(name, "has a number outside of " + text_of(view.dtype()), "give one that it can hold");
      };
      py::object taken;
      try {
        taken = given.attr("astype")(view.dtype());
      } catch (py::error_already_set& error) {
        if (!error.matches(PyExc_OverflowError)) throw;
        refuse();
      }
      if (!py::cast<bool>(numpy.attr("equal")(taken, given).attr("all")())) refuse();
      view[py::ellipsis()] = taken;
    };
    batch.def_property(name, read(numbers), py::cpp_function(write), help);
  };
  // As int32, because torch has no uint32.
  read_only_counts(
      "fault", [](auto& b, const py::object& owner) { return read_only<std::int32_t>(b.faults(), owner); },
      "int32 [num_envs], read-only, live: 0, or the number of the fault that froze the environment");
  read_only_counts(
      "steps", [](auto& b, const py::object& owner) { return read_only<std::int32_t>(b.steps(), owner); },
      "int32 [num_envs], read-only, live: steps of dt since the last reset");
  counts(
      "episode", [](auto& b, const py::object& owner) { return live<std::int32_t>(b.resets(), owner); },
      "int32 [num_envs], live: how often the environment has been reset. Random numbers depend on it");
  counts(
      "env_id", [](auto& b, const py::object& owner) { return live<std::uint32_t>(b.ids(), owner); },
      "uint32 [num_envs], live: what tells an environment's random numbers from those of others");
  counts(
      "seed", [](auto& b, const py::object& owner) { return live<std::uint64_t>(b.seeds(), owner); },
      "uint64 [num_envs], live: seeds of the random numbers");
  batch.def_property_readonly(
      "num_envs", [](AnyBatch& b) { return b.use([](auto& own) { return own.environments(); }); },
      "number of environments");
  batch.def_property_readonly(
      "plan", [](AnyBatch& b) { return b.use([](auto& own) { return own.plan(); }); }, "what it was made from");
  batch.def_property_readonly(
      "dtype", [](AnyBatch& b) { return b.use([]<class S>(Batch<S>&) { return py::dtype::of<S>(); }); },
      "that of its arrays, float32 or float64");
  batch.def_property_readonly(
      "engine", [](AnyBatch& b) { return b.use([](auto& o) { return to_string(o.engine()); }); }, "the one in use");
  batch.def_property_readonly(
      "target", [](AnyBatch& b) { return b.use([](auto& o) { return to_string(o.target()); }); },
      "the instruction set in use");
  batch.def_property_readonly(
      "kernel", [](AnyBatch& b) { return b.use([](auto& own) { return own.kernel_name(); }); },
      "name of the generated kernel in use; empty for other engines");
}

void step(AnyBatch& batch, int substeps, const py::object& before) {
  if (substeps < 1) throw py::value_error("substeps must be 1 or more, not " + std::to_string(substeps));
  if (!before.is_none() && !PyCallable_Check(before.ptr())) throw py::type_error("before must be a function, or None");
  const bool alone = batch.use([&](auto& own) {
    const py::gil_scoped_release release;
    if (before.is_none()) return own.step(substeps);
    return own.step(substeps, [&](int substep) {
      const py::gil_scoped_acquire acquire;
      before(substep);
    });
  });
  if (!alone)
    throw UsageError("batch", "is in use by another thread: the functions of one Batch must not run at the same time",
                     "call them one after the other");
}

py::dict report_of(AnyBatch& batch, int environment) {
  return batch.use([&](auto& own) {
    const FaultReport report = own.fault_report(environment);
    const py::object joint = report.dof < 0 ? py::object(py::none()) : py::str(own.plan().dof_names()[report.dof]);
    return py::dict("fault"_a = to_string(report.fault), "code"_a = code_of(report.fault),
                    "stage"_a = to_string(report.stage), "joint"_a = joint, "step"_a = report.step,
                    "time"_a = report.time);
  });
}

void bind_steps(Class& batch) {
  batch.def(
      "forget_contacts",
      [](AnyBatch& batch, const py::object& which) {
        batch.use([&](auto& own) { own.forget_contacts(environments_of(which, own.environments())); });
      },
      "which"_a = py::none(),
      "Contacts begin anew in the next step, as after a reset: for bodies that were put elsewhere by hand. Where state "
      "is written otherwise, contacts that still touch keep what they hold by friction.");
  batch.def(
      "step", &step, "substeps"_a = 1, py::kw_only(), "before"_a = py::none(),
      "Takes `substeps` steps of dt. Other Python threads run meanwhile, but must not use this batch. "
      "before(i), if given, is called before step i = 0, 1 ... of them, once for all environments: write "
      "batch.effort or other inputs there. It costs what as many calls of step() do, and what is said of the last "
      "call is then said of the last step alone. What it raises passes through.");
  batch.def("reset", &reset, "which"_a = py::none(), "q"_a = py::none(), "qd"_a = py::none(), py::kw_only(),
            "keep_inputs"_a = false, "project"_a = true,
            "To the model's state, or to q and qd, [k, nv] or [nv]. which: None (all), a mask of bool or ids. Clears "
            "faults. project: place the followers of given states. Returns couplings and loops that could not be met, "
            "as (environment, name, error, velocity error); of a loop the name is \"loop NAME\".");
  batch.def(
      "project", &project, "which"_a = py::none(), py::kw_only(), "soft"_a = false,
      "Puts followers where the other joints and this environment's ratios and offsets put them, and closes loops. "
      "Returns couplings and loops that cannot be met.");
  batch.def(
      "explain_fault",
      [](AnyBatch& b, int environment) { return b.use([&](auto& own) { return own.explain_fault(environment); }); },
      "environment"_a, "the fault in words; empty without one");
  batch.def(
      "describe", [](AnyBatch& b) { return b.use([](auto& own) { return own.describe(); }); },
      "in words: what runs the steps, by how many threads, and what the last call of step() has spent on contacts, in "
      "the mean of an environment and step");
  batch.def_property_readonly(
      "threads", [](AnyBatch& b) { return b.use([](auto& own) { return own.threads(); }); },
      "how many may work on a step");
  batch.def("__reduce__", [](const py::object& self) {
    return py::make_tuple(
        py::module_::import("lockstep.model").attr("restored"),
        py::make_tuple(self.attr("plan"), self.attr("num_envs"), self.cast<AnyBatch&>().threads, self.attr("dtype"),
                       self.attr("target"), self.attr("engine"), self.attr("save")()));
  });
  batch.def("fault_report", &report_of, "environment"_a,
            "fault, code, stage, joint, step and time of the fault, as a dict");
}

void bind_readbacks(Class& batch) {
  batch.def("coupling_error", &read_back<[](auto& b) { return b.coupling_errors(); }>,
            "[num_envs, couplings] C, rad or m");
  batch.def("loop_error", &read_back<[](auto& b) { return b.loop_errors(); }>,
            "[num_envs, 2 loops] distance of the frames, m, and angle between them, rad");
  batch.def("coupling_impulse", &read_back<[](auto& b) { return b.coupling_impulses(); }>,
            "[num_envs, couplings] of the last step, N m s or N s; needs compile(record_impulses=True)");
  batch.def("row_residuals", &read_back<[](auto& b) { return b.row_residuals(); }>,
            "[num_envs, Plan.row_names] what the last step left of each condition; needs compile(diagnostics=True)");
  batch.def(
      "row_states", &read_back<[](auto& b) { return b.row_states(); }>,
      "[num_envs, Plan.row_names] 0 inactive, 1 holds, -1 the upper end of a limit, 2 and -2 at its largest force; "
      "the same");
  batch.def("energy_balance", &read_back<[](auto& b) { return b.energy_balances(); }>,
            "[num_envs, 4] work, dissipation, corrections, change of energy in the last step(), J; the same. Work of "
            "\"link_wrench\" is in none of the first three");
  batch.def(
      "site_jacobian",
      [](AnyBatch& b, const std::string& site) {
        return b.use([&](auto& own) {
          const py::array flat = items(own.site_jacobians(own.plan().site(site)));
          const py::object by_column = flat.attr("reshape")(own.environments(), -1, 6);
          return by_column.attr("transpose")(0, 2, 1);
        });
      },
      "site"_a, "[num_envs, 6, velocities] angular, then linear velocity of the site by generalised velocity");
  batch.def(
      "conflicts",
      [](AnyBatch& b, int environment) { return b.use([&](auto& own) { return own.conflicts(environment); }); },
      "environment"_a, "names of rows that the last step could not meet; needs compile(diagnostics=True)");
}

}  // namespace

Couplings couplings_of(const py::object& project) {
  if (is_bool(project)) return truth_of(project) ? Couplings::hard : Couplings::none;
  const std::string name = py::str(project);
  if (name == "none") return Couplings::none;
  if (name == "hard") return Couplings::hard;
  if (name == "all") return Couplings::all;
  throw UsageError("project '" + name + "'", "is unknown", "give True, False, 'none', 'hard' or 'all'");
}

py::list unmet_to_python(const Plan& plan, const std::vector<UnmetCoupling>& unmet) {
  const std::vector<std::string> names = coupling_names(plan.model());
  py::list list;
  for (const UnmetCoupling& u : unmet)
    list.append(py::make_tuple(u.environment,
                               u.coupling < 0 ? "loop " + plan.loops()[static_cast<std::size_t>(u.loop)].name
                                              : names[static_cast<std::size_t>(u.coupling)],
                               u.error, u.velocity_error));
  return list;
}

std::vector<int> environments_of(const py::object& which, int environments) {
  std::vector<int> ids;
  if (which.is_none()) {
    ids.resize(static_cast<std::size_t>(environments));
    for (int e = 0; e < environments; ++e) ids[static_cast<std::size_t>(e)] = e;
    return ids;
  }
  const py::array given = py::module_::import("numpy").attr("asarray")(which);
  const char kind = given.dtype().kind();
  if (kind == 'b') return ids_of_mask(given, environments);
  if (!py::isinstance<py::array>(which) && py::isinstance<py::sequence>(which))
    for (const py::handle& one : which)
      if (py::isinstance<py::bool_>(one))
        throw py::type_error("environments are a mask of bool or a sequence of integers, not of both");
  if (given.size() == 0) return ids;                          // an empty list is an array of float64
  if ((kind != 'i' && kind != 'u') || given.itemsize() == 1)  // a byte is more likely part of a mask
    throw py::type_error("environments are a mask of bool or a sequence of integers, not an array of " +
                         text_of(given.dtype()));
  const py::array_t<std::int64_t, py::array::c_style | py::array::forcecast> numbers = given;
  if (numbers.ndim() > 1) throw py::type_error("environments are a one-dimensional mask or sequence of ids");
  const std::int64_t* const at = numbers.data();
  for (py::ssize_t i = 0; i < numbers.size(); ++i) {
    if (at[i] < 0 || at[i] >= environments)
      throw UsageError("environment " + std::to_string(at[i]),
                       "is outside the batch of " + std::to_string(environments),
                       "give 0 to " + std::to_string(environments - 1));
    ids.push_back(static_cast<int>(at[i]));
  }
  return ids;
}

std::unique_ptr<AnyBatch> make_batch(const Plan& plan, int environments, int threads, std::uint64_t seed,
                                     std::uint32_t first_id, const py::object& dtype, const std::string& target,
                                     const std::string& engine, int memory_domain) {
  const BatchOptions options{threads, target_of(target), engine_of(engine), seed, first_id, memory_domain};
  if (dtype.is_none()) throw SettingsError("dtype", "is None", "give 'f4' or 'f8'");  // NumPy's would be float64
  const py::dtype wanted = py::dtype::from_args(dtype);
  auto batch = std::make_unique<AnyBatch>();
  batch->threads = threads;
  if (wanted.is(py::dtype::of<float>()) || wanted.equal(py::dtype::of<float>()))
    batch->batch = std::make_unique<Batch<float>>(plan, environments, options);
  else if (wanted.equal(py::dtype::of<double>()))
    batch->batch = std::make_unique<Batch<double>>(plan, environments, options);
  else
    throw SettingsError("dtype " + text_of(wanted), "is no precision of a batch", "give 'f4' or 'f8'");
  return batch;
}

void bind_batch(py::module_& module) {
  py::class_<Rows> rows(module, "Rows", py::is_final(),
                        "The arrays of a Batch as [k, num_envs]: the same memory, where an environment's neighbour is "
                        "next to it.");
  py::class_<AnyBatch> batch(module, "Batch", py::is_final(),
                             "Many environments of one Plan, made by Plan.batch(). Arrays are live views: writing to "
                             "them is writing to the environments, and edits need no announcement.");
  forbid_new(rows), forbid_new(batch);
  rows.def("__reduce__",
           [](const Rows&) -> py::object { throw py::type_error("rows are those of their Batch: copy it"); });
  bind_views(rows, batch);
  bind_steps(batch);
  bind_readbacks(batch);
  bind_control(batch);
  bind_planning(batch);
}

}  // namespace lockstep::python
