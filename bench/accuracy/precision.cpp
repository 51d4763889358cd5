// The distance of a Batch<float> from a Batch<double>. SPDX-License-Identifier: Apache-2.0
//
// Damped chains of 2 to 64 joints, half of them coupled, fall in gravity for 1, 5 and 25 seconds. The scenes run for
// one second at smaller and smaller steps, at which more roundings add up. A row is one environment: RMS over all
// joints and the last second.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>

#include "loads.h"
#include "lockstep/batch.h"
#include "tool/csv.h"
#include "tool/output.h"

namespace lockstep {
namespace {

double distance(const Model& model, Integrator integrator, int rate, int seconds) {
  const Plan plan = compile(model, {.dt = 1.0 / rate, .integrator = integrator});
  Batch<float> f32(plan, 1, {.threads = 1});
  Batch<double> f64(plan, 1, {.threads = 1});
  double sum = 0.0;
  for (long step = 0; step < static_cast<long>(rate) * seconds; ++step) {
    f32.step(), f64.step();
    if (step >= static_cast<long>(rate) * (seconds - 1))
      sum += (f32.positions().cast<double>() - f64.positions()).square().mean() / rate;
  }
  return f32.faulted() + f64.faulted() > 0 ? infinity : std::sqrt(sum);
}

}  // namespace
}  // namespace lockstep

int main(int argc, char** argv) {
  using namespace lockstep;
  std::string csv;
  bool quick = false;
  CLI::App app("Measures the distance of single precision from double.", "precision");
  app.add_option("--csv", csv, "File for the table (default: standard output)");
  app.add_flag("--quick", quick, "Only tests that the program runs");
  CLI11_PARSE(app, argc, argv);
  std::unique_ptr<tool::OutputFile> file;
  if (!csv.empty()) file = std::make_unique<tool::OutputFile>(csv);
  const auto write = [&](const std::string& line) { file ? file->write(line) : fmt::print("{}", line); };
  write("model,joints,integrator,steps_per_second,seconds,rms\n");
  const auto measure = [&](const std::string& name, const Model& model, Integrator integrator, int rate, int seconds) {
    write(fmt::format("{},{},{},{},{},{:.2e}\n", name, model.joints.size(), lockstep::to_string(integrator), rate,
                      seconds, distance(model, integrator, rate, seconds)));
  };
  for (const int joints : {2, 4, 8, 16, 32, 64})
    for (const int seconds : {1, 5, 25})
      if (!quick || (joints == 8 && seconds == 1))
        for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog})
          measure("chain", bench::chain(joints, joints < 4 ? 0 : joints / 2, Method::reduced).model, integrator, 240,
                  seconds);
  for (const char* scene : {"chain8", "gripper13", "chain32"})
    for (const int rate : {60, 240, 960, 3840})
      if (!quick || rate == 60)
        for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog, Integrator::extrapolated})
          measure(scene, bench::scene(scene, Method::reduced, 1).model, integrator, rate, 1);
  if (file) file->close();
}
