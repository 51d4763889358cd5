// The C interface: lockstep/c.h over Model, Plan and Batch. SPDX-License-Identifier: Apache-2.0
#include "lockstep/c.h"

#include <cstring>
#include <mutex>
#include <new>
#include <variant>

#include "lockstep/lockstep.h"

struct lockstep_model {
  lockstep::Model model;
  std::string report;  // of the importer, line by line
};

struct lockstep_plan {
  lockstep::Plan plan;
  std::vector<std::string> couplings;
  std::once_flag described = {};
  std::string description = {};
};

struct lockstep_batch {
  std::variant<std::unique_ptr<lockstep::Batch<float>>, std::unique_ptr<lockstep::Batch<double>>> batch;

  template <class Use>
  decltype(auto) use(Use&& use) const {
    return std::visit([&](const auto& own) -> decltype(auto) { return use(*own); }, batch);
  }
};

namespace lockstep {
namespace {

thread_local std::string message;

int failed(int status, const char* words) noexcept {
  try {
    message = words;
  } catch (...) {  // too little memory for the words
    message.clear();
  }
  return status;
}

// Runs a function and turns what it throws into a status.
template <class Function>
int guarded(Function&& function) noexcept {
  try {
    function();
    return LOCKSTEP_OK;
  } catch (const ModelError& error) {
    return failed(LOCKSTEP_MODEL_ERROR, error.what());
  } catch (const ImportError& error) {
    return failed(LOCKSTEP_IMPORT_ERROR, error.what());
  } catch (const SettingsError& error) {
    return failed(LOCKSTEP_SETTINGS_ERROR, error.what());
  } catch (const UsageError& error) {
    return failed(LOCKSTEP_USAGE_ERROR, error.what());
  } catch (const std::bad_alloc&) {
    return failed(LOCKSTEP_MEMORY_ERROR, "memory: there is not enough; free some, or use a smaller batch");
  } catch (const std::exception& error) {
    return failed(LOCKSTEP_INTERNAL_ERROR, error.what());
  } catch (...) {
    return failed(LOCKSTEP_INTERNAL_ERROR, "an unknown exception");
  }
}

template <class Pointer>
Pointer given(Pointer pointer, const char* name) {
  if (!pointer) throw UsageError(name, "is null", "give an object");
  return pointer;
}

// A struct that a program filled: as much of it as both sides know, the rest as _init leaves it.
template <class Struct>
Struct known(const Struct* from, void (*initialise)(Struct*), const char* name) {
  Struct own;
  initialise(&own);
  if (!from) return own;
  if (from->size < 2 * sizeof(uint32_t) || from->size > 4096)
    throw UsageError(name, "has the size " + std::to_string(from->size), "fill it by its _init function first");
  std::memcpy(&own, from, std::min<std::size_t>(from->size, sizeof own));
  const auto* bytes = reinterpret_cast<const unsigned char*>(from);
  for (std::size_t i = sizeof own; i < from->size; ++i)
    if (bytes[i] != 0)
      throw UsageError(name, "has members that this version does not know", "set them to 0, or use a newer library");
  return own;
}

template <class Enum>
Enum enumerator(const char* setting, const char* name, Enum last) {
  for (int i = 0; i <= static_cast<int>(last); ++i)
    if (name && std::strcmp(name, to_string(static_cast<Enum>(i))) == 0) return static_cast<Enum>(i);
  throw SettingsError(setting, name ? "'" + std::string(name) + "' is unknown" : "is null", "see lockstep/c.h");
}

template <class Enum>
Enum numbered(const char* name, int32_t number, Enum last) {
  if (number < 0 || number > static_cast<int32_t>(last))
    throw UsageError(std::string(name) + " " + std::to_string(number), "is none of the enumerators",
                     "see lockstep/c.h");
  return static_cast<Enum>(number);
}

void require_count(int64_t n) {
  if (n < 0) throw UsageError("n", "is " + std::to_string(n), "give the number of entries");
}

void require_zero(int64_t value, const char* name) {
  if (value != 0) throw UsageError(name, "is " + std::to_string(value), "set it to 0, or to what lockstep/c.h lists");
}

bool truth(int32_t value, const char* name) {
  require_zero(value & ~1, name);
  return value != 0;
}

ResetOptions reset_options(uint32_t flags) {
  require_zero(flags & ~static_cast<uint32_t>(LOCKSTEP_KEEP_INPUTS), "flags");
  return {.keep_inputs = flags != 0};
}

EnvironmentSet environments(const uint8_t* mask, int64_t n) {
  require_count(n);
  if (!mask && n == 0) return EnvironmentSet::all();
  return EnvironmentSet(std::span<const uint8_t>(given(mask, "mask"), static_cast<std::size_t>(n)));
}

template <class S>
constexpr int32_t type_of = sizeof(S) == 4 ? LOCKSTEP_F32 : LOCKSTEP_F64;

template <class View>
lockstep_array array_of(View view) {
  using S = typename View::Scalar;
  return {sizeof(lockstep_array),
          0,
          view.data(),
          type_of<S>,
          2,
          {view.rows(), view.cols()},
          {static_cast<int64_t>(view.outerStride() * static_cast<Eigen::Index>(sizeof(S))), sizeof(S)}};
}

template <class Number>
lockstep_array array_of(std::span<Number> numbers, bool writable) {
  return {sizeof(lockstep_array),
          writable ? 0u : static_cast<uint32_t>(LOCKSTEP_READ_ONLY),
          const_cast<std::remove_const_t<Number>*>(numbers.data()),
          sizeof(Number) == 4 ? LOCKSTEP_U32 : LOCKSTEP_U64,
          2,
          {1, static_cast<int64_t>(numbers.size())},
          {static_cast<int64_t>(numbers.size_bytes()), sizeof(Number)}};
}

template <class S>
lockstep_array field_of(Batch<S>& batch, int field) {
  switch (field) {
    case LOCKSTEP_POSITIONS: return array_of(batch.positions());
    case LOCKSTEP_VELOCITIES: return array_of(batch.velocities());
    case LOCKSTEP_POSITION_TARGETS: return array_of(batch.position_targets());
    case LOCKSTEP_VELOCITY_TARGETS: return array_of(batch.velocity_targets());
    case LOCKSTEP_EFFORTS: return array_of(batch.efforts());
    case LOCKSTEP_ROOT_POSES: return array_of(batch.root_poses());
    case LOCKSTEP_ROOT_VELOCITIES: return array_of(batch.root_velocities());
    case LOCKSTEP_FAULTS: return array_of(batch.faults(), false);
    case LOCKSTEP_STEPS: return array_of(batch.steps(), false);
    case LOCKSTEP_EPISODES: return array_of(batch.resets(), true);
    case LOCKSTEP_IDS: return array_of(batch.ids(), true);
    case LOCKSTEP_SEEDS: return array_of(batch.seeds(), true);
    default: break;
  }
  if (field < LOCKSTEP_PARAMETER)
    throw UsageError("field " + std::to_string(field), "is none of the enumerators", "see lockstep/c.h");
  return array_of(batch.parameter(static_cast<Parameter>(field - LOCKSTEP_PARAMETER)));
}

// An array of a caller as rows: [rows][environments].
template <class S>
StridedRows<S> rows_of(const lockstep_array* array, int64_t rows, int64_t environments, const char* name) {
  given(array, name);
  constexpr int64_t item = sizeof(S);
  if (array->type != type_of<std::remove_const_t<S>> || array->rank != 2)
    throw UsageError(name, "has another type or rank than the batch", "give two dimensions of the batch's precision");
  if (array->shape[0] != rows || array->shape[1] != environments)
    throw UsageError(name, "has the shape " + std::to_string(array->shape[0]) + " x " + std::to_string(array->shape[1]),
                     "give " + std::to_string(rows) + " rows x " + std::to_string(environments) + " environments");
  if (array->stride[0] % item != 0 || array->stride[1] % item != 0 ||
      reinterpret_cast<std::uintptr_t>(array->data) % item != 0)
    throw UsageError(name, "has data or strides that are no multiples of its numbers", "align the numbers");
  if (!std::is_const_v<S> && (array->flags & LOCKSTEP_READ_ONLY) != 0)
    throw UsageError(name, "is read-only", "give memory to write to");
  return {static_cast<S*>(given(array->data, name)), array->stride[0] / item, array->stride[1] / item};
}

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
    case LOCKSTEP_COUPLINGS:
      for (const std::string& name : plan.couplings) names.push_back(&name);
      break;
    case LOCKSTEP_LINKS: all(model.links, &Link::name); break;
    case LOCKSTEP_SITES: all(model.sites, &Site::name); break;
    case LOCKSTEP_ROOTS:
      for (const std::string& name : plan.plan.root_names()) names.push_back(&name);
      break;
    default: throw UsageError("list " + std::to_string(list), "is none of the enumerators", "see lockstep/c.h");
  }
  return names;
}

constexpr Quantity quantities[] = {Quantity::position,       Quantity::velocity,        Quantity::position_target,
                                   Quantity::link_pose,      Quantity::link_velocity,   Quantity::site_pose,
                                   Quantity::site_position,  Quantity::site_velocity,   Quantity::coupling_error,
                                   Quantity::kinetic_energy, Quantity::potential_energy};

void initialise(lockstep_query* query) { *query = {sizeof(lockstep_query), 0, -1, 0, 1.0}; }

std::vector<Query> queries_of(const lockstep_query* queries, int64_t count) {
  if (count < 0) throw UsageError("count", "is negative", "give the number of queries");
  std::vector<Query> all;
  const std::byte* at = reinterpret_cast<const std::byte*>(count > 0 ? given(queries, "queries") : nullptr);
  for (int64_t i = 0; i < count; ++i) {
    const auto* from = reinterpret_cast<const lockstep_query*>(at);
    const lockstep_query query = known(from, initialise, "query");
    if (query.quantity < 0 || query.quantity >= static_cast<int32_t>(std::size(quantities)))
      throw UsageError("quantity " + std::to_string(query.quantity), "is none of the enumerators", "see lockstep/c.h");
    require_zero(query.reserved, "reserved member of a query");
    if (query.row < -1) throw UsageError("row " + std::to_string(query.row), "is negative", "give -1 for all rows");
    all.push_back({quantities[query.quantity], {}, query.scale});
    if (query.row >= 0) all.back().elements = {query.row};
    at += from->size;
  }
  return all;
}

lockstep_model* imported(Import&& import) {
  std::string report;
  for (const std::string& line : import.report) report += line + "\n";
  for (const std::string& line : import.warnings) report += "warning: " + line + "\n";
  return new lockstep_model{std::move(import.model), std::move(report)};
}

}  // namespace
}  // namespace lockstep

using namespace lockstep;

int lockstep_abi(void) { return 1; }
const char* lockstep_version(void) { return version(); }
const char* lockstep_message(void) { return message.c_str(); }

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
int lockstep_model_report(const lockstep_model* model, const char** out) {
  return guarded([&] { *given(out, "out") = given(model, "model")->report.c_str(); });
}
int lockstep_model_set_drive(lockstep_model* model, const char* joint, double kp, double kd) {
  return guarded([&] {
    Model& own = given(model, "model")->model;
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
    given(model, "model")->model.sites.push_back({given(name, "name"), given(link, "link"), at});
  });
}
void lockstep_model_free(lockstep_model* model) { delete model; }

void lockstep_settings_init(lockstep_settings* settings) {
  const StepSettings defaults;
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
    require_zero(from.reserved, "reserved member of the settings");
    const Model& own = given(model, "model")->model;
    *out = new lockstep_plan{compile(own, to), coupling_names(own)};
  });
}
void lockstep_plan_free(lockstep_plan* plan) { delete plan; }

int lockstep_plan_count(const lockstep_plan* plan, int list, int64_t* out) {
  return guarded([&] { *given(out, "out") = static_cast<int64_t>(names_of(*given(plan, "plan"), list).size()); });
}
int lockstep_plan_name(const lockstep_plan* plan, int list, int64_t index, const char** out) {
  return guarded([&] {
    const std::vector<const std::string*> names = names_of(*given(plan, "plan"), list);
    if (index < 0 || index >= static_cast<int64_t>(names.size()))
      throw UsageError("index " + std::to_string(index), "is outside the list of " + std::to_string(names.size()),
                       "see lockstep_plan_count()");
    *given(out, "out") = names[static_cast<std::size_t>(index)]->c_str();
  });
}
int lockstep_plan_index(const lockstep_plan* plan, int list, const char* name, int64_t* out) {
  return guarded([&] {
    const std::vector<const std::string*> names = names_of(*given(plan, "plan"), list);
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
    std::call_once(given(plan, "plan")->described, [&] { plan->description = plan->plan.describe(); });
    *given(out, "out") = plan->description.c_str();
  });
}

void lockstep_options_init(lockstep_options* options) { *options = {sizeof(lockstep_options), 0, 0, 1, 0, 32}; }
int lockstep_batch_new(const lockstep_plan* plan, const lockstep_options* options, lockstep_batch** out) {
  return guarded([&] {
    *given(out, "out") = nullptr;
    const lockstep_options from = known(options, lockstep_options_init, "options");
    const BatchOptions to{.threads = from.threads, .seed = from.seed, .first_id = from.first_id};
    const Plan& own = given(plan, "plan")->plan;
    if (from.environments < 1 || from.environments > INT32_MAX)
      throw SettingsError("environments", "is " + std::to_string(from.environments), "give 1 or more");
    const int count = static_cast<int>(from.environments);
    auto batch = std::make_unique<lockstep_batch>();
    if (from.precision == 32)
      batch->batch = std::make_unique<Batch<float>>(own, count, to);
    else if (from.precision == 64)
      batch->batch = std::make_unique<Batch<double>>(own, count, to);
    else
      throw SettingsError("precision", "is " + std::to_string(from.precision), "give 32 or 64");
    *out = batch.release();
  });
}
void lockstep_batch_free(lockstep_batch* batch) { delete batch; }

int lockstep_field(lockstep_batch* batch, int field, lockstep_array* out) {
  return guarded([&] {
    given(out, "out");
    *out = given(batch, "batch")->use([&](auto& own) { return field_of(own, field); });
  });
}

int lockstep_step(lockstep_batch* batch, int32_t substeps) {
  return guarded([&] {
    if (substeps < 1) throw UsageError("substeps", "is " + std::to_string(substeps), "give 1 or more");
    if (!given(batch, "batch")->use([&](auto& own) { return own.step(substeps); }))
      throw UsageError("batch", "is in use by another thread", "call its functions one after the other");
  });
}

int lockstep_reset_mask(lockstep_batch* batch, const uint8_t* mask, int64_t n, uint32_t flags) {
  return guarded([&] {
    const ResetOptions options = reset_options(flags);
    given(batch, "batch")->use([&](auto& own) { own.reset(environments(mask, n), options); });
  });
}
int lockstep_reset_ids(lockstep_batch* batch, const int32_t* ids, int64_t n, uint32_t flags) {
  return guarded([&] {
    const ResetOptions options = reset_options(flags);
    require_count(n);
    const std::span<const int> chosen(n > 0 ? given(ids, "ids") : ids, static_cast<std::size_t>(n));
    given(batch, "batch")->use([&](auto& own) {
      own.reset(!ids && n == 0 ? EnvironmentSet::all() : EnvironmentSet(chosen), options);
    });
  });
}
int lockstep_reset_random(lockstep_batch* batch, const uint8_t* mask, int64_t n, double spread, double speed) {
  return guarded([&] {
    RandomReset random;
    random.spread = spread, random.speed = speed;
    given(batch, "batch")->use([&](auto& own) { own.reset_random(environments(mask, n), random); });
  });
}
int lockstep_project(lockstep_batch* batch, const uint8_t* mask, int64_t n) {
  return guarded([&] { given(batch, "batch")->use([&](auto& own) { own.project(environments(mask, n)); }); });
}

void lockstep_randomization_init(lockstep_randomization* randomization) {
  *randomization = {sizeof(lockstep_randomization), LOCKSTEP_MASS, LOCKSTEP_SCALE, LOCKSTEP_UNIFORM, 1.0, 1.0, 0, 0};
}
int lockstep_randomize(lockstep_batch* batch, const lockstep_randomization* randomization, const uint8_t* mask,
                       int64_t n) {
  return guarded([&] {
    const lockstep_randomization from =
        known(given(randomization, "randomization"), lockstep_randomization_init, "randomization");
    Randomization to;
    to.change = numbered("operation", from.operation, Change::absolute);
    to.distribution = numbered("distribution", from.distribution, Distribution::normal);
    to.low = from.low, to.high = from.high, to.stream = from.stream, to.shared = truth(from.shared, "shared");
    given(batch, "batch")->use([&](auto& own) {
      own.randomize(static_cast<Parameter>(from.parameter), to, environments(mask, n));
    });
  });
}

int lockstep_act(lockstep_batch* batch, const lockstep_array* actions) {
  return guarded([&] {
    given(batch, "batch")->use([&]<class S>(Batch<S>& own) {
      const int64_t driven = static_cast<int64_t>(own.plan().driven_dofs().size());
      own.set_actions(rows_of<const S>(actions, driven, own.environments(), "actions"));
    });
  });
}

int lockstep_read(lockstep_batch* batch, const lockstep_query* queries, int64_t count, const lockstep_array* out) {
  return guarded([&] {
    const std::vector<Query> wanted = queries_of(queries, count);
    given(batch, "batch")->use([&]<class S>(Batch<S>& own) {
      int64_t rows = 0;
      for (const Query& query : wanted) rows += own.plan().query_rows(query);
      own.read(wanted, rows_of<S>(out, rows, own.environments(), "out"));
    });
  });
}

int lockstep_save(const lockstep_batch* batch, void* to, uint64_t* bytes) {
  return guarded([&] {
    const std::vector<std::byte> blob = given(batch, "batch")->use([](auto& own) { return own.save(); });
    const uint64_t room = *given(bytes, "bytes");
    *bytes = blob.size();
    if (!to) return;
    if (room < blob.size())
      throw UsageError("bytes", "is " + std::to_string(room) + ", too little", "give " + std::to_string(blob.size()));
    std::memcpy(to, blob.data(), blob.size());
  });
}
int lockstep_restore(lockstep_batch* batch, const void* from, uint64_t bytes) {
  return guarded([&] {
    const std::span<const std::byte> blob(static_cast<const std::byte*>(given(from, "from")), bytes);
    given(batch, "batch")->use([&](auto& own) { own.restore(blob); });
  });
}

int lockstep_explain_fault(const lockstep_batch* batch, int64_t environment, char* text, uint64_t size) {
  return guarded([&] {
    if (size == 0) throw UsageError("size", "is 0", "give room for the words");
    const int place = environment >= 0 && environment <= INT32_MAX ? static_cast<int>(environment) : -1;
    const std::string words = given(batch, "batch")->use([&](auto& own) { return own.explain_fault(place); });
    const std::size_t length = std::min<std::size_t>(words.size(), size - 1);
    std::memcpy(given(text, "text"), words.data(), length);
    text[length] = '\0';
  });
}
