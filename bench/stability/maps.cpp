// SPDX-License-Identifier: Apache-2.0
#include "maps.h"

#include <algorithm>
#include <cmath>

#include "mechanisms.h"

namespace lockstep::stability {
namespace {

constexpr int points = 20;

std::vector<double> logarithmic(double first, double last) {
  std::vector<double> values;
  for (int i = 0; i < points; ++i) values.push_back(first * std::pow(last / first, i / (points - 1.0)));
  return values;
}

Axis step_sizes() {
  Axis axis{"dt", {}};
  for (const double rate : logarithmic(1000.0, 30.0)) axis.values.push_back(1.0 / std::round(rate));
  return axis;
}

Axis sweep_counts() {
  return {"sweeps", {1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512}};
}

Axis counts(const std::string& name) {
  Axis axis{name, {}};
  for (int i = 1; i <= points; ++i) axis.values.push_back(i);
  return axis;
}

Axis in_environments(const std::string& name, double first, double last) {
  return {name, logarithmic(first, last), true};
}
Axis in_plans(const std::string& name, double first, double last) { return {name, logarithmic(first, last)}; }

Setup swept(Model model, double sweeps) { return {std::move(model), 1.0 / 240, static_cast<int>(sweeps)}; }

std::vector<Map> full_maps() {
  const Axis mass = in_environments("mass_ratio", 1e-6, 1e6), gear = in_environments("gear_ratio", 1e-4, 1e4);
  return {
      {"followers_sweeps",
       sweep_counts(),
       counts("followers"),
       {},
       {},
       [](double sweeps, double followers) { return swept(hand(static_cast<int>(followers)), sweeps); }},
      {"chain_sweeps",
       sweep_counts(),
       counts("couplings"),
       {},
       {},
       [](double sweeps, double couplings) { return swept(chain_of_couplings(static_cast<int>(couplings)), sweeps); }},
      {"gear_sweeps",
       sweep_counts(),
       gear,
       {Parameter::gear_ratio},
       {},
       [](double sweeps, double ratio) { return swept(geared_arm(ratio, 1.0), sweeps); }},
      {"mass_dt",
       step_sizes(),
       mass,
       {Parameter::mass, Parameter::damping},
       {},
       [](double dt, double ratio) {
         return Setup{geared_arm(1.0, ratio), dt};
       }},
      {"mass_gear",
       gear,
       mass,
       {Parameter::gear_ratio, Parameter::mass, Parameter::damping},
       {},
       [](double ratio, double mass_ratio) { return Setup{geared_arm(ratio, mass_ratio)}; }},
      {"damping_dt",
       step_sizes(),
       in_environments("damping", 1e-4, 1.0),
       {Parameter::damping},
       {},
       [](double dt, double damping) {
         return Setup{damped_arm(damping), dt};
       }},
      {"stiffness_dt",
       step_sizes(),
       in_environments("kp", 1.0, 1e8),
       {Parameter::drive_gains},
       {},
       [](double dt, double kp) {
         return Setup{driven_arm(kp), dt};
       }},
      {"error_dt",
       step_sizes(),
       in_environments("initial_error", 1e-3, 10.0),
       {},
       {},
       [](double dt, double error) {
         return Setup{displaced_arm(error), dt};
       }},
      {"frequency_dt",
       step_sizes(),
       in_plans("frequency", 0.5, 100.0),
       {},
       Judge::closed_form,
       [](double dt, double frequency) {
         return Setup{soft_star(frequency, 0.1), dt};
       }},
      {"frequency_damping",
       in_plans("damping_ratio", 0.01, 10.0),
       in_plans("frequency", 0.5, 100.0),
       {},
       Judge::closed_form,
       [](double damping, double frequency) { return Setup{soft_star(frequency, damping)}; }},
  };
}

void thin_out(Axis& axis) {
  std::vector<double> kept;
  for (std::size_t i = 0; i < axis.values.size(); i += 4) kept.push_back(axis.values[i]);
  axis.values = kept;
}

}  // namespace

std::vector<Map> all_maps(bool quick) {
  std::vector<Map> maps = full_maps();
  if (quick)
    for (Map& map : maps) thin_out(map.x), thin_out(map.y);
  return maps;
}

}  // namespace lockstep::stability
