// Writes kernels for the benchmarks: make_kernels FOLDER NAME... SPDX-License-Identifier: Apache-2.0
//
// A name is scene_method, scene_method_ranges, scene_integrator, scene_halves (steps of half the length), or
// chainN_coupled (a chain of N joints).
#include <fmt/format.h>

#include <fstream>
#include <sstream>
#include <string>

#include "loads.h"

namespace {

lockstep::bench::Load load_of(const std::string& name) {
  using namespace lockstep;
  const std::string scene = name.substr(0, name.find('_')), method = name.substr(name.find('_') + 1);
  if (method == "coupled") {
    const int joints = std::stoi(scene.substr(5));
    return bench::chain(joints, joints / 2, Method::reduced);
  }
  for (const Integrator integrator : {Integrator::leapfrog, Integrator::extrapolated, Integrator::runge_kutta})
    if (method == lockstep::to_string(integrator)) {
      bench::Load load = bench::scene(scene, Method::reduced, 1);
      load.settings.integrator = integrator;
      return load;
    }
  if (method == "halves") {
    bench::Load load = bench::scene(scene, Method::reduced, 4);
    load.settings.dt /= 2;
    return load;
  }
  for (const Method m : {Method::reduced, Method::direct, Method::pgs}) {
    if (method == lockstep::to_string(m)) return bench::scene(scene, m, 4);
    if (method == fmt::format("{}_ranges", lockstep::to_string(m))) return bench::scene_with_ranges(scene, m);
  }
  throw std::invalid_argument("no such kernel: " + name);
}

}  // namespace

int main(int argc, char** argv) {
  using namespace lockstep;
  for (int i = 2; i < argc; ++i) {
    const bench::Load load = load_of(argv[i]);
    const KernelSource source = generate_kernel(compile(load.model, load.settings), {.name = argv[i], .f64 = false});
    std::ofstream(fmt::format("{}/{}.cpp", argv[1], argv[i])) << source.code;
    fmt::print("{}: {} operations, {} flops a step\n", argv[i], source.operations, source.flops);
  }
}
