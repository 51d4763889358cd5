// Prints a hash of the bits that a build computes, a line for each plan, target, engine and precision.
// SPDX-License-Identifier: Apache-2.0
//
// compare.py compiles it against two builds and compares the lines. It uses each build's own headers and test
// libraries.
#include <fmt/format.h>

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "contract.h"
#include "generated/plans.h"
#include "lockstep/lockstep.h"

namespace lockstep {
namespace {

template <class S, class Use>
void with_batch(const Plan& plan, Engine engine, Target target, Use use) {
  try {
    Batch<S> batch = contract::scattered<S>(plan, 21, {.threads = 1, .target = target, .engine = engine});
    use(batch);
  } catch (const SettingsError&) {  // this plan has no such engine
  }
}

// FNV-1a.
struct Hash {
  std::uint64_t value = 0xcbf29ce484222325u;
  void add(const void* data, std::size_t size) {
    for (const auto* byte = static_cast<const unsigned char*>(data); size > 0; --size, ++byte)
      value = (value ^ *byte) * 0x100000001b3u;
  }
  template <class View>
  void add(const View& view) {
    for (Eigen::Index r = 0; r < view.rows(); ++r)
      for (Eigen::Index e = 0; e < view.cols(); ++e) {
        const auto number = view(r, e);
        if (number == number) add(&number, sizeof(number));  // the bits of a NaN are nobody's
      }
  }
};

template <class S>
std::uint64_t outcome(Batch<S>& batch) {
  Hash hash;
  const StepSettings& settings = batch.plan().settings();
  for (int call = 0; call < 4; ++call) {
    batch.step(1 + 5 * call);
    hash.add(batch.positions()), hash.add(batch.velocities());
    hash.add(batch.root_poses()), hash.add(batch.root_velocities());
    for (Fault fault : batch.faults()) hash.add(&fault, sizeof(fault));
    if (settings.record_impulses) hash.add(batch.coupling_impulses());
    if (!settings.record_diagnostics) continue;
    hash.add(batch.row_residuals()), hash.add(batch.row_states()), hash.add(batch.energy_balances());
  }
  hash.add(batch.coupling_errors()), hash.add(batch.kinetic_energies()), hash.add(batch.momenta());
  hash.add(batch.link_poses(0)),
      hash.add(batch.link_velocities(static_cast<int>(batch.plan().model().links.size()) - 1));
  return hash.value;
}

constexpr Engine machine_code = static_cast<Engine>(2);  // in builds before `compiled` the interpreter

void print(const std::string& name) {
  const Plan plan = generated::plan_of(name);
  const struct {
    Engine engine;
    const char* name;
  } engines[] = {{Engine::tables, "tables"}, {machine_code, "machine_code"}, {Engine::generated, "generated"}};
  const struct {
    Target target;
    const char* name;
  } targets[] = {
      {Target::baseline, "baseline"}, {Target::avx2, "avx2"}, {Target::avx512, "avx512"}, {Target::neon, "neon"}};
  for (const auto& engine : engines)
    for (const auto& target : targets) {
      if (!supported(target.target)) continue;
      with_batch<float>(plan, engine.engine, target.target, [&](auto& batch) {
        fmt::print("{} {} {} f32 {:016x}\n", name, engine.name, target.name, outcome(batch));
      });
      with_batch<double>(plan, engine.engine, target.target, [&](auto& batch) {
        fmt::print("{} {} {} f64 {:016x}\n", name, engine.name, target.name, outcome(batch));
      });
    }
}

std::vector<std::string> plan_names() {
  std::vector<std::string> names;
  for (const char* scene : {"chain8", "gripper13", "chain32", "gear100", "drive1e6", "redundant", "mass1000"})
    for (const char* method : {"reduced", "direct", "pgs", "tgs"}) {
      const std::string plain = fmt::format("{}_{}", scene, method);
      names.push_back(plain);
      const bool small = std::strcmp(scene, "chain32") != 0;
      if (std::strcmp(scene, "redundant") != 0 && small) names.push_back(plain + "_fields");
      if (std::strcmp(scene, "chain8") == 0 || std::strcmp(scene, "gripper13") == 0) names.push_back(plain + "_bounds");
      if (std::strcmp(scene, "chain8") == 0) names.push_back(plain + "_bounds_fields");
      if (std::strcmp(method, "reduced") != 0 && std::strcmp(method, "direct") != 0) continue;
      for (const char* integrator : {"leapfrog", "extrapolated"})
        names.push_back(fmt::format("{}_{}", plain, integrator));
      if (std::strcmp(method, "reduced") == 0 && std::strcmp(scene, "drive1e6") != 0)
        names.push_back(plain + "_leapfrog_inputs");
    }
  for (const char* scene : {"chain8", "chain32"}) names.push_back(fmt::format("{}_reduced_runge_kutta", scene));
  for (int seed = 0; seed < 40; ++seed) {
    names.push_back(fmt::format("random_{}", seed));
    names.push_back(fmt::format("random_{}_fields", seed));
    names.push_back(fmt::format("random_{}_limits", seed));
    if (seed % 4 == 0) names.push_back(fmt::format("random_{}_leapfrog_fields", seed));
    if (seed % 4 == 1) names.push_back(fmt::format("random_{}_extrapolated", seed));
  }
  for (const char* deep : {"deep_78", "deep_77_limits", "deep_78_fields"}) names.push_back(deep);
  return names;
}

}  // namespace
}  // namespace lockstep

int main() {
  for (const std::string& name : lockstep::plan_names()) {
    try {
      lockstep::print(name);
    } catch (const std::exception& refusal) {
      fmt::print("{} refused\n", name);
    }
  }
}
