// Sequences of calls through the C interface, with handles that were freed, of other kinds, and null.
// SPDX-License-Identifier: Apache-2.0
#include <fuzzer/FuzzedDataProvider.h>

#include <cmath>
#include <vector>

#include "fuzz.h"
#include "lockstep/c.h"

using namespace lockstep;

namespace {

const char* const robot = R"(<robot name="r"><link name="a"/>
<link name="b"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="c"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="5" velocity="9"/></joint>
<joint name="k" type="continuous"><parent link="b"/><child link="c"/><axis xyz="0 1 0"/><mimic joint="j"/></joint></robot>)";

// What may be wrong is refused; a program that is told so goes on. Memory that a call may write to is large enough for
// all that it may take.
class Calls {
 public:
  Calls(const std::uint8_t* data, std::size_t size) : input_(data, size), memory_(1 << 15) {}
  ~Calls() {
    for (lockstep_batch* batch : batches_) lockstep_batch_free(batch);
    for (lockstep_plan* plan : plans_) lockstep_plan_free(plan);
    for (lockstep_model* model : models_) lockstep_model_free(model);
  }

  void run() {
    make_model(), make_plan(), make_batch();
    while (input_.remaining_bytes() > 0) call();
  }

 private:
  template <class Object>
  Object* one_of(const std::vector<Object*>& known) {
    const auto which = input_.ConsumeIntegralInRange<std::size_t>(0, known.size() + 2);
    if (which < known.size()) return known[which];  // perhaps freed
    if (which == known.size()) return nullptr;
    if (which == known.size() + 1) return reinterpret_cast<Object*>(memory_.data());
    return reinterpret_cast<Object*>(batches_.empty() ? nullptr : batches_[0]);  // perhaps of another kind
  }
  lockstep_batch* batch() { return one_of(batches_); }
  double number() {
    constexpr double special[] = {0.0, 0.1, 1.0, -1.0, 1e9, 1e-300, HUGE_VAL, -HUGE_VAL, NAN};
    return input_.PickValueInArray(special);
  }
  std::int64_t few() { return input_.ConsumeIntegralInRange<std::int64_t>(-2, 10); }
  const char* name() {
    constexpr const char* names[] = {"j", "k", "a", "c", "", "home", "no such thing", nullptr};
    return input_.PickValueInArray(names);
  }
  lockstep_array array() {
    lockstep_array made{};
    made.size = sizeof made;
    made.data = input_.ConsumeIntegralInRange(0, 9) ? memory_.data() : nullptr;
    made.type = input_.ConsumeIntegralInRange(-1, 4), made.rank = input_.ConsumeIntegralInRange(1, 3);
    made.shape[0] = input_.ConsumeIntegralInRange(0, 60), made.shape[1] = few();
    made.stride[0] = 8 * input_.ConsumeIntegralInRange(0, 16), made.stride[1] = 4 * input_.ConsumeIntegralInRange(0, 9);
    made.flags = input_.ConsumeIntegralInRange(0u, 2u);
    return made;
  }
  const std::uint8_t* mask() {
    for (std::uint8_t& entry : mask_) entry = input_.ConsumeBool();
    return input_.ConsumeBool() ? mask_ : nullptr;
  }

  void make_model() {
    lockstep_model* model = nullptr;
    if (lockstep_model_from_urdf_text(robot, &model) == LOCKSTEP_OK) models_.push_back(model);
  }
  void make_plan() {
    lockstep_settings settings;
    lockstep_settings_init(&settings);
    settings.per_environment = input_.ConsumeIntegralInRange(0u, 0xfffffffu);
    settings.record_efforts = input_.ConsumeIntegralInRange(-1, 2), settings.record_impulses = input_.ConsumeBool();
    settings.dt = input_.ConsumeBool() ? 0.004 : number();
    constexpr const char* methods[] = {"automatic", "pgs", "tgs", "direct", "reduced", "", nullptr};
    constexpr const char* integrators[] = {"automatic", "euler", "leapfrog", "extrapolated", "runge_kutta", "x"};
    settings.method = input_.PickValueInArray(methods), settings.integrator = input_.PickValueInArray(integrators);
    lockstep_plan* plan = nullptr;
    const bool defaults = input_.ConsumeBool();
    if (lockstep_compile(one_of(models_), defaults ? nullptr : &settings, &plan) == LOCKSTEP_OK) plans_.push_back(plan);
  }
  void make_batch() {
    lockstep_options options;
    lockstep_options_init(&options);
    options.environments = few(), options.threads = 1, options.precision = input_.ConsumeBool() ? 32 : 64;
    lockstep_batch* batch = nullptr;
    if (lockstep_batch_new(one_of(plans_), &options, &batch) == LOCKSTEP_OK) batches_.push_back(batch);
  }

  void call() {
    const char* text = nullptr;
    std::int64_t count = 0;
    lockstep_array numbers = array();
    switch (input_.ConsumeIntegralInRange(0, 24)) {
      case 0: return void(models_.size() < 4 ? make_model() : lockstep_model_free(one_of(models_)));
      case 1: return void(plans_.size() < 4 ? make_plan() : lockstep_plan_free(one_of(plans_)));
      case 2: return void(batches_.size() < 4 ? make_batch() : lockstep_batch_free(batch()));
      case 3: return lockstep_batch_free(batch());
      case 4: return void(lockstep_model_set_drive(one_of(models_), name(), number(), number()));
      case 5: return void(lockstep_model_report(one_of(models_), &text));
      case 6: return void(lockstep_plan_count(one_of(plans_), static_cast<int>(few()), &count));
      case 7: return void(lockstep_plan_name(one_of(plans_), static_cast<int>(few()), few(), &text));
      case 8: return void(lockstep_plan_index(one_of(plans_), static_cast<int>(few()), name(), &count));
      case 9: return void(lockstep_plan_describe(one_of(plans_), &text));
      case 10: return write_field();
      case 11: return void(lockstep_step(batch(), static_cast<std::int32_t>(few())));
      case 12: return void(lockstep_reset_mask(batch(), mask(), few(), input_.ConsumeIntegralInRange(0u, 2u)));
      case 13: {
        std::int32_t ids[16];
        for (std::int32_t& id : ids) id = static_cast<std::int32_t>(few());
        return void(lockstep_reset_ids(batch(), ids, few(), input_.ConsumeIntegralInRange(0u, 2u)));
      }
      case 14: {
        lockstep_pose_noise noise;
        lockstep_pose_noise_init(&noise);
        noise.position = number(), noise.spread = number(), noise.velocity = number();
        return void(lockstep_reset_to(batch(), name(), &noise, mask(), few()));
      }
      case 15: return void(lockstep_reset_random(batch(), mask(), few(), number(), number()));
      case 16: return void(lockstep_copy(batch(), few(), mask(), few()));
      case 17: return void(lockstep_project(batch(), mask(), few()));
      case 18: {
        lockstep_randomization draw;
        lockstep_randomization_init(&draw);
        draw.parameter = input_.ConsumeIntegralInRange(-1, 28), draw.operation = input_.ConsumeIntegralInRange(-1, 3);
        draw.distribution = input_.ConsumeIntegralInRange(-1, 3), draw.low = number(), draw.high = number();
        return void(lockstep_randomize(batch(), &draw, mask(), few()));
      }
      case 19: return void(lockstep_act(batch(), &numbers));
      case 20: return read(numbers);
      case 21: return void(lockstep_mass_matrix(batch(), mask(), few(), &numbers));
      case 22: return void(lockstep_bias_forces(batch(), mask(), few(), &numbers));
      case 23: return void(lockstep_jacobian(batch(), static_cast<int>(few()), few(), mask(), few(), &numbers));
      default: return save_and_restore();
    }
  }

  void write_field() {
    lockstep_array field;
    const int which =
        input_.ConsumeBool() ? input_.ConsumeIntegralInRange(-1, 12) : input_.ConsumeIntegralInRange(99, 128);
    if (lockstep_field(batch(), which, &field) != LOCKSTEP_OK || (field.flags & LOCKSTEP_READ_ONLY)) return;
    if (field.shape[0] == 0) return;
    auto* const at = static_cast<std::byte*>(field.data) +
                     input_.ConsumeIntegralInRange<std::int64_t>(0, field.shape[0] - 1) * field.stride[0] +
                     input_.ConsumeIntegralInRange<std::int64_t>(0, field.shape[1] - 1) * field.stride[1];
    if (field.type == LOCKSTEP_F32) *reinterpret_cast<float*>(at) = static_cast<float>(number());
    if (field.type == LOCKSTEP_F64) *reinterpret_cast<double*>(at) = number();
  }
  void read(const lockstep_array& to) {
    lockstep_query query{};
    query.size = sizeof query, query.scale = number();
    query.quantity = input_.ConsumeIntegralInRange(-1, 40), query.row = static_cast<std::int32_t>(few());
    lockstep_read(batch(), &query, input_.ConsumeIntegralInRange(-1, 1), &to);
  }
  void save_and_restore() {
    std::uint64_t bytes = memory_.size() * sizeof(double);
    if (input_.ConsumeBool()) bytes = input_.ConsumeIntegralInRange(0, 1000);
    lockstep_save(batch(), memory_.data(), &bytes);
    if (bytes > memory_.size() * sizeof(double)) return;
    lockstep_restore(batch(), memory_.data(), bytes);
    char text[40];
    lockstep_explain_fault(batch(), few(), text, input_.ConsumeIntegralInRange(0u, 40u));
  }

  FuzzedDataProvider input_;
  std::vector<double> memory_;
  std::uint8_t mask_[16];
  std::vector<lockstep_model*> models_;
  std::vector<lockstep_plan*> plans_;
  std::vector<lockstep_batch*> batches_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Calls(data, size).run();
  return 0;
}
