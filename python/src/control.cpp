// Random numbers, actions, readings and save points for Python. SPDX-License-Identifier: Apache-2.0
#include <pybind11/stl.h>

#include "batch.h"

namespace lockstep::python {
namespace {

using namespace pybind11::literals;

// --- random numbers ------------------------------------------------------------------------------

template <class S>
py::array_t<S> drawn(const Batch<S>& batch, int count, const py::object& which, unsigned stream, bool normal) {
  if (count < 0) throw py::value_error("count must be 0 or more");
  const std::vector<int> ids = environments_of(which, batch.environments());
  py::array_t<S> all({static_cast<py::ssize_t>(batch.environments()), static_cast<py::ssize_t>(count)});
  const StridedRows<S> rows{all.mutable_data(), 1, count};
  normal ? batch.draw_normal(rows, count, stream, ids) : batch.draw(rows, count, stream, ids);
  return which.is_none() ? all : py::array_t<S>(all[py::cast(ids)]);
}

Randomization randomization_of(const Plan& plan, Parameter field, const std::string& operation, double low, double high,
                               const std::string& distribution, const py::object& rows, bool shared, unsigned stream) {
  Randomization r;
  r.change = one_of<UsageError, Change>(
      "operation", operation, {{"scale", Change::scale}, {"add", Change::add}, {"absolute", Change::absolute}});
  r.distribution = one_of<UsageError, Distribution>("distribution", distribution,
                                                    {{"uniform", Distribution::uniform},
                                                     {"log_uniform", Distribution::log_uniform},
                                                     {"normal", Distribution::normal}});
  r.low = low, r.high = high, r.shared = shared, r.stream = stream;
  if (rows.is_none()) return r;
  const std::vector<std::string>& names = plan.parameter_row_names(field);
  if (py::isinstance<py::str>(rows)) throw py::type_error("rows are a list of numbers or names, not a text");
  for (const py::handle& row : rows) {
    if (is_bool(row)) throw py::type_error("rows are numbers or names, not a mask");
    if (!py::isinstance<py::str>(row)) {
      r.rows.push_back(value_of<int>(row, "rows"));
      continue;
    }
    const std::string name = row.cast<std::string>();
    const auto found = std::find(names.begin(), names.end(), name);
    if (found == names.end())
      throw UsageError("row '" + name + "' of " + to_string(field), "is unknown", "see Plan.parameter_rows()");
    r.rows.push_back(static_cast<int>(found - names.begin()));
  }
  return r;
}

// --- actions and readings ------------------------------------------------------------------------

// One number for each of `count` actions.
std::vector<double> numbers_of(const py::object& given, std::size_t count, const char* name) {
  if (given.is_none()) return {};
  if (py::isinstance<py::float_>(given) || py::isinstance<py::int_>(given))
    return std::vector<double>(count, given.cast<double>());
  return value_of<std::vector<double>>(given, name);
}

template <class S>
void act(Batch<S>& batch, const py::object& actions, const std::string& kind, const py::object& which,
         const py::object& low, const py::object& high, const py::object& joints, const py::object& scale,
         const py::object& center, double alpha) {
  ActionMap map = action_map_of(kind, low, high, false);
  if (!joints.is_none()) {
    if (py::isinstance<py::str>(joints)) throw py::type_error("joints is a sequence of names, not one");
    for (const py::handle& joint : joints) map.dofs.push_back(batch.plan().dof(value_of<std::string>(joint, "joints")));
    if (map.dofs.empty()) return;
  }
  const std::vector<int>& commanded = !map.dofs.empty()                ? map.dofs
                                      : map.kind == ActionKind::effort ? batch.plan().independent_dofs()
                                                                       : batch.plan().driven_dofs();
  map.alpha = alpha;
  map.scale = numbers_of(scale, commanded.size(), "scale"), map.center = numbers_of(center, commanded.size(), "center");
  // A copy: actions may lie in memory of the batch, or not be aligned.
  const py::array_t<S> given = array_of<S>(actions, "actions");
  const py::ssize_t columns = static_cast<py::ssize_t>(commanded.size());
  if (given.ndim() != 2 || given.shape(0) != batch.environments() || given.shape(1) != columns)
    throw UsageError("actions", "have the shape " + text_of(given.attr("shape")),
                     "give [" + std::to_string(batch.environments()) + ", " + std::to_string(columns) + "]");
  constexpr py::ssize_t item = sizeof(S);
  const StridedRows<const S> rows{given.data(), given.strides(1) / item, given.strides(0) / item};
  if (which.is_none())
    batch.set_actions(rows, map);
  else
    batch.set_actions(rows, map, environments_of(which, batch.environments()));
}

const Names<Quantity> quantities = {{"q", Quantity::position},
                                    {"qd", Quantity::velocity},
                                    {"q_target", Quantity::position_target},
                                    {"qd_target", Quantity::velocity_target},
                                    {"effort", Quantity::effort},
                                    {"link_pose", Quantity::link_pose},
                                    {"link_velocity", Quantity::link_velocity},
                                    {"site_pose", Quantity::site_pose},
                                    {"site_position", Quantity::site_position},
                                    {"site_velocity", Quantity::site_velocity},
                                    {"coupling_error", Quantity::coupling_error},
                                    {"loop_error", Quantity::loop_error},
                                    {"loop_force", Quantity::loop_force},
                                    {"root_pose", Quantity::root_pose},
                                    {"root_twist", Quantity::root_velocity},
                                    {"kinetic_energy", Quantity::kinetic_energy},
                                    {"potential_energy", Quantity::potential_energy},
                                    {"contact_force", Quantity::contact_force},
                                    {"contact_normal_force", Quantity::contact_normal_force},
                                    {"contact_gap", Quantity::contact_gap},
                                    {"contact_slip", Quantity::contact_slip},
                                    {"contact_point", Quantity::contact_point},
                                    {"unfinished_contacts", Quantity::unfinished_contacts},
                                    {"solve_counts", Quantity::solve_counts},
                                    {"link_twist", Quantity::link_twist},
                                    {"site_twist", Quantity::site_twist},
                                    {"link_gravity", Quantity::link_gravity},
                                    {"site_gravity", Quantity::site_gravity},
                                    {"link_contact_force", Quantity::link_contact_force},
                                    {"link_contacts", Quantity::link_contacts},
                                    {"drive_effort", Quantity::drive_effort},
                                    {"drive_effort_peak", Quantity::drive_effort_peak},
                                    {"drive_effort_mean", Quantity::drive_effort_mean},
                                    {"contact_peak_force", Quantity::contact_peak_force},
                                    {"contact_mean_force", Quantity::contact_mean_force},
                                    {"contact_time", Quantity::contact_time},
                                    {"contact_air_time", Quantity::contact_air_time},
                                    {"contact_last_time", Quantity::contact_last_time},
                                    {"contact_last_air_time", Quantity::contact_last_air_time},
                                    {"contact_first_touch", Quantity::contact_first_touch},
                                    {"joint_acceleration", Quantity::joint_acceleration},
                                    {"link_acceleration", Quantity::link_acceleration},
                                    {"site_acceleration", Quantity::site_acceleration},
                                    {"joint_wrench", Quantity::joint_wrench},
                                    {"height_scan", Quantity::height_scan}};

int place_in(const std::vector<std::string>& names, const std::string& name, const char* kind) {
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) throw UsageError(std::string(kind) + " '" + name + "'", "is unknown", "see the model");
  return static_cast<int>(found - names.begin());
}

int row_of(const Plan& plan, const std::string& quantity, const std::string& name) {
  if (quantity.starts_with("link") || quantity == "height_scan") return plan.link(name);
  if (quantity.starts_with("site")) return plan.site(name);
  if (quantity.starts_with("coupling")) return place_in(coupling_names(plan.model()), name, "coupling");
  if (quantity.starts_with("loop")) {
    std::vector<std::string> names;
    for (const PlanLoop& loop : plan.loops()) names.push_back(loop.name);
    return place_in(names, name, "loop");
  }
  if (quantity.starts_with("root")) return place_in(plan.root_names(), name, "floating root");
  if (quantity == "contact_point" || quantity == "unfinished_contacts" || quantity == "solve_counts")
    throw UsageError("query of " + quantity, "has rows, which have no names", "leave them out");
  if (quantity.starts_with("contact")) return plan.contact(name);
  if (quantity.ends_with("energy"))
    throw UsageError("query of " + quantity, "has rows, and there is only one", "leave them out");
  if ((quantity.ends_with("target") || quantity == "effort") && plan.settings().stage_inputs)
    throw UsageError("query of " + quantity, "has rows, and there are several stages", "leave them out");
  return plan.dof(name);
}

bool asks_for_nothing(const py::handle& query) {
  return !py::isinstance<py::str>(query) && !query.attr("rows").is_none() && py::len(query.attr("rows")) == 0;
}

Query query_of(const Plan& plan, const py::handle& given) {
  Query query;
  const bool named = py::isinstance<py::str>(given);
  const std::string name =
      (named ? py::reinterpret_borrow<py::object>(given) : py::object(given.attr("quantity"))).cast<std::string>();
  query.quantity = one_of<UsageError, Quantity>("quantity", name, quantities);
  if (named) return query;
  query.scale = given.attr("scale").cast<double>();
  if (const py::object rows = given.attr("rows"); py::isinstance<py::str>(rows))
    throw py::type_error("rows of a Query are a list of names, not a text");
  else if (!rows.is_none())
    for (const py::handle& row : rows)
      query.elements.push_back(row_of(plan, name, value_of<std::string>(row, "rows of a Query")));
  if (const py::object points = given.attr("points"); !points.is_none())
    for (const py::handle& point : points) {
      if (py::len(point) != 2) throw UsageError("points of a Query", "are not pairs", "give x and y of each");
      query.points.push_back({py::float_(point[py::int_(0)]), py::float_(point[py::int_(1)])});
    }
  return query;
}

template <class S>
py::array read(const Batch<S>& batch, const py::args& given, const py::object& out) {
  const std::vector<Query> queries = queries_of(batch.plan(), given);
  py::ssize_t columns = 0;
  for (const Query& query : queries) columns += batch.plan().query_rows(query);
  py::array_t<S> to;
  if (out.is_none())
    to = py::array_t<S>({static_cast<py::ssize_t>(batch.environments()), columns});
  else if (py::array_t<S>::check_(out) && py::cast<py::array>(out).writeable() &&
           py::cast<bool>(out.attr("flags").attr("aligned")))
    to = py::reinterpret_borrow<py::array_t<S>>(out);
  else
    throw py::type_error("out must be a writable, aligned array of " + text_of(py::dtype::of<S>()));
  if (to.ndim() != 2 || to.shape(0) != batch.environments() || to.shape(1) != columns)
    throw UsageError("out", "has the shape " + text_of(to.attr("shape")),
                     "give [" + std::to_string(batch.environments()) + ", " + std::to_string(columns) + "]");
  constexpr py::ssize_t item = sizeof(S);
  batch.read(queries, StridedRows<S>{to.mutable_data(), to.strides(1) / item, to.strides(0) / item});
  return to;
}

// --- starts --------------------------------------------------------------------------------------

RootNoise root_noise_of(const std::string& link, const py::handle& given) {
  RootNoise noise;
  noise.link = link;
  const auto position = value_of<std::vector<double>>(given.attr("position"), "position of a RootNoise");
  if (position.size() != 3) throw py::type_error("position of a RootNoise has three numbers: x, y, z");
  noise.position = Eigen::Vector3d(position[0], position[1], position[2]);
  noise.yaw = value_of<double>(given.attr("yaw"), "yaw of a RootNoise");
  noise.any_rotation = value_of<bool>(given.attr("any_rotation"), "any_rotation of a RootNoise");
  noise.angular_velocity = value_of<double>(given.attr("angular_velocity"), "angular_velocity of a RootNoise");
  noise.linear_velocity = value_of<double>(given.attr("linear_velocity"), "linear_velocity of a RootNoise");
  return noise;
}

// A lockstep.Start, or its pose alone.
py::list reset_to(AnyBatch& b, const py::object& start, const py::object& which, unsigned stream, bool keep_inputs,
                  const py::object& project) {
  const py::module_ module = py::module_::import("lockstep.start");
  PoseNoise noise;
  noise.stream = stream, noise.keep_inputs = keep_inputs, noise.project = couplings_of(project);
  py::object pose = start;
  if (py::isinstance(start, module.attr("Start"))) {
    pose = start.attr("pose");
    noise.position = value_of<double>(start.attr("position"), "position of a Start");
    noise.spread = value_of<double>(start.attr("spread"), "spread of a Start");
    noise.velocity = value_of<double>(start.attr("velocity"), "velocity of a Start");
    const py::object roots = start.attr("roots");
    if (py::isinstance(roots, module.attr("RootNoise")))
      noise.roots.push_back(root_noise_of("", roots));
    else
      for (const auto& [link, own] : value_of<std::map<std::string, py::object>>(roots, "roots of a Start"))
        noise.roots.push_back(root_noise_of(link, own));
  }
  return b.use([&](auto& own) {
    const std::vector<int> ids = environments_of(which, own.environments());
    return unmet_to_python(own.plan(), py::isinstance<py::str>(pose)
                                           ? own.reset_to(ids, pose.cast<std::string>(), noise)
                                           : own.reset_to(ids, value_of<int>(pose, "the pose of a start"), noise));
  });
}

// Ids only: how many environments a blob has is not known here.
std::vector<int> places_in_blob(const py::object& rows) {
  for (const py::handle& row : rows) {
    if (is_bool(row)) throw py::type_error("rows are places in the blob, not a mask");
    if (py::isinstance<py::int_>(row) && row < py::int_(0))
      throw UsageError("row " + text_of(row), "is no place in the blob", "give numbers from 0");
  }
  return environments_of(rows, std::numeric_limits<int>::max());
}

}  // namespace

ActionMap action_map_of(const std::string& kind, const py::object& low, const py::object& high, bool raw) {
  ActionMap map;
  map.kind = one_of<UsageError, ActionKind>("kind", kind,
                                            {{"position", ActionKind::position},
                                             {"position_change", ActionKind::position_change},
                                             {"velocity", ActionKind::velocity},
                                             {"effort", ActionKind::effort}});
  if (!low.is_none()) map.low = value_of<std::vector<double>>(low, "low");
  if (!high.is_none()) map.high = value_of<std::vector<double>>(high, "high");
  map.raw = raw;
  return map;
}

std::vector<Query> queries_of(const Plan& plan, const py::object& given) {
  const py::object query_class = py::module_::import("lockstep.query").attr("Query");
  if (py::isinstance<py::str>(given) || py::isinstance(given, query_class))
    return queries_of(plan, py::make_tuple(given));
  std::vector<Query> queries;
  for (const py::handle& query : given) {
    if (!py::isinstance<py::str>(query) && !py::isinstance(query, query_class))
      throw py::type_error("a query is a name or a lockstep.Query, not " + text_of(py::repr(query)));
    if (!asks_for_nothing(query)) queries.push_back(query_of(plan, query));
  }
  return queries;
}

void bind_control(py::class_<AnyBatch>& batch) {
  batch.def(
      "draw",
      [](AnyBatch& b, int count, const py::object& which, unsigned stream) -> py::array {
        return b.use([&](auto& own) -> py::array { return drawn(own, count, which, stream, false); });
      },
      "count"_a, "which"_a = py::none(), "stream"_a = 0,
      "[k, count] uniform random numbers in [0, 1). They depend on the environment's seed, env_id and episode, on the "
      "stream (below 32768) and the column, and on nothing else.");
  batch.def(
      "normal",
      [](AnyBatch& b, int count, const py::object& which, unsigned stream) -> py::array {
        return b.use([&](auto& own) -> py::array { return drawn(own, count, which, stream, true); });
      },
      "count"_a, "which"_a = py::none(), "stream"_a = 0, "the same, normal with mean 0 and standard deviation 1");
  batch.def(
      "randomize",
      [](AnyBatch& b, const std::string& name, const std::string& operation, double low, double high,
         const std::string& distribution, const py::object& which, const py::object& rows, bool shared,
         unsigned stream) {
        if (!rows.is_none() && py::len(rows) == 0) return;
        b.use([&](auto& own) {
          const Parameter field = parameter_of(name);
          own.randomize(field,
                        randomization_of(own.plan(), field, operation, low, high, distribution, rows, shared, stream),
                        environments_of(which, own.environments()));
        });
      },
      "name"_a, "operation"_a, "low"_a, "high"_a, py::kw_only(), "distribution"_a = "uniform", "which"_a = py::none(),
      "rows"_a = py::none(), "shared"_a = false, "stream"_a = 0,
      "Sets a field to random values: the compiled ones times, plus, or replaced by ('scale', 'add', 'absolute') "
      "numbers "
      "between low and high, 'uniform' or 'log_uniform', or 'normal' with the mean low and the standard deviation "
      "high. "
      "rows: numbers or names of columns. shared: one number for all of them. Raises UsageError, and changes nothing, "
      "where a value could be impossible.");
  batch.def(
      "reset_random",
      [](AnyBatch& b, const py::object& which, double spread, double speed, unsigned stream) {
        return b.use([&](auto& own) {
          RandomReset random;
          random.spread = spread, random.speed = speed, random.stream = stream;
          return unmet_to_python(own.plan(), own.reset_random(environments_of(which, own.environments()), random));
        });
      },
      "which"_a = py::none(), "spread"_a = 1.0, "speed"_a = 0.0, py::kw_only(), "stream"_a = 0,
      "reset_to(Start(spread=spread, velocity=speed)): from the model's own start. spread=0 is that start, spread=1 "
      "the "
      "whole range of each independent joint.");
  batch.def(
      "reset_to", &reset_to, "start"_a = "", "which"_a = py::none(), py::kw_only(), "stream"_a = 0,
      "keep_inputs"_a = false, "project"_a = "all",
      "Resets to one of plan.poses, by name or number, or to a lockstep.Start: a pose with noise. '' is the model's "
      "own start. Followers are placed by their couplings and loops are closed, as project() does it; returns what "
      "cannot be met, as (environment, coupling or loop, error, velocity error).");
  batch.def(
      "act",
      [](AnyBatch& b, const py::object& actions, const std::string& kind, const py::object& which,
         const py::object& low, const py::object& high, const py::object& joints, const py::object& scale,
         const py::object& center, double alpha) {
        b.use([&](auto& own) { act(own, actions, kind, which, low, high, joints, scale, center, alpha); });
      },
      "actions"_a, "kind"_a = "position", "which"_a = py::none(), py::kw_only(), "low"_a = py::none(),
      "high"_a = py::none(), "joints"_a = py::none(), "scale"_a = py::none(), "center"_a = py::none(), "alpha"_a = 1.0,
      "Actions in [-1, 1], [num_envs, k], become targets of driven joints ('position', 'position_change', 'velocity') "
      "or efforts ('effort'). joints: names of the k columns; by default Plan.driven_dofs, or Plan.independent_dofs "
      "for "
      "'effort'. -1 and 1 are low and high; or an action is center + scale * action, about the pose in which the model "
      "starts. Default: the joint's range, or 0.5 rad or 0.05 m about that pose where it has none; 5 % of that for "
      "'position_change'; its velocity or effort limit. alpha: share of the new target in a moving average. An "
      "environment with a NaN gets the fault bad_input and keeps its targets. Raises UsageError, and changes nothing, "
      "for numbers that do not fit.");
  batch.def(
      "check",
      [](AnyBatch& b, const py::object& which) {
        return b.use([&](auto& own) {
          py::list all;
          for (const Problem& p : own.check(environments_of(which, own.environments())))
            all.append(py::make_tuple(p.environment, p.field, p.row, p.value, p.element + " " + p.rule));
          return all;
        });
      },
      "which"_a = py::none(), "values that cannot be, as (environment, field, row, value, rule)");
  batch.def(
      "read",
      [](AnyBatch& b, const py::args& queries, const py::object& out) {
        return b.use([&](auto& own) { return read(own, queries, out); });
      },
      "out"_a = py::none(),
      "[num_envs, k] the quantities of names or lockstep.Query objects, side by side, in one pass. out: an array of "
      "that "
      "shape and dtype to write to.");
  batch.def(
      "save",
      [](AnyBatch& b, const py::object& which) {
        const std::vector<std::byte> blob = b.use([&](auto& own) {
          return which.is_none() ? own.save() : own.save(environments_of(which, own.environments()));
        });
        return py::bytes(reinterpret_cast<const char*>(blob.data()), blob.size());
      },
      "which"_a = py::none(), "everything that the next steps depend on, of these environments, as bytes");
  batch.def(
      "copy_state",
      [](AnyBatch& b, int source, const py::object& to) {
        b.use([&](auto& own) { own.copy(source, environments_of(to, own.environments())); });
      },
      "source"_a, "to"_a = py::none(),
      "Makes environments equal to environment `source`: state, inputs, declared fields, faults, and what contacts "
      "remember. They keep their env_id, seed and episode.");
  batch.def(
      "restore",
      [](AnyBatch& b, const std::string_view& blob, const py::object& into, const py::object& rows,
         bool other_settings) {
        const std::span<const std::byte> bytes(reinterpret_cast<const std::byte*>(blob.data()), blob.size());
        b.use([&](auto& own) {
          const RestoreOptions options{other_settings};
          if (into.is_none() && rows.is_none()) return own.restore(bytes, options);
          const std::vector<int> to = environments_of(into, own.environments());
          std::vector<int> from;
          if (!rows.is_none()) {
            from = places_in_blob(rows);
            if (from.size() != to.size())
              throw UsageError(
                  "rows", "are " + std::to_string(from.size()) + " for " + std::to_string(to.size()) + " environments",
                  "give one for each");
            if (from.empty()) return;
          }
          own.restore(bytes, to, from, options);
        });
      },
      "blob"_a, "into"_a = py::none(), "rows"_a = py::none(), py::kw_only(), "other_settings"_a = false,
      "Puts environments `rows` of save()'s bytes (all by default) into the environments `into`. They go on with the "
      "same bits. Raises UsageError, and changes nothing, where bytes are damaged or do not fit.");
}

}  // namespace lockstep::python
