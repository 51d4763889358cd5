// Throughput of the step: step/<scene>/<method>/<iterations>/<precision>[/words]. SPDX-License-Identifier: Apache-2.0
//
// Unless the words of a row say otherwise, it has one thread, 4096 environments, 4 steps per call and the automatic
// engine. Rows of the ladder add one feature at a time to a chain of eight. The counter env_steps_per_second is per
// second of CPU time, or of wall time where threads are compared. Rows peak/<instructions> and peak/memory measure the
// peaks of the machine. URDF files that follow the options are measured too, without their bounds.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <vector>

#include "loads.h"
#include "peak.h"
#include "scenes/scenes.h"

namespace lockstep {
namespace {

using bench::Load;

// Null if the engine does not take the plan.
template <class S>
std::unique_ptr<Batch<S>> make_batch(const Plan& plan, const Load& load, benchmark::State& state) {
  try {
    return std::make_unique<Batch<S>>(
        plan, load.environments, BatchOptions{.threads = load.threads, .engine = bench::engine_of(plan, load.engine)});
  } catch (const SettingsError& error) {
    state.SkipWithError(error.what());
    return nullptr;
  }
}

template <class S>
void run(benchmark::State& state, const Load& load) {
  const Plan plan = compile(load.model, load.settings);
  const std::unique_ptr<Batch<S>> owner = make_batch<S>(plan, load, state);
  if (!owner) return;
  Batch<S>& batch = *owner;
  batch.step(load.substeps);
  int steps = load.substeps;
  for (auto _ : state) {
    batch.step(load.substeps);
    if ((steps += load.substeps) >= load.reset_after) {
      state.PauseTiming();
      batch.reset(EnvironmentSet::all(), {.keep_inputs = true});
      steps = 0;
      state.ResumeTiming();
    }
  }
  if (batch.faulted() > 0) state.SkipWithError("environments faulted");
  const double done = static_cast<double>(state.iterations()) * load.environments * load.substeps;
  state.counters["env_steps_per_second"] = benchmark::Counter(done, benchmark::Counter::kIsRate);
  state.counters["flops_per_step"] = static_cast<double>(plan.flops_per_step());
  state.counters["gflops"] =
      benchmark::Counter(done * static_cast<double>(plan.flops_per_step()) * 1e-9, benchmark::Counter::kIsRate);
}

// Another program that takes one of two cores for a moment keeps the other waiting. So where threads are compared, the
// fastest repeat is reported beside the median.
void report_best(benchmark::internal::Benchmark* b) {
  b->ComputeStatistics("best", [](const std::vector<double>& repeats) { return *std::ranges::max_element(repeats); });
}

benchmark::internal::Benchmark* add(const std::string& name, const Load& load, bool single) {
  auto* b = benchmark::RegisterBenchmark(("step/" + name).c_str(), [load, single](benchmark::State& s) {
    single ? run<float>(s, load) : run<double>(s, load);
  });
  if (name.find("/threads:") != std::string::npos) report_best(b->UseRealTime());
  return b;
}

void add_methods() {
  for (const char* scene : {"chain8", "gripper13", "chain32"})
    for (bool single : {true, false}) {
      const char* precision = single ? "f32" : "f64";
      for (Method method : {Method::reduced, Method::direct})
        add(fmt::format("{}/{}/1/{}", scene, to_string(method), precision), bench::scene(scene, method, 1), single);
      for (Method method : {Method::pgs, Method::tgs})
        for (int iterations : {1, 4, 16})
          add(fmt::format("{}/{}/{}/{}", scene, to_string(method), iterations, precision),
              bench::scene(scene, method, iterations), single);
    }
}

// Integrators beyond Euler's. add_generated() has the generated kernels of these.
void add_integrators() {
  for (const char* scene : {"chain8", "gripper13", "chain32"})
    for (const Integrator integrator : {Integrator::leapfrog, Integrator::extrapolated, Integrator::runge_kutta})
      for (const bool single : {true, false}) {
        if (integrator == Integrator::runge_kutta && scene == std::string("gripper13")) continue;  // too stiff
        Load load = bench::scene(scene, Method::reduced, 1);
        load.settings.integrator = integrator;
        add(fmt::format("{}/reduced/1/{}/integrator:{}", scene, single ? "f32" : "f64", to_string(integrator)), load,
            single);
      }
}

// Rows with four steps per call and with one.
void add_engine(Engine engine, const std::string& name, Load load) {
  load.engine = engine;
  for (const int substeps : {4, 1}) {
    load.substeps = substeps;
    const std::string words = substeps == 4 ? "" : fmt::format("/substeps:{}", substeps);
    add(fmt::format("{}{}/engine:{}", name, words, to_string(engine)), load, true);
  }
}

// A scene whose followers are inconsistent, and stay so until the next reset. So every step is a full one.
Load inconsistent(const char* scene) {
  Load load = bench::scene(scene, Method::reduced, 1);
  for (const Coupling& coupling : load.model.couplings)
    load.model.joints[static_cast<std::size_t>(load.model.joint_index(coupling.joint))].position += 0.2;
  load.reset_after = 40;
  return load;
}

// The scenes, chains with half of their joints coupled, threads and batch sizes by one engine.
void add_engines(Engine engine, const std::vector<int>& lengths) {
  for (const char* scene : {"chain8", "gripper13", "chain32"})
    for (Method method : {Method::reduced, Method::direct, Method::pgs}) {
      const int iterations = method == Method::pgs ? 4 : 1;
      add_engine(engine, fmt::format("{}/{}/{}/f32", scene, to_string(method), iterations),
                 bench::scene(scene, method, iterations));
    }
  for (const char* scene : {"chain8", "gripper13", "chain32"})
    add_engine(engine, fmt::format("{}/reduced/1/f32/inconsistent", scene), inconsistent(scene));
  for (int joints : lengths)
    add_engine(engine, fmt::format("chain/reduced/1/f32/coupled/dofs:{}", joints),
               bench::chain(joints, joints / 2, Method::reduced));
  for (int threads : {1, 2}) {
    Load load = bench::scene("chain8", Method::reduced, 1);
    load.environments = 16384, load.threads = threads;
    add_engine(engine, fmt::format("chain8/reduced/1/f32/threads:{}", threads), load);
  }
  for (int environments : {64, 1024, 16384, 262144}) {
    Load load = bench::scene("chain8", Method::reduced, 1);
    load.environments = environments;
    add_engine(engine, fmt::format("chain8/reduced/1/f32/environments:{}", environments), load);
  }
}

// Needs generated kernels (LOCKSTEP_BENCH_KERNELS).
[[maybe_unused]] void add_generated() {
  add_engines(Engine::generated, {4, 8, 16, 32, 64});
  for (const auto& [scene, integrator] : {std::pair{"chain8", Integrator::leapfrog},
                                          {"gripper13", Integrator::leapfrog},
                                          {"chain32", Integrator::leapfrog},
                                          {"chain8", Integrator::extrapolated},
                                          {"gripper13", Integrator::extrapolated},
                                          {"chain8", Integrator::runge_kutta}}) {
    Load load = bench::scene(scene, Method::reduced, 1);
    load.settings.integrator = integrator;
    add_engine(Engine::generated, fmt::format("{}/reduced/1/f32/integrator:{}", scene, to_string(integrator)), load);
  }
}

// A CSV table needs the same counters in all benchmarks.
void add_peaks() {
  const auto count = [](benchmark::State& state, double flops) {
    state.counters["env_steps_per_second"] = 0.0;
    state.counters["flops_per_step"] = 0.0;
    state.counters["gflops"] = benchmark::Counter(flops * 1e-9, benchmark::Counter::kIsRate);
  };
  for (const bench::Peak peak : bench::all_peaks) {
    if (!bench::supported(peak)) continue;
    const auto run = [count, peak](benchmark::State& state) {
      double flops = 0.0;
      for (auto _ : state) flops += bench::run_peak(peak, 1000);
      count(state, flops);
    };
    const std::string name = fmt::format("peak/{}", to_string(peak));
    benchmark::RegisterBenchmark(name.c_str(), run);
    // The gain from a second core while the first one is at work.
    if (peak == bench::Peak::avx2_f32)
      report_best(benchmark::RegisterBenchmark(name.c_str(), run)->Threads(2)->UseRealTime());
  }
  benchmark::RegisterBenchmark("peak/memory", [count](benchmark::State& state) {
    bench::Stream stream(1 << 25);
    double bytes = 0.0;
    for (auto _ : state) bytes += stream.pass();
    state.SetBytesProcessed(static_cast<std::int64_t>(bytes));
    count(state, 0.0);
  });
}

void add_scaling() {
  for (const char* scene : {"chain8", "gripper13", "chain32"})
    add(fmt::format("{}/reduced/1/f32/inconsistent", scene), inconsistent(scene), true);
  const auto scaled = [](const char* scene, const std::string& words, auto&& change) {
    Load load = bench::scene(scene, Method::reduced, 1);
    change(load);
    add(fmt::format("{}/reduced/1/f32/{}", scene, words), load, true);
  };
  for (int environments : {64, 256, 1024, 4096, 16384, 65536, 262144})
    scaled("chain8", fmt::format("environments:{}", environments), [=](Load& l) { l.environments = environments; });
  for (const char* scene : {"chain8", "gripper13", "chain32"}) {
    for (int substeps : {1, 2, 4, 16})
      scaled(scene, fmt::format("substeps:{}", substeps), [=](Load& l) { l.substeps = substeps; });
    for (int threads : {1, 2})
      scaled(scene, fmt::format("threads:{}", threads), [=](Load& l) { l.environments = 16384, l.threads = threads; });
  }
}

void add_sizes() {
  for (int joints : {1, 2, 4, 8, 16, 20, 24, 32, 64})
    for (const bool coupled : {false, true}) {
      if (coupled && joints < 4) continue;
      const Load load = bench::chain(joints, coupled ? joints / 2 : 0, Method::reduced);
      add(fmt::format("chain/reduced/1/f32/{}dofs:{}", coupled ? "coupled/" : "", joints), load, true);
    }
  for (int couplings = 0; couplings <= 8; ++couplings)
    for (Method method : {Method::reduced, Method::direct, Method::pgs}) {
      const Load load = bench::chain(16, couplings, method);
      add(fmt::format("chain16/{}/{}/f32/couplings:{}", to_string(method), method == Method::pgs ? 4 : 1, couplings),
          load, true);
    }
}

// The cost of each feature: the same chain with more and more features.
void add_ladder() {
  const auto rung = [](const std::string& words, auto&& change) {
    Load load = bench::scene("chain8", Method::direct, 1);
    load.model.couplings.clear();
    for (Joint& joint : load.model.joints) joint.damping = 0.0;
    change(load);
    add(fmt::format("chain8/{}/1/f32/ladder:{}", to_string(load.settings.method), words), load, true);
  };
  const auto damped = [](Load& load) {
    for (Joint& joint : load.model.joints) joint.damping = 0.05;
  };
  const auto coupled = [](Load& load, Softness softness) {
    load.model.couplings = scenes::chain8().couplings;
    for (Coupling& coupling : load.model.couplings) coupling.softness = softness;
  };
  rung("bare", [](Load&) {});
  rung("damping", damped);
  rung("drives", [&](Load& load) {
    for (Joint& joint : load.model.joints) joint.drive = {20.0, 1.0, 0.3, 0.0};
  });
  rung("hard-reduced", [&](Load& load) { coupled(load, Hard{}), load.settings.method = Method::reduced; });
  rung("hard-direct", [&](Load& load) { coupled(load, Hard{}); });
  rung("soft-spring", [&](Load& load) { coupled(load, Spring{20.0, 1.0}); });
  rung("soft-frequency", [&](Load& load) { coupled(load, Frequency{30.0, 1.0}); });
  rung("soft-frequency-damping", [&](Load& load) { damped(load), coupled(load, Frequency{30.0, 1.0}); });
  rung("hard-reduced-impulses", [&](Load& load) {
    coupled(load, Hard{}), load.settings.method = Method::reduced, load.settings.record_impulses = true;
  });
  rung("hard-reduced-gear_ratio-per-environment", [&](Load& load) {
    coupled(load, Hard{}), load.settings.method = Method::reduced;
    load.settings.per_environment = {Parameter::gear_ratio};
  });
  for (int p = 0; p < parameter_count; ++p) {
    const auto parameter = static_cast<Parameter>(p);
    rung(fmt::format("{}-per-environment", to_string(parameter)), [&](Load& load) {
      coupled(load, Hard{});
      load.settings.per_environment = {parameter};
    });
  }
}

// Bounds that are inactive all the time, and bounds that become active. The active set changes during the motion, so
// all of the motion is timed, from reset to reset.
void add_bounds() {
  const auto rung = [](const std::string& words, const std::string& scene, Method method, auto&& change) {
    Load load = bench::scene(scene, method, 1);
    for (Joint& joint : load.model.joints) change(joint);
    add(fmt::format("{}/{}/1/f32/bounds:{}", scene, to_string(load.settings.method), words), load, true)
        ->Iterations(load.reset_after / load.substeps);
  };
  for (const char* scene : {"chain8", "gripper13"})
    for (Method method : {Method::reduced, Method::direct, Method::pgs}) {
      rung("none", scene, method, [](Joint&) {});
      const std::string inactive = fmt::format("{}/{}/1/f32/bounds:limits-inactive", scene, to_string(method));
      add(inactive, bench::scene_with_ranges(scene, method), true);
      add_engine(Engine::compiled, inactive, bench::scene_with_ranges(scene, method));
#ifdef LOCKSTEP_BENCH_KERNELS
      add_engine(Engine::generated, inactive, bench::scene_with_ranges(scene, method));
#endif
      rung("velocity-limits-inactive", scene, method, [](Joint& j) { j.velocity_limit = 1e3; });
      rung("efforts-inactive", scene, method, [](Joint& j) { j.effort_limit = 1e9; });
      rung("limits-active", scene, method, [](Joint& j) { j.lower = -0.35, j.upper = 0.35; });
      rung("friction", scene, method, [](Joint& j) { j.friction = 0.1; });
      rung("efforts-active", scene, method, [](Joint& j) { j.effort_limit = 0.5; });
      rung("all-active", scene, method, [](Joint& j) {
        j.lower = -0.35, j.upper = 0.35, j.velocity_limit = 2.0, j.effort_limit = 0.5, j.friction = 0.1;
      });
    }
}

// A robot from a URDF file. Bodies without mass or inertia get small ones.
void add_robot(const std::filesystem::path& file) {
  Load load;
  load.model = import_urdf_file(file.string(), {.least_mass = 1e-3, .least_inertia = 1e-6}).model;
  load.settings.integrator = Integrator::euler;
  load.settings.ignore = {true, true, true, true};
  for (Method method : {Method::reduced, Method::direct, Method::pgs}) {
    load.settings.method = method;
    const std::string row =
        fmt::format("{}/{}/{}/f32", file.stem().string(), to_string(method), load.settings.iterations);
    add(row, load, true);
    add_engine(Engine::tables, row, load);
  }
}

}  // namespace
}  // namespace lockstep

int main(int argc, char** argv) {
  lockstep::add_peaks();
  lockstep::add_methods();
  lockstep::add_integrators();
#ifdef LOCKSTEP_BENCH_KERNELS
  lockstep::add_generated();
#endif
  for (const auto engine : {lockstep::Engine::tables, lockstep::Engine::compiled})
    lockstep::add_engines(engine, {4, 8, 16, 20, 24, 32, 64});
  lockstep::add_scaling();
  lockstep::add_sizes();
  lockstep::add_ladder();
  lockstep::add_bounds();
  benchmark::Initialize(&argc, argv);
  int options = 1;
  try {
    for (int i = 1; i < argc; ++i)
      if (argv[i][0] == '-')
        argv[options++] = argv[i];
      else
        lockstep::add_robot(argv[i]);
  } catch (const lockstep::Error& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 1;
  }
  if (benchmark::ReportUnrecognizedArguments(options, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
}
