// Plan, compile() and the importer for Python. SPDX-License-Identifier: Apache-2.0
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <optional>

#include "batch.h"

namespace lockstep::python {
namespace {

using namespace pybind11::literals;

constexpr std::pair<const char*, JointSet Ignored::*> bounds[] = {{"position_limits", &Ignored::position_limits},
                                                                  {"velocity_limits", &Ignored::velocity_limits},
                                                                  {"effort_limits", &Ignored::effort_limits},
                                                                  {"friction", &Ignored::friction}};

}  // namespace

Ignored ignored_of(const py::object& given) {
  Ignored ignored;
  const auto set_of = [&](const py::handle& name) -> JointSet& {
    for (const auto& [known, set] : bounds)
      if (text_of(name) == known) return ignored.*set;
    throw SettingsError("ignore " + text_of(py::repr(name)), "is unknown",
                        "give position_limits, velocity_limits, effort_limits or friction");
  };
  if (given.is_none()) return ignored;
  if (py::isinstance<py::str>(given)) {
    set_of(given) = true;
  } else if (py::isinstance<py::dict>(given)) {
    for (const auto& [name, joints] : given.cast<py::dict>()) {
      JointSet& set = set_of(name);
      if (is_bool(joints))
        set = truth_of(joints);
      else if (py::isinstance<py::str>(joints) && text_of(joints) == "followers")
        set = JointSet::of_followers();
      else
        set.names = value_of<std::vector<std::string>>(joints, "ignore");
    }
  } else {
    for (const py::handle& name : given) set_of(name) = true;
  }
  return ignored;
}

namespace {

py::dict ignored_to_python(const Ignored& ignored) {
  py::dict all;
  for (const auto& [name, set] : bounds) {
    const JointSet& joints = ignored.*set;
    if (joints.all)
      all[name] = true;
    else if (joints.followers)
      all[name] = "followers";
    else if (!joints.empty())
      all[name] = joints.names;
  }
  return all;
}

Plan compiled(const py::object& model, double dt, const py::object& vary, const std::string& method,
              const std::string& integrator, int iterations, int velocity_iterations, const py::object& ignore,
              bool stage_inputs, bool record_impulses, bool diagnostics, bool record_efforts, bool record_contacts,
              bool record_accelerations, double guard, double position_bound, double velocity_bound,
              const std::string& contact_settings, std::optional<int> contact_passes, std::optional<int> contact_rounds,
              std::optional<double> contact_tolerance) {
  StepSettings settings;
  const ContactSettings named = contact_settings_of(contact_settings);
  settings.contacts = {contact_passes.value_or(named.passes), contact_rounds.value_or(named.rounds),
                       contact_tolerance.value_or(named.tolerance)};
  settings.dt = dt;
  settings.method = method_of(method), settings.integrator = integrator_of(integrator);
  settings.iterations = iterations, settings.velocity_iterations = velocity_iterations;
  if (py::isinstance<py::str>(vary))
    settings.per_environment.insert(parameter_of(vary.cast<std::string>()));
  else
    for (const py::handle& name : vary)
      settings.per_environment.insert(parameter_of(value_of<std::string>(name, "vary")));
  settings.ignore = ignored_of(ignore);
  settings.stage_inputs = stage_inputs, settings.record_impulses = record_impulses;
  settings.record_diagnostics = diagnostics;
  settings.record_efforts = record_efforts, settings.record_contacts = record_contacts;
  settings.record_accelerations = record_accelerations;
  settings.guard = guard, settings.position_bound = position_bound, settings.velocity_bound = velocity_bound;
  return compile(model_of(model), settings);
}

std::vector<std::string> varied(const Plan& plan) {
  std::vector<std::string> names;
  for (int f = 0; f < parameter_count; ++f)
    if (plan.settings().per_environment.contains(static_cast<Parameter>(f)))
      names.push_back(to_string(static_cast<Parameter>(f)));
  return names;
}

py::dict settings_of(const Plan& plan) {
  const StepSettings& s = plan.settings();
  return py::dict("dt"_a = s.dt, "vary"_a = varied(plan), "method"_a = to_string(s.method),
                  "integrator"_a = to_string(s.integrator), "iterations"_a = s.iterations,
                  "velocity_iterations"_a = s.velocity_iterations, "ignore"_a = ignored_to_python(s.ignore),
                  "stage_inputs"_a = s.stage_inputs, "record_impulses"_a = s.record_impulses,
                  "diagnostics"_a = s.record_diagnostics, "record_efforts"_a = s.record_efforts,
                  "record_contacts"_a = s.record_contacts, "record_accelerations"_a = s.record_accelerations,
                  "guard"_a = s.guard, "position_bound"_a = s.position_bound, "velocity_bound"_a = s.velocity_bound,
                  "contact_passes"_a = s.contacts.passes, "contact_rounds"_a = s.contacts.rounds,
                  "contact_tolerance"_a = s.contacts.tolerance);
}

std::vector<std::string> names_of(const Plan& plan, const std::vector<int>& dofs) {
  std::vector<std::string> names;
  for (int dof : dofs) names.push_back(plan.dof_names()[static_cast<std::size_t>(dof)]);
  return names;
}

// {follower: (((leader, ratio), ...), offset)}
py::dict followers_of(const Plan& plan) {
  py::dict followers;
  for (int dof : plan.follower_dofs()) {
    const Following& following = plan.following(dof);
    py::list leaders;
    for (const Following::Leader& leader : following.leaders)
      leaders.append(py::make_tuple(plan.dof_names()[static_cast<std::size_t>(leader.dof)], leader.ratio));
    followers[py::str(plan.dof_names()[static_cast<std::size_t>(dof)])] =
        py::make_tuple(py::tuple(leaders), following.offset);
  }
  return followers;
}

// [nv, 2]
py::array_t<double> limits_of(const Plan& plan) {
  py::array_t<double> limits({plan.dofs(), 2});
  for (int dof = 0; dof < plan.dofs(); ++dof) {
    const Model& model = plan.model();
    const Joint& joint = model.joints[static_cast<std::size_t>(model.joint_index(plan.dof_names()[dof]))];
    limits.mutable_at(dof, 0) = joint.lower, limits.mutable_at(dof, 1) = joint.upper;
  }
  return limits;
}

}  // namespace

void bind_plan(py::module_& module) {
  module.def(
      "_end_colliders", [](const py::object& model) { return model_of(model).end_colliders(); }, "model"_a,
      "What Model.end_colliders() returns.");
  py::class_<Plan> own(module, "Plan", py::is_final(), "A compiled model. Immutable, picklable; threads may share it.");
  forbid_new(own);
  own.def_property_readonly(
         "model", [](const Plan& plan) { return to_python(plan.model()); }, "a copy of the Model")
      .def_property_readonly("settings", &settings_of, "what compile() was given, as a dict")
      .def_property_readonly(
          "dt", [](const Plan& plan) { return plan.settings().dt; }, "s")
      .def_property_readonly(
          "method", [](const Plan& plan) { return to_string(plan.method()); }, "the one in use")
      .def_property_readonly(
          "integrator", [](const Plan& plan) { return to_string(plan.integrator()); }, "the one in use")
      .def_property_readonly("nv", &Plan::dofs, "number of moving joints")
      .def_property_readonly("dof_names", &Plan::dof_names, "names of the moving joints, in the order of q")
      .def_property_readonly(
          "loops",
          [](const Plan& plan) {
            py::list all;
            for (const PlanLoop& loop : plan.loops()) all.append(py::make_tuple(loop.name, loop.rows, loop.redundant));
            return all;
          },
          "(name, rows, rows that follow from others where the model starts) of each loop")
      .def_property_readonly(
          "loop_dependent", [](const Plan& plan) { return names_of(plan, plan.loop_dependent_dofs()); },
          "names of the joints that loops leave no motion of their own")
      .def_property_readonly(
          "contact_names",
          [](const Plan& plan) {
            std::vector<std::string> names;
            for (const PlanContact& contact : plan.contacts()) names.push_back(contact.name);
            return names;
          },
          "pairs of colliders that may touch, in the order of what Batch.read() gives of them")
      .def_property_readonly("root_names", &Plan::root_names, "links that float, in the order of root_pose")
      .def_property_readonly("row_names", &Plan::row_names, "what a step holds or bounds; see Batch.row_states()")
      .def_property_readonly(
          "independent_dofs", [](const Plan& plan) { return names_of(plan, plan.independent_dofs()); },
          "names of the joints that place all others")
      .def_property_readonly(
          "driven_dofs", [](const Plan& plan) { return names_of(plan, plan.driven_dofs()); },
          "names of the joints, followers and tendons that have a drive: the columns of Batch.act()")
      .def_property_readonly(
          "coordinates", [](const Plan& plan) { return names_of(plan, coordinate_dofs(plan)); },
          "names of the joints that Batch.linearize() takes for the state: no hard coupling or loop places them")
      .def_property_readonly(
          "open_coordinates", [](const Plan& plan) { return names_of(plan, open_coordinate_dofs(plan)); },
          "names of the joints of Batch.mass_matrix(): the coordinates with all loops open")
      .def_property_readonly("followers", &followers_of, "{follower: (((leader, ratio), ...), offset)}")
      .def_property_readonly(
          "poses",
          [](const Plan& plan) {
            std::vector<std::string> names;
            for (const NamedPose& pose : plan.model().poses) names.push_back(pose.name);
            return names;
          },
          "names of the model's poses, for Batch.reset_to()")
      .def_property_readonly("vary", &varied, "the fields that differ from environment to environment")
      .def_property_readonly("limits", &limits_of, "[nv, 2] lower and upper position limits, rad or m")
      .def_property_readonly("hash", &Plan::hash, "64 bits, of model and settings")
      .def_property_readonly("stage_times", &Plan::stage_times, "when in a step inputs are used, as shares of dt")
      .def(
          "parameter_rows",
          [](const Plan& plan, const std::string& name) { return plan.parameter_row_names(parameter_of(name)); },
          "name"_a, "names of the columns of Batch.parameter(name)")
      .def("dof", &Plan::dof, "joint"_a, "the joint's column in q")
      .def("link", &Plan::link, "name"_a, "the link's number")
      .def("site", &Plan::site, "name"_a, "the site's number")
      .def("contact", &Plan::contact, "name"_a, "the pair's number, by a name of Plan.contact_names")
      .def(
          "obstacles",
          [](const Plan& plan) {
            py::list all;
            for (const Obstacle& o : plan.obstacles())
              all.append(py::dict("feature"_a = o.feature, "applies_to"_a = o.applies_to, "reason"_a = o.reason,
                                  "remedy"_a = o.remedy));
            return all;
          },
          "what keeps methods, integrators, 'folding' of soft couplings, bounds in 'stages' and the 'audit' from "
          "applying: dicts of feature, applies_to, reason, remedy")
      .def("describe", &Plan::describe, "in words: what a step does, by which method and why, and what it costs")
      .def(
          "batch", &make_batch, "num_envs"_a, py::kw_only(), "threads"_a = 0, "seed"_a = 0, "first_id"_a = 0,
          "dtype"_a = "f4", "target"_a = "automatic", "engine"_a = "automatic", "memory_domain"_a = -1,
          "num_envs environments in the model's state. threads: 1 is the calling thread, 0 as many as this process may "
          "use, by its affinity mask and its control group's quota. seed, first_id: what random numbers depend on, see "
          "Batch.draw(). dtype: 'f4' or 'f8'. memory_domain: holds threads and memory to one (NUMA node), see "
          "BatchOptions in lockstep/batch.h.")
      .def("__reduce__",
           [](const py::object& self) {
             const Plan& plan = self.cast<const Plan&>();
             return py::make_tuple(py::module_::import("lockstep.model").attr("recompiled"),
                                   py::make_tuple(to_python(plan.model()), settings_of(plan)));
           })
      .def("__deepcopy__", [](const py::object& self, const py::dict&) { return self; })
      .def("__getattr__",
           [](const Plan&, const std::string& name) -> py::object {
             const bool old = name == "driven" || name == "independent";
             throw py::attribute_error("a Plan has no '" + name + "'" + (old ? "; give '" + name + "_dofs'" : ""));
           })
      .def("__repr__", [](const Plan& plan) {
        return "<lockstep.Plan of '" + plan.model().name + "': " + std::to_string(plan.dofs()) + " dofs, " +
               to_string(plan.method()) + ", " + to_string(plan.integrator()) + ">";
      });

  const StepSettings defaults;
  module.def("compile", &compiled, "model"_a, py::kw_only(), "dt"_a = defaults.dt, "vary"_a = py::tuple(),
             "method"_a = "automatic", "integrator"_a = "automatic", "iterations"_a = defaults.iterations,
             "velocity_iterations"_a = defaults.velocity_iterations, "ignore"_a = py::none(), "stage_inputs"_a = false,
             "record_impulses"_a = false, "diagnostics"_a = false, "record_efforts"_a = false,
             "record_contacts"_a = false, "record_accelerations"_a = false, "guard"_a = defaults.guard,
             "position_bound"_a = defaults.position_bound, "velocity_bound"_a = defaults.velocity_bound,
             "contact_settings"_a = "default", "contact_passes"_a = py::none(), "contact_rounds"_a = py::none(),
             "contact_tolerance"_a = py::none(),
             "Validates and compiles a Model. dt: s. vary: fields that differ from environment to environment. "
             "method: 'automatic', 'reduced', 'direct', 'pgs' or 'tgs'; iterations (1 to 1000) and "
             "velocity_iterations (0 to 1000) are theirs. integrator: 'automatic', 'euler', 'leapfrog', "
             "'extrapolated' or 'runge_kutta'. ignore: bounds that are left out, as names or {name: True | joints | "
             "'followers'}. stage_inputs: targets and efforts for each of Plan.stage_times. guard: the largest error "
             "of momentum in a step, above 0; beyond it the step is halved, and what is too coarse even then gets the "
             "fault too_fast. Positions and velocities beyond position_bound and velocity_bound get the fault "
             "diverged. record_impulses: keep what Batch.coupling_impulse() reads. diagnostics: keep what "
             "Batch.row_states(), row_residuals(), conflicts() and energy_balance() read. contact_settings: 'learning' "
             "is faster, 'default' for grasps and legs, 'accurate' near the exact law; contact_passes (1 to 100), "
             "contact_rounds (1 to 1000) and contact_tolerance (above 0, up to 0.1) override its numbers. "
             "record_efforts: keep the drives' efforts for read('drive_effort'). record_contacts: keep "
             "what pairs did for read('contact_time') and its like. record_accelerations: keep those of the last step "
             "for read('joint_acceleration') and its like. Raises "
             "ModelError, SettingsError.");
}

}  // namespace lockstep::python
