// The C interface: batches. SPDX-License-Identifier: Apache-2.0
#include "border.h"

namespace lockstep::c {
namespace {

ResetOptions reset_options(uint32_t flags) {
  require_bits(flags, LOCKSTEP_KEEP_INPUTS, "flags");
  return {.keep_inputs = flags != 0};
}

std::vector<RootNoise> roots_of(const lockstep_root_noise* roots, int64_t count) {
  if (count < 0) throw UsageError("root_count", "is negative", "give the number of roots");
  std::vector<RootNoise> all;
  const std::byte* at = reinterpret_cast<const std::byte*>(count > 0 ? given(roots, "roots") : nullptr);
  for (int64_t i = 0; i < count; ++i) {
    const auto* from = reinterpret_cast<const lockstep_root_noise*>(at);
    const lockstep_root_noise noise = known(from, lockstep_root_noise_init, "root noise");
    RootNoise to;
    to.link = noise.link ? noise.link : "", to.any_rotation = truth(noise.any_rotation, "any_rotation");
    to.position = Eigen::Vector3d(noise.position[0], noise.position[1], noise.position[2]);
    to.yaw = noise.yaw, to.angular_velocity = noise.angular_velocity, to.linear_velocity = noise.linear_velocity;
    all.push_back(std::move(to));
    at += from->size;
  }
  return all;
}

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

static_assert(LOCKSTEP_CONTACT_RESTITUTION == static_cast<int>(Parameter::contact_restitution));
static_assert(LOCKSTEP_CONTACT_RESTITUTION + 1 == parameter_count, "c.h has a name for each field");

constexpr Quantity quantities[] = {Quantity::position,
                                   Quantity::velocity,
                                   Quantity::position_target,
                                   Quantity::link_pose,
                                   Quantity::link_velocity,
                                   Quantity::site_pose,
                                   Quantity::site_position,
                                   Quantity::site_velocity,
                                   Quantity::coupling_error,
                                   Quantity::kinetic_energy,
                                   Quantity::potential_energy,
                                   Quantity::contact_force,
                                   Quantity::contact_normal_force,
                                   Quantity::contact_gap,
                                   Quantity::contact_slip,
                                   Quantity::contact_point,
                                   Quantity::unfinished_contacts,
                                   Quantity::solve_counts,
                                   Quantity::loop_error,
                                   Quantity::loop_force,
                                   Quantity::link_twist,
                                   Quantity::site_twist,
                                   Quantity::link_gravity,
                                   Quantity::site_gravity,
                                   Quantity::link_contact_force,
                                   Quantity::link_contacts,
                                   Quantity::drive_effort,
                                   Quantity::drive_effort_peak,
                                   Quantity::drive_effort_mean,
                                   Quantity::contact_peak_force,
                                   Quantity::contact_mean_force,
                                   Quantity::contact_time,
                                   Quantity::contact_air_time,
                                   Quantity::contact_last_time,
                                   Quantity::contact_last_air_time,
                                   Quantity::contact_first_touch,
                                   Quantity::joint_acceleration,
                                   Quantity::link_acceleration,
                                   Quantity::site_acceleration,
                                   Quantity::joint_wrench};

void initialise(lockstep_query* query) { *query = {sizeof(lockstep_query), 0, -1, 0, 1.0}; }

}  // namespace

std::vector<Query> queries_of(const lockstep_query* queries, int64_t count) {
  if (count < 0) throw UsageError("count", "is negative", "give the number of queries");
  std::vector<Query> all;
  const std::byte* at = reinterpret_cast<const std::byte*>(count > 0 ? given(queries, "queries") : nullptr);
  for (int64_t i = 0; i < count; ++i) {
    const auto* from = reinterpret_cast<const lockstep_query*>(at);
    const lockstep_query query = known(from, initialise, "query");
    if (query.quantity < 0 || query.quantity >= static_cast<int32_t>(std::size(quantities)))
      throw UsageError("quantity " + std::to_string(query.quantity), "is none of the enumerators", "see lockstep/c.h");
    require_bits(query.reserved, 0, "reserved member of a query");
    if (query.row < -1) throw UsageError("row of query", "is " + std::to_string(query.row), "give -1 for all rows");
    all.push_back({quantities[query.quantity], {}, query.scale});
    if (query.row >= 0) all.back().elements = {query.row};
    at += from->size;
  }
  return all;
}

}  // namespace lockstep::c

using namespace lockstep;
using namespace lockstep::c;

void lockstep_options_init(lockstep_options* options) {
  if (options) *options = {sizeof(lockstep_options), 0, 0, 1, 0, 32};
}
int lockstep_batch_new(const lockstep_plan* plan, const lockstep_options* options, lockstep_batch** out) {
  return guarded([&] {
    *given(out, "out") = nullptr;
    const lockstep_options from = known(options, lockstep_options_init, "options");
    const BatchOptions to{.threads = from.threads, .seed = from.seed, .first_id = from.first_id};
    const Plan& own = plans().at(plan, "plan").plan;
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
    *out = batches().add(std::move(batch));
  });
}
void lockstep_batch_free(lockstep_batch* batch) { end(batches(), batch, "batch"); }

int lockstep_field(lockstep_batch* batch, int field, lockstep_array* out) {
  return guarded([&] {
    given(out, "out");
    *out = batches().at(batch, "batch").use([&](auto& own) { return field_of(own, field); });
  });
}

int lockstep_step(lockstep_batch* batch, int32_t substeps) {
  return guarded([&] {
    if (substeps < 1) throw UsageError("substeps", "is " + std::to_string(substeps), "give 1 or more");
    if (!batches().at(batch, "batch").use([&](auto& own) { return own.step(substeps); }))
      throw UsageError("batch", "is in use by another thread", "call its functions one after the other");
  });
}

int lockstep_reset_mask(lockstep_batch* batch, const uint8_t* mask, int64_t n, uint32_t flags) {
  return guarded([&] {
    const ResetOptions options = reset_options(flags);
    batches().at(batch, "batch").use([&](auto& own) { own.reset(environments(mask, n), options); });
  });
}
int lockstep_reset_ids(lockstep_batch* batch, const int32_t* ids, int64_t n, uint32_t flags) {
  return guarded([&] {
    const ResetOptions options = reset_options(flags);
    require_count(n);
    const std::span<const int> chosen(n > 0 ? given(ids, "ids") : ids, static_cast<std::size_t>(n));
    batches().at(batch, "batch").use([&](auto& own) {
      own.reset(!ids && n == 0 ? EnvironmentSet::all() : EnvironmentSet(chosen), options);
    });
  });
}
void lockstep_root_noise_init(lockstep_root_noise* noise) {
  if (noise) *noise = {sizeof(lockstep_root_noise), 0, nullptr, {0.0, 0.0, 0.0}, 0.0, 0.0, 0.0};
}
void lockstep_pose_noise_init(lockstep_pose_noise* noise) {
  if (noise) *noise = {sizeof(lockstep_pose_noise), 0, 0.0, 0.0, 0.0, nullptr, 0, 0, 0};
}
int lockstep_reset_to(lockstep_batch* batch, const char* pose, const lockstep_pose_noise* noise, const uint8_t* mask,
                      int64_t n) {
  return guarded([&] {
    const lockstep_pose_noise from = known(noise, lockstep_pose_noise_init, "noise");
    require_bits(from.reserved, 0, "reserved member of the noise");
    PoseNoise to;
    to.position = from.position, to.spread = from.spread, to.velocity = from.velocity, to.stream = from.stream;
    to.keep_inputs = reset_options(from.flags).keep_inputs;
    to.roots = roots_of(from.roots, from.root_count);
    batches().at(batch, "batch").use([&](auto& own) { own.reset_to(environments(mask, n), pose ? pose : "", to); });
  });
}
int lockstep_copy(lockstep_batch* batch, int64_t from, const uint8_t* mask, int64_t n) {
  return guarded([&] {
    const int place = from >= 0 && from <= INT32_MAX ? static_cast<int>(from) : -1;
    batches().at(batch, "batch").use([&](auto& own) { own.copy(place, environments(mask, n)); });
  });
}
int lockstep_reset_random(lockstep_batch* batch, const uint8_t* mask, int64_t n, double spread, double speed) {
  return guarded([&] {
    RandomReset random;
    random.spread = spread, random.speed = speed;
    batches().at(batch, "batch").use([&](auto& own) { own.reset_random(environments(mask, n), random); });
  });
}
int lockstep_project(lockstep_batch* batch, const uint8_t* mask, int64_t n) {
  return guarded([&] { batches().at(batch, "batch").use([&](auto& own) { own.project(environments(mask, n)); }); });
}

void lockstep_randomization_init(lockstep_randomization* randomization) {
  if (randomization)
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
    batches().at(batch, "batch").use([&](auto& own) {
      own.randomize(static_cast<Parameter>(from.parameter), to, environments(mask, n));
    });
  });
}

int lockstep_act(lockstep_batch* batch, const lockstep_array* actions) {
  return guarded([&] {
    batches().at(batch, "batch").use([&]<class S>(Batch<S>& own) {
      const int64_t driven = static_cast<int64_t>(own.plan().driven_dofs().size());
      own.set_actions(rows_of<const S>(actions, driven, own.environments(), "actions"));
    });
  });
}

int lockstep_read(lockstep_batch* batch, const lockstep_query* queries, int64_t count, const lockstep_array* out) {
  return guarded([&] {
    const std::vector<Query> wanted = queries_of(queries, count);
    batches().at(batch, "batch").use([&]<class S>(Batch<S>& own) {
      int64_t rows = 0;
      for (const Query& query : wanted) rows += own.plan().query_rows(query);
      own.read(wanted, rows_of<S>(out, rows, own.environments(), "out"));
    });
  });
}

int lockstep_save(const lockstep_batch* batch, void* to, uint64_t* bytes) {
  return guarded([&] {
    const std::vector<std::byte> blob = batches().at(batch, "batch").use([](auto& own) { return own.save(); });
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
    batches().at(batch, "batch").use([&](auto& own) { own.restore(blob); });
  });
}

int lockstep_explain_fault(const lockstep_batch* batch, int64_t environment, char* text, uint64_t size) {
  return guarded([&] {
    if (size == 0) throw UsageError("size", "is 0", "give room for the words");
    const int place = environment >= 0 && environment <= INT32_MAX ? static_cast<int>(environment) : -1;
    const std::string words = batches().at(batch, "batch").use([&](auto& own) { return own.explain_fault(place); });
    const std::size_t length = std::min<std::size_t>(words.size(), size - 1);
    std::memcpy(given(text, "text"), words.data(), length);
    text[length] = '\0';
  });
}
