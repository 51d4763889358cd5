// What contacts cost where no two environments do the same. SPDX-License-Identifier: Apache-2.0
//
//   divergence_bench [f32|f64] [environments] [euler|leapfrog] [seconds] [learning|default|accurate] [seed]
//   divergence_bench export FOLDER
//
// The second writes the models as MJCF, for divergence_peer.mjs. The first prints one JSON line for each scene of
// tests/divergence_scenes.h and each motion: still, and random targets within +-0.1 and +-0.5 rad every 50 ms, the same
// in all environments or others in each. Where they differ, masses and friction do too, and environments are reset in
// turn. `seed` is that of the targets, masses and frictions.
//
// A line has the processor time of a step of one environment on one thread (us; least, median and ninth decile of
// stretches of 50 steps), faults, resets, and the means of Quantity::solve_counts. `error` is the difference of
// velocities to the same step with 100 passes to 2e-6, over 1 + the largest velocity: median and 99 % of every eighth
// step.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <iterator>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "cpu_seconds.h"
#include "divergence_scenes.h"
#include "plan/program.h"

using namespace lockstep;
using namespace lockstep::contact_scenes;
using lockstep::bench::cpu_seconds;

namespace {

struct Options {
  int environments = 256;
  Integrator integrator = Integrator::euler;
  double duration = 4.0;
  std::string settings = "default";
  ContactSettings contacts;
  unsigned seed = 7;
};

/// The plan, which nobody else has, with contact solves that go on until they converge. Its own settings do not say so:
/// a batch with others would begin without what the state remembers of contacts.
template <class S>
Plan converging(Plan plan) {
  const auto change = [](const Tables<S>* t) {
    if (!t) return;
    ContactTables<S>& contacts = const_cast<Tables<S>*>(t)->contacts;
    contacts.passes = 100, contacts.rounds = 200, contacts.tolerance = S(2e-6);
  };
  for (const Tables<S>* t = &tables<S>(program_of(plan)); t; t = t->half) change(t), change(t->midpoint);
  return plan;
}

/// Errors of the last step of `batch`, whose state before it is `blob`, against one of `exact`.
template <class S>
void add_errors(const Batch<S>& batch, const std::vector<std::byte>& blob, Batch<S>& exact,
                std::vector<double>& errors) {
  exact.restore(blob);
  exact.step(1);
  for (int e = 0; e < batch.environments(); ++e) {
    double difference = 0.0, fastest = 0.0;
    const auto compare = [&](const auto& ours, const auto& other) {
      for (Eigen::Index row = 0; row < ours.rows(); ++row) {
        difference = std::max(difference, std::abs(static_cast<double>(ours(row, e) - other(row, e))));
        fastest = std::max(fastest, std::abs(static_cast<double>(other(row, e))));
      }
    };
    compare(batch.velocities(), std::as_const(exact).velocities());
    compare(batch.root_velocities(), std::as_const(exact).root_velocities());
    errors.push_back(difference / (1.0 + fastest));
  }
}

template <class S>
void run(const char* name, const Model& model, double dt, double amplitude, bool differ, const Options& options) {
  const int environments = options.environments, steps = static_cast<int>(options.duration / dt);
  StepSettings settings;
  settings.dt = dt, settings.integrator = options.integrator;
  settings.per_environment = {Parameter::mass, Parameter::contact_friction};
  settings.contacts = options.contacts;
  const Plan plan = compile(model, settings);
  Batch<S> batch(plan, environments, {.threads = 1});
  Batch<S> exact(converging<S>(compile(model, settings)), environments, {.threads = 1});
  std::mt19937 random(options.seed);
  const auto within = [&](double most) { return std::uniform_real_distribution<double>(-most, most)(random); };
  for (const Parameter parameter : {Parameter::mass, Parameter::contact_friction}) {
    auto rows = batch.parameter(parameter);
    for (int e = 0; differ && e < environments; ++e) rows.col(e) *= static_cast<S>(1.0 + within(0.2));
  }
  std::vector<std::pair<int, double>> driven;  // dof, target at rest
  for (const Joint& joint : plan.model().joints)
    if (joint.drive.kp > 0.0) driven.emplace_back(plan.dof(joint.name), joint.drive.position_target);

  const int control = std::max(1, static_cast<int>(0.05 / dt + 0.5)), stretch = 50, cycle = 40 * control;
  const Query counted{Quantity::solve_counts}, capped{Quantity::unfinished_contacts};
  typename Batch<S>::Array counts(plan.query_rows(counted), environments), unfinished(1, environments);
  Eigen::ArrayXd sums = Eigen::ArrayXd::Zero(counts.rows());
  std::vector<double> microseconds, errors;
  std::vector<int> again;
  double spent = 0.0;
  int faults = 0, resets = 0;
  for (int i = 0; i < steps; ++i) {
    if (amplitude > 0.0 && i % control == 0)
      for (const auto& [dof, rest] : driven) {
        const double same = within(amplitude);
        for (int e = 0; e < environments; ++e)
          batch.position_targets()(dof, e) = static_cast<S>(rest + (differ ? within(amplitude) : same));
      }
    const std::vector<std::byte> blob = i % 8 == 0 ? batch.save() : std::vector<std::byte>();
    const double begin = cpu_seconds();
    batch.step(1);
    spent += cpu_seconds() - begin;
    if (!blob.empty()) add_errors(std::as_const(batch), blob, exact, errors);
    batch.read(std::span(&counted, 1), {counts.data(), environments, 1});
    sums += counts.template cast<double>().rowwise().sum();
    if (i % stretch == stretch - 1) {
      microseconds.push_back(1e6 * spent / stretch / environments);
      spent = 0.0;
    }
    again.clear();
    for (int e = 0; e < environments; ++e) {
      const bool failed = batch.faults()[e] != Fault::none;
      faults += failed;
      if (failed || (differ && amplitude > 0.0 && i % cycle == (e * 7919) % cycle)) again.push_back(e);
    }
    if (!again.empty()) batch.reset(again);
    resets += static_cast<int>(again.size());
  }
  batch.read(std::span(&capped, 1), {unfinished.data(), environments, 1});
  std::sort(microseconds.begin(), microseconds.end());
  std::sort(errors.begin(), errors.end());
  sums /= sums[0];
  std::printf(
      "{\"scene\": \"%s\", \"targets\": %g, \"differ\": %s, \"precision\": \"f%zu\", \"target\": \"%s\", "
      "\"integrator\": "
      "\"%s\", \"settings\": \"%s\", \"environments\": %d, ",
      name, amplitude, differ ? "true" : "false", 8 * sizeof(S), to_string(batch.target()),
      to_string(plan.integrator()), options.settings.c_str(), environments);
  std::printf("\"us_min\": %.3f, \"us_median\": %.3f, \"us_p90\": %.3f, \"faults\": %d, \"resets\": %d, ",
              microseconds.front(), microseconds[microseconds.size() / 2], microseconds[microseconds.size() * 9 / 10],
              faults, resets);
  const char* const names[] = {"near",   "points", "pressing",    "solves",      "passes",
                               "rounds", "trials", "tile_points", "tile_rounds", "tile_trials"};
  for (int k = 0; k < 10; ++k) std::printf("\"%s\": %.3g, ", names[k], sums[k + 1]);
  std::printf("\"error\": %.1e, \"error_99\": %.1e, ", errors[errors.size() / 2], errors[errors.size() * 99 / 100]);
  std::printf("\"unfinished\": %g}\n", static_cast<double>(unfinished.sum()));
  std::fflush(stdout);
}

struct Scene {
  const char *name, *file;
  Model model;
  double dt;
};

std::vector<Scene> scenes() {
  return {{"quadruped, feet", "feet.xml", limited_quadruped(false), 1.0 / 240},
          {"quadruped, all pairs", "all_pairs.xml", limited_quadruped(true), 1.0 / 240},
          {"hand with cube", "hand.xml", hand_with_cube(), 1.0 / 200}};
}

template <class S>
void all(const Options& options) {
  for (const Scene& scene : scenes()) {
    run<S>(scene.name, scene.model, scene.dt, 0.0, false, options);
    for (const double amplitude : {0.1, 0.5})
      for (const bool differ : {false, true}) run<S>(scene.name, scene.model, scene.dt, amplitude, differ, options);
  }
}

}  // namespace

int main(int count, char** arguments) {
  if (count == 3 && std::string(arguments[1]) == "export") {
    for (const Scene& scene : scenes()) export_mjcf_file(scene.model, std::string(arguments[2]) + "/" + scene.file);
    return 0;
  }
  Options options;
  const bool twice = count > 1 && std::string(arguments[1]) == "f64";
  if (count > 2) options.environments = std::atoi(arguments[2]);
  const std::string steps_by = count > 3 ? arguments[3] : "euler";
  if (steps_by == "leapfrog") options.integrator = Integrator::leapfrog;
  if (count > 4) options.duration = std::atof(arguments[4]);
  if (count > 5) options.settings = arguments[5];
  const auto named =
      std::ranges::find(all_contact_settings, options.settings, [](const auto& entry) { return entry.first; });
  const bool is_known = named != std::end(all_contact_settings);
  if (is_known) options.contacts = named->second;
  if (count > 6) options.seed = static_cast<unsigned>(std::strtoul(arguments[6], nullptr, 10));
  if (options.environments < 1 || options.duration < 0.5 || !is_known ||
      (steps_by != "euler" && steps_by != "leapfrog")) {
    std::fprintf(stderr,
                 "divergence_bench [f32|f64] [environments] [euler|leapfrog] [seconds, at least 0.5] "
                 "[learning|default|accurate] [seed]\n"
                 "divergence_bench export FOLDER\n");
    return 2;
  }
  twice ? all<double>(options) : all<float>(options);
}
