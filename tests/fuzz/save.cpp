// Saves: bytes as they are, and saves whose numbers were changed and whose checksums are right.
// SPDX-License-Identifier: Apache-2.0
#include <fuzzer/FuzzedDataProvider.h>
#include <zlib.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "batch/blob.h"
#include "fuzz.h"

using namespace lockstep;

namespace {

constexpr int environments = 4;

// A bit of everything that a batch keeps: a floating hull with a driven arm and a ball, on ground and on hills.
Model everything() {
  const auto link = [](const char* name) {
    Link own{name, {}};
    own.inertia.mass = 1.0, own.inertia.about_center = 0.01 * Eigen::Matrix3d::Identity();
    return own;
  };
  Model model;
  model.links = {link("hull"), link("arm"), link("finger"), link("head")};
  model.roots.push_back({"hull", true, Pose::Identity(), Twist::Zero()});
  model.roots[0].pose.translation().z() = 0.2;
  Joint arm{"arm", JointKind::revolute, "hull", "arm"};
  arm.axis = Eigen::Vector3d::UnitY(), arm.lower = -1.0, arm.upper = 1.0, arm.velocity_limit = 9.0;
  arm.effort_limit = 5.0, arm.friction = 0.01, arm.damping = 0.1, arm.armature = 0.01, arm.stiffness = 1.0;
  arm.drive = {10.0, 1.0, 0.3, 0.0, false, Hard{1.0}, 3, 0.02, 6.0, 20.0};
  Joint finger = arm;
  finger.name = "finger", finger.parent = "arm", finger.child = "finger", finger.drive = {};
  finger.origin.translation().x() = 0.2;
  model.joints = {arm, finger};
  model.couplings.push_back({"finger", {{"arm", -1.0}}});
  model.add_ball("neck", "hull", "head");
  Eigen::MatrixXd heights = Eigen::MatrixXd::Random(8, 8) * 0.05;
  Eigen::Matrix3Xd corners(3, 8);
  for (int i = 0; i < 8; ++i) corners.col(i) << (i & 1) * 0.2 - 0.1, (i & 2) * 0.1 - 0.1, (i & 4) * 0.05 - 0.1;
  const auto collider = [&](const char* name, const char* of, const Shape& shape) {
    Collider own;
    own.name = name, own.link = of, own.shape = shape;
    own.torsional_friction = 0.01, own.rolling_friction = 0.001;
    model.colliders.push_back(own);
  };
  collider("ground", "", Shape::half_space());
  collider("hills", "", Shape::height_field(heights, 2.0, 2.0));
  collider("hull", "hull", Shape::hull(corners));
  collider("arm", "arm", Shape::cylinder(0.05, 0.2));
  collider("head", "head", Shape::box({0.1, 0.1, 0.1}));
  for (const char* first : {"ground", "hills"})
    for (const char* second : {"hull", "arm", "head"}) model.contacts.push_back({first, second});
  model.contacts.push_back({"arm", "head"});
  return model;
}

Plan plan_of(Integrator integrator) {
  StepSettings settings;
  settings.integrator = integrator;
  settings.record_efforts = settings.record_contacts = settings.record_accelerations = true;
  for (int p = 0; p < parameter_count; ++p) {
    StepSettings with = settings;
    with.per_environment.insert(static_cast<Parameter>(p));
    if (fuzz::taken([&] { compile(everything(), with); })) settings = with;
  }
  return compile(everything(), settings);
}

std::uint32_t checksum_of(const std::byte* data, std::size_t bytes) {
  return static_cast<std::uint32_t>(crc32_z(0, reinterpret_cast<const unsigned char*>(data), bytes));
}

// Changes numbers of environment 0, and makes the checksums right.
std::vector<std::byte> changed(std::vector<std::byte> blob, FuzzedDataProvider& input) {
  BlobHead head;
  std::memcpy(&head, blob.data(), sizeof head);
  std::vector<BlobSection> sections(head.sections);
  std::memcpy(sections.data(), blob.data() + sizeof head, sections.size() * sizeof(BlobSection));
  const std::size_t checked = sizeof head + sections.size() * sizeof(BlobSection) + head.settings_bytes;
  std::vector<std::size_t> begins{checked + sizeof(std::uint32_t)};
  for (const BlobSection& section : sections)
    begins.push_back(begins.back() + std::size_t{section.rows} * section.number_bytes * head.environments);
  constexpr double special[] = {0.0, -0.0, 1.0, -1.0, 1e-40, 1e30, -1e30, 3.0, NAN, INFINITY, 1e5, 0.1};
  while (input.remaining_bytes() > 0) {
    const auto i = input.ConsumeIntegralInRange<std::size_t>(0, sections.size() - 1);
    if (sections[i].rows == 0) continue;
    const auto row = input.ConsumeIntegralInRange<std::size_t>(0, sections[i].rows - 1);
    std::byte* const number = blob.data() + begins[i] + row * head.environments * sections[i].number_bytes;
    const bool is_special = input.ConsumeBool();
    const double value = is_special ? input.PickValueInArray(special) : 0.0;
    const auto bits = is_special ? 0 : input.ConsumeIntegral<std::uint64_t>();
    if (!is_special)
      std::memcpy(number, &bits, sections[i].number_bytes);
    else if (const auto single = static_cast<float>(value); sections[i].number_bytes == sizeof single)
      std::memcpy(number, &single, sizeof single);
    else
      std::memcpy(number, &value, sizeof value);
  }
  for (std::size_t i = 0; i < sections.size(); ++i)
    sections[i].checksum = checksum_of(blob.data() + begins[i], begins[i + 1] - begins[i]);
  std::memcpy(blob.data() + sizeof head, sections.data(), sections.size() * sizeof(BlobSection));
  const std::uint32_t sum = checksum_of(blob.data(), checked);
  std::memcpy(blob.data() + checked, &sum, sizeof sum);
  return blob;
}

template <class S>
void go_on(Batch<S>& batch) {
  batch.step(2);
  fuzz::require_sound(batch);
  batch.link_poses(0);
  batch.kinetic_energies();
}

// Whether environments 1, 2 and 3 have the same bits.
template <class S>
bool alike(const Batch<S>& a, const Batch<S>& b) {
  const auto same = [](const auto& x, const auto& y) {
    for (int e = 1; e < environments; ++e)
      for (Eigen::Index row = 0; row < x.rows(); ++row)
        if (const S p = x(row, e), q = y(row, e); std::memcmp(&p, &q, sizeof p) != 0) return false;
    return true;
  };
  return same(a.positions(), b.positions()) && same(a.velocities(), b.velocities()) &&
         same(a.root_poses(), b.root_poses()) && same(a.root_velocities(), b.root_velocities());
}

template <class S>
struct Kept {
  explicit Kept(Integrator integrator)
      : plan(plan_of(integrator)), batch(plan, environments, {.threads = 1}), next(plan, environments, {.threads = 1}) {
    batch.step(40);  // on the ground
    blob = batch.save();
    go_on(batch);
  }
  Plan plan;
  Batch<S> batch;  ///< as it goes on from the blob
  Batch<S> next;   ///< what inputs are restored into
  std::vector<std::byte> blob;
};

template <class S>
void run(Kept<S>& kept, FuzzedDataProvider& input, bool as_they_are) {
  if (as_they_are) {
    const auto bytes = input.ConsumeRemainingBytes<std::uint8_t>();
    if (fuzz::taken([&] { kept.next.restore(std::as_bytes(std::span(bytes))); })) go_on(kept.next);
    return;
  }
  const std::vector<std::byte> blob = changed(kept.blob, input);
  if (!fuzz::taken([&] { kept.next.restore(blob); })) return;  // takes numbers as they are; a step judges them
  go_on(kept.next);
  fuzz::require(alike(kept.next, kept.batch), "a changed environment changes its neighbours");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static Kept<float> single(Integrator::euler);
  static Kept<double> wide(Integrator::leapfrog);
  FuzzedDataProvider input(data, size);
  const bool is_single = input.ConsumeBool(), as_they_are = input.ConsumeIntegralInRange(0, 7) == 0;
  is_single ? run(single, input, as_they_are) : run(wide, input, as_they_are);
  return 0;
}
