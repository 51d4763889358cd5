// Prints hashes of the results of fused and unfused arithmetic. SPDX-License-Identifier: Apache-2.0
#include <cstdint>
#include <cstring>
#include <set>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "lockstep/batch.h"
#include "scenes/scenes.h"
#include "twins/twins.h"

namespace lockstep {
namespace {

struct ArithmeticClass {
  const char* name;
  std::vector<Target> targets;
};
const ArithmeticClass classes[] = {
    {"fused", {Target::avx2, twins::avx2_scalar, Target::avx512, Target::neon, twins::neon_scalar}},
    {"unfused", {Target::baseline, twins::baseline_scalar}}};

// FNV-1a.
template <class View>
void add(std::uint64_t& hash, const View& view) {
  for (Eigen::Index r = 0; r < view.rows(); ++r)
    for (Eigen::Index e = 0; e < view.cols(); ++e) {
      const auto number = view(r, e);
      unsigned char bytes[sizeof(number)];
      std::memcpy(bytes, &number, sizeof(number));
      for (unsigned char byte : bytes) hash = (hash ^ byte) * 0x100000001b3u;
    }
}

// A hash of nine environments with different starts and efforts, after a quarter of a second.
template <class S>
std::uint64_t outcome(const Plan& plan, Target target) {
  Batch<S> batch(plan, 9, {.threads = 1, .target = target, .engine = Engine::tables});
  for (int e = 0; e < batch.environments(); ++e) {
    batch.velocities().col(e) += S(0.125) * S(e);
    batch.efforts().col(e) = S(0.0625) * S(e);
  }
  batch.step(60);
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (auto view : {batch.positions(), batch.velocities(), batch.root_poses(), batch.root_velocities()})
    add(hash, view);
  return hash;
}

// Prints one line per class, or several if its targets disagree.
void print(const std::string& title, const Plan& plan) {
  for (const ArithmeticClass& arithmetic : classes) {
    std::set<std::string> lines;
    for (Target target : arithmetic.targets)
      if (supported(target))
        lines.insert(fmt::format("{} {} f32 {:016x} f64 {:016x}\n", arithmetic.name, title,
                                 outcome<float>(plan, target), outcome<double>(plan, target)));
    for (const std::string& line : lines) fmt::print("{}", line);
  }
}

void print(const std::string& scene, Method method) {
  Model model = scenes::scene(scene).model;
  for (Joint& joint : model.joints) joint.lower = -0.35, joint.upper = 0.35, joint.friction = 0.01;
  print(fmt::format("{} {}", scene, to_string(method)), compile(model, {.method = method, .iterations = 4}));
}

void print(const std::string& scene, Integrator integrator) {
  print(fmt::format("{} {}", scene, to_string(integrator)),
        compile(scenes::scene(scene).model, {.integrator = integrator}));
}

}  // namespace
}  // namespace lockstep

int main() {
  using lockstep::Method;
  for (const char* scene : {"chain8", "gripper13", "chain32"})
    for (Method method : {Method::reduced, Method::direct, Method::pgs, Method::tgs}) lockstep::print(scene, method);
  using lockstep::Integrator;
  for (const char* scene : {"chain8", "chain32"})
    for (Integrator integrator : {Integrator::leapfrog, Integrator::extrapolated, Integrator::runge_kutta})
      lockstep::print(scene, integrator);
}
