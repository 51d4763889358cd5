// The C interface: failures, models and plans. SPDX-License-Identifier: Apache-2.0
#include "border.h"

namespace lockstep::c {
namespace {

thread_local std::string message, export_report;
thread_local const char* failure_code = "";

// The names of a list of the plan.
std::vector<const std::string*> names_of(const lockstep_plan& plan, int list) {
  std::vector<const std::string*> names;
  const auto dofs = [&](const std::vector<int>& chosen) {
    for (int dof : chosen) names.push_back(&plan.plan.dof_names()[static_cast<std::size_t>(dof)]);
  };
  const auto all = [&](const auto& elements, auto name) {
    for (const auto& element : elements) names.push_back(&(element.*name));
  };
  const Model& model = plan.plan.model();
  switch (list) {
    case LOCKSTEP_DOFS:
      for (const std::string& name : plan.plan.dof_names()) names.push_back(&name);
      break;
    case LOCKSTEP_INDEPENDENT: dofs(plan.plan.independent_dofs()); break;
    case LOCKSTEP_DRIVEN: dofs(plan.plan.driven_dofs()); break;
    case LOCKSTEP_COORDINATES: dofs(open_coordinate_dofs(plan.plan)); break;
    case LOCKSTEP_COUPLINGS:
      for (const std::string& name : plan.couplings) names.push_back(&name);
      break;
    case LOCKSTEP_LINKS: all(model.links, &Link::name); break;
    case LOCKSTEP_SITES: all(model.sites, &Site::name); break;
    case LOCKSTEP_ROOTS:
      for (const std::string& name : plan.plan.root_names()) names.push_back(&name);
      break;
    case LOCKSTEP_POSES: all(model.poses, &NamedPose::name); break;
    default: throw UsageError("list " + std::to_string(list), "is none of the enumerators", "see lockstep/c.h");
  }
  return names;
}

// Of an Import or Export.
template <class Result>
std::string report_of(const Result& result) {
  std::string report;
  for (const std::string& line : result.report) report += line + "\n";
  for (const std::string& line : result.warnings) report += "warning: " + line + "\n";
  return report;
}

lockstep_model* imported(Import&& import) {
  std::string report = report_of(import);
  return models().add(std::make_unique<lockstep_model>(std::move(import.model), std::move(report)));
}

}  // namespace

int failed(int status, const char* words, const char* code) noexcept {
  failure_code = code;
  try {
    message = words;
  } catch (...) {  // too little memory for the words
    message.clear();
  }
  return status;
}

}  // namespace lockstep::c

using namespace lockstep;
using namespace lockstep::c;

int lockstep_abi(void) { return 1; }
const char* lockstep_version(void) { return version(); }
const char* lockstep_message(void) { return message.c_str(); }
const char* lockstep_code(void) { return failure_code; }
const char* lockstep_fault_code(uint32_t fault) { return code_of(static_cast<Fault>(fault)); }

int lockstep_model_from_urdf(const char* path, lockstep_model** out) {
  return guarded([&] {
    *given(out, "out") = nullptr;
    *out = imported(import_urdf_file(given(path, "path")));
  });
}
int lockstep_model_from_urdf_text(const char* text, lockstep_model** out) {
  return guarded([&] {
    *given(out, "out") = nullptr;
    *out = imported(import_urdf(given(text, "text")));
  });
}
int lockstep_model_from_file(const char* path, const char* keyframe, const char* body, uint32_t flags,
                             lockstep_model** out) {
  return guarded([&] {
    *given(out, "out") = nullptr;
    require_bits(flags,
                 LOCKSTEP_LEAVE_OUT_LOOPS | LOCKSTEP_LEAVE_OUT_MESHES | LOCKSTEP_SOFT_AS_IN_FILE | LOCKSTEP_COLLIDERS,
                 "flags");
    ImportOptions options;
    options.keyframe = keyframe ? keyframe : "", options.body = body ? body : "";
    if (flags & LOCKSTEP_LEAVE_OUT_LOOPS) options.loops = Loops::leave_out;
    if (flags & LOCKSTEP_SOFT_AS_IN_FILE) options.soft = Soft::as_in_file;
    options.leave_out_meshes = (flags & LOCKSTEP_LEAVE_OUT_MESHES) != 0;
    options.colliders = (flags & LOCKSTEP_COLLIDERS) != 0;
    *out = imported(import_file(given(path, "path"), options));
  });
}
int lockstep_model_report(const lockstep_model* model, const char** out) {
  return guarded([&] { *given(out, "out") = models().at(model, "model").report.c_str(); });
}
int lockstep_model_export(const lockstep_model* model, const char* path, double timestep, const char** report) {
  return guarded([&] {
    MjcfOptions options;
    if (timestep != 0.0) options.timestep = timestep;
    export_report = report_of(export_file(models().at(model, "model").model, given(path, "path"), options));
    if (report) *report = export_report.c_str();
  });
}
int lockstep_model_set_drive(lockstep_model* model, const char* joint, double kp, double kd) {
  return guarded([&] {
    Model& own = models().at(model, "model").model;
    Drive& drive = own.joints[static_cast<std::size_t>(own.joint_index(given(joint, "joint")))].drive;
    drive.kp = kp, drive.kd = kd;
  });
}
int lockstep_model_add_site(lockstep_model* model, const char* name, const char* link, const double pose[7]) {
  return guarded([&] {
    Pose at = Pose::Identity();
    const double* const p = given(pose, "pose");
    at.translation() = Eigen::Vector3d(p[0], p[1], p[2]);
    const Eigen::Quaterniond turn(p[3], p[4], p[5], p[6]);
    if (!(turn.norm() > 0.0)) throw UsageError("pose", "has no rotation", "give a quaternion w, x, y, z");
    at.linear() = turn.normalized().toRotationMatrix();
    models().at(model, "model").model.sites.push_back({given(name, "name"), given(link, "link"), at});
  });
}
void lockstep_model_free(lockstep_model* model) { end(models(), model, "model"); }

void lockstep_settings_init(lockstep_settings* settings) {
  const StepSettings defaults;
  if (settings)
    *settings = {sizeof(lockstep_settings),
                 0,
                 defaults.dt,
                 defaults.guard,
                 "automatic",
                 "automatic",
                 defaults.iterations,
                 defaults.velocity_iterations,
                 0,
                 0,
                 0,
                 0,
                 0,
                 0};
}
int lockstep_compile(const lockstep_model* model, const lockstep_settings* settings, lockstep_plan** out) {
  return guarded([&] {
    *given(out, "out") = nullptr;
    const lockstep_settings from = known(settings, lockstep_settings_init, "settings");
    StepSettings to;
    to.dt = from.dt, to.guard = from.guard;
    to.method = enumerator("method", from.method, Method::reduced);
    to.integrator = enumerator("integrator", from.integrator, Integrator::runge_kutta);
    to.iterations = from.iterations, to.velocity_iterations = from.velocity_iterations;
    for (unsigned p = 0; p < 32; ++p)
      if (from.per_environment >> p & 1u) to.per_environment.insert(static_cast<Parameter>(p));
    to.stage_inputs = truth(from.stage_inputs, "stage_inputs");
    to.record_impulses = truth(from.record_impulses, "record_impulses");
    to.record_diagnostics = truth(from.record_diagnostics, "record_diagnostics");
    to.record_efforts = truth(from.record_efforts, "record_efforts");
    to.record_contacts = truth(from.record_contacts, "record_contacts");
    to.record_accelerations = truth(from.record_accelerations, "record_accelerations");
    const Model& own = models().at(model, "model").model;
    *out = plans().add(std::make_unique<lockstep_plan>(compile(own, to), coupling_names(own)));
  });
}
void lockstep_plan_free(lockstep_plan* plan) { end(plans(), plan, "plan"); }

int lockstep_plan_count(const lockstep_plan* plan, int list, int64_t* out) {
  return guarded([&] { *given(out, "out") = static_cast<int64_t>(names_of(plans().at(plan, "plan"), list).size()); });
}
int lockstep_plan_name(const lockstep_plan* plan, int list, int64_t index, const char** out) {
  return guarded([&] {
    const std::vector<const std::string*> names = names_of(plans().at(plan, "plan"), list);
    if (index < 0 || index >= static_cast<int64_t>(names.size()))
      throw UsageError("index " + std::to_string(index), "is outside the list of " + std::to_string(names.size()),
                       "see lockstep_plan_count()");
    *given(out, "out") = names[static_cast<std::size_t>(index)]->c_str();
  });
}
int lockstep_plan_index(const lockstep_plan* plan, int list, const char* name, int64_t* out) {
  return guarded([&] {
    const std::vector<const std::string*> names = names_of(plans().at(plan, "plan"), list);
    given(name, "name");
    for (std::size_t i = 0; i < names.size(); ++i)
      if (*names[i] == name) {
        *given(out, "out") = static_cast<int64_t>(i);
        return;
      }
    throw UsageError("'" + std::string(name) + "'", "is not in the list", "see lockstep_plan_name()");
  });
}
int lockstep_plan_describe(lockstep_plan* plan, const char** out) {
  return guarded([&] {
    lockstep_plan& own = plans().at(plan, "plan");
    std::call_once(own.described, [&] { own.description = own.plan.describe(); });
    *given(out, "out") = own.description.c_str();
  });
}
