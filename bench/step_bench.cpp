// Throughput of the step: step/<scene>/<method>/<iterations>/<precision>[/words]. SPDX-License-Identifier: Apache-2.0
//
// One thread, 4096 environments, 4 sub-steps per call unless the words behind say otherwise. The ladder adds one
// feature at a time to a chain of eight. Counter env_steps_per_second is per second of CPU time (wall time where
// threads > 1). Rows peak/<instructions> and peak/memory are what the machine can do at best.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include "lockstep/lockstep.h"
#include "peak.h"
#include "scenes/scenes.h"

namespace lockstep {
namespace {

struct Load {
  Model model;
  StepSettings settings;
  int environments = 4096;
  int substeps = 4;
  int threads = 1;
};

template <class S>
void run(benchmark::State& state, const Load& load) {
  const Plan plan = compile(load.model, load.settings);
  Batch<S> batch(plan, load.environments, {.threads = load.threads});
  batch.step(load.substeps);
  int steps = 0;
  for (auto _ : state) {
    batch.step(load.substeps);
    if (++steps % 64 == 0) {  // near the start of the motion, where nothing has blown up or come to rest
      state.PauseTiming();
      batch.reset();
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

void add(const std::string& name, const Load& load, bool single) {
  auto* b = benchmark::RegisterBenchmark(("step/" + name).c_str(), [load, single](benchmark::State& s) {
    single ? run<float>(s, load) : run<double>(s, load);
  });
  if (load.threads != 1) b->UseRealTime();
}

Load of(const std::string& scene, Method method, int iterations) {
  Load load;
  load.model = scenes::scene(scene).model;
  load.settings.method = method;
  load.settings.iterations = iterations;
  return load;
}

void add_methods() {
  for (const char* scene : {"chain8", "gripper13", "chain32"})
    for (bool single : {true, false}) {
      const char* precision = single ? "f32" : "f64";
      for (Method method : {Method::reduced, Method::direct})
        add(fmt::format("{}/{}/1/{}", scene, name(method), precision), of(scene, method, 1), single);
      for (Method method : {Method::pgs, Method::tgs})
        for (int iterations : {1, 4, 16})
          add(fmt::format("{}/{}/{}/{}", scene, name(method), iterations, precision), of(scene, method, iterations),
              single);
    }
}

// All benchmarks have the same counters, or there is no table.
void add_peaks() {
  const auto count = [](benchmark::State& state, double flops) {
    state.counters["env_steps_per_second"] = 0.0;
    state.counters["flops_per_step"] = 0.0;
    state.counters["gflops"] = benchmark::Counter(flops * 1e-9, benchmark::Counter::kIsRate);
  };
  for (const bench::Peak peak : bench::all_peaks) {
    if (!bench::supported(peak)) continue;
    benchmark::RegisterBenchmark(fmt::format("peak/{}", bench::name(peak)).c_str(),
                                 [count, peak](benchmark::State& state) {
                                   double flops = 0.0;
                                   for (auto _ : state) flops += bench::run_peak(peak, 1000);
                                   count(state, flops);
                                 });
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
  const auto scaled = [](const char* scene, const std::string& words, auto&& change) {
    Load load = of(scene, Method::reduced, 1);
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

// A chain like chain8, of any length, the first joints of which are coupled as there.
Model chain(int joints, int couplings) {
  const Model eight = scenes::chain8();
  Model model = eight;
  model.links.resize(1);
  model.joints.clear();
  model.couplings.clear();
  for (int i = 0; i < joints; ++i) {
    Joint joint = eight.joints[i == 0 ? 0 : 2 - i % 2];
    joint.name = fmt::format("j{}", i);
    joint.parent = model.links.back().name;
    joint.child = fmt::format("l{}", i);
    model.links.push_back({joint.child, eight.links[1].inertia});
    model.joints.push_back(joint);
  }
  for (int c = 0; c < couplings; ++c) {
    const int first = 4 * (c / 2) + c % 2;
    model.couplings.push_back(Coupling::mimic(fmt::format("j{}", first), fmt::format("j{}", first + 2), -1.0));
  }
  return model;
}

void add_sizes() {
  for (int joints : {1, 2, 4, 8, 16, 32, 64})
    for (const bool coupled : {false, true}) {
      if (coupled && joints < 4) continue;
      Load load{.model = chain(joints, coupled ? joints / 2 : 0), .settings = {.method = Method::reduced}};
      add(fmt::format("chain/reduced/1/f32/{}dofs:{}", coupled ? "coupled/" : "", joints), load, true);
    }
  for (int couplings = 0; couplings <= 8; ++couplings)
    for (Method method : {Method::reduced, Method::direct, Method::pgs}) {
      Load load{.model = chain(16, couplings), .settings = {.method = method}};
      add(fmt::format("chain16/{}/{}/f32/couplings:{}", name(method), method == Method::pgs ? 4 : 1, couplings), load,
          true);
    }
}

// What each feature costs: the same chain with more and more of them.
void add_ladder() {
  const auto rung = [](const std::string& words, auto&& change) {
    Load load = of("chain8", Method::direct, 1);
    load.model.couplings.clear();
    for (Joint& joint : load.model.joints) joint.damping = 0.0;
    change(load);
    add(fmt::format("chain8/{}/1/f32/ladder:{}", name(load.settings.method), words), load, true);
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
  rung("hard-reduced", [&](Load& load) { coupled(load, Softness::hard()), load.settings.method = Method::reduced; });
  rung("hard-direct", [&](Load& load) { coupled(load, Softness::hard()); });
  rung("soft-spring", [&](Load& load) { coupled(load, Softness::spring(20.0, 1.0)); });
  rung("soft-frequency", [&](Load& load) { coupled(load, Softness::frequency(30.0, 1.0)); });
  rung("soft-frequency-damping", [&](Load& load) { damped(load), coupled(load, Softness::frequency(30.0, 1.0)); });
  rung("hard-reduced-impulses", [&](Load& load) {
    coupled(load, Softness::hard()), load.settings.method = Method::reduced, load.settings.record_impulses = true;
  });
  rung("hard-reduced-gear_ratio-per-environment", [&](Load& load) {
    coupled(load, Softness::hard()), load.settings.method = Method::reduced;
    load.settings.per_environment = {Parameter::gear_ratio};
  });
  for (int p = 0; p < parameter_count; ++p) {
    const auto parameter = static_cast<Parameter>(p);
    rung(fmt::format("{}-per-environment", name(parameter)), [&](Load& load) {
      coupled(load, Softness::hard());
      load.settings.per_environment = {parameter};
    });
  }
}

// What competes with couplings: bounds that are stated and do not act, and bounds that do.
void add_bounds() {
  const auto rung = [](const std::string& words, const std::string& scene, Method method, auto&& change) {
    Load load = of(scene.c_str(), method, 1);
    for (Joint& joint : load.model.joints) change(joint);
    add(fmt::format("{}/{}/1/f32/bounds:{}", scene, name(load.settings.method), words), load, true);
  };
  for (const char* scene : {"chain8", "gripper13"})
    for (Method method : {Method::reduced, Method::direct, Method::pgs}) {
      rung("none", scene, method, [](Joint&) {});
      rung("limits-idle", scene, method, [](Joint& j) { j.lower = -1e3, j.upper = 1e3; });
      rung("velocity-limits-idle", scene, method, [](Joint& j) { j.velocity_limit = 1e3; });
      rung("efforts-idle", scene, method, [](Joint& j) { j.effort_limit = 1e9; });
      rung("limits-acting", scene, method, [](Joint& j) { j.lower = -0.35, j.upper = 0.35; });
      rung("friction", scene, method, [](Joint& j) { j.friction = 0.1; });
      rung("efforts-acting", scene, method, [](Joint& j) { j.effort_limit = 0.5; });
      rung("all-acting", scene, method, [](Joint& j) {
        j.lower = -0.35, j.upper = 0.35, j.velocity_limit = 2.0, j.effort_limit = 0.5, j.friction = 0.1;
      });
    }
}

}  // namespace
}  // namespace lockstep

int main(int argc, char** argv) {
  lockstep::add_peaks();
  lockstep::add_methods();
  lockstep::add_scaling();
  lockstep::add_sizes();
  lockstep::add_ladder();
  lockstep::add_bounds();
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
}
