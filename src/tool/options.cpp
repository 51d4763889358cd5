// SPDX-License-Identifier: Apache-2.0
#include "options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <cmath>

#include "text.h"
#include "tool.h"

namespace lockstep::tool {
namespace {

constexpr Method all_methods[] = {Method::automatic, Method::pgs, Method::tgs, Method::direct, Method::reduced};

struct NamedPair {
  std::string name;
  double first, second;
};

// "NAME=X,Y". The name may hold an equals sign, numbers do not.
NamedPair named_pair(const std::string& text, const std::string& option) {
  const std::size_t equals = text.rfind('=');
  if (equals == std::string::npos || equals == 0)
    throw InputError(fmt::format("{}: '{}' should be JOINT=NUMBER,NUMBER", option, text));
  const std::string what = option + " " + text.substr(0, equals);
  const std::vector<double> numbers = to_numbers(text.substr(equals + 1), 2, what);
  if (numbers[0] < 0.0 || numbers[1] < 0.0) throw InputError(fmt::format("{}: '{}' is negative", what, text));
  return {text.substr(0, equals), numbers[0], numbers[1]};
}

void soften(const NamedPair& softness, Model& model) {
  const std::vector<std::string> names = coupling_names(model);
  for (std::size_t c = 0; c < names.size(); ++c)
    if (names[c] == softness.name) {
      model.couplings[c].softness = Softness::frequency(softness.first, softness.second);
      return;
    }
  throw InputError(fmt::format("--softness: no coupling has '{}' as its first joint; the couplings are: {}",
                               softness.name, names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "))));
}

void drive(const NamedPair& gains, Model& model) {
  for (Joint& joint : model.joints)
    if (joint.name == gains.name) {
      if (!joint.moves()) throw InputError(fmt::format("--drive: joint '{}' is fixed; name a moving one", gains.name));
      joint.drive.kp = gains.first, joint.drive.kd = gains.second;
      return;
    }
  throw InputError(fmt::format("--drive: model '{}' has no joint '{}'", model.name, gains.name));
}

}  // namespace

void ModelOptions::add_to(CLI::App& app) {
  app.add_option("MODEL", file, "The mechanism, a URDF file")->required();
  CLI::Option* floats = app.add_flag("--floating-base", floating, "The root link floats in the world");
  app.add_flag("--fixed-base")->description("The root link is bolted to the world (default)")->excludes(floats);
  const auto vector = [](const std::string& text) {
    const std::vector<double> numbers = to_numbers(text, 3, "--gravity");
    return Eigen::Vector3d(numbers[0], numbers[1], numbers[2]);
  };
  add_parsed(app, "--gravity", gravity, vector, "m/s^2, world axes")->type_name("X,Y,Z")->default_str("0,0,-9.81");
  app.add_option("--erp", erp, "Share of its error that a hard coupling corrects per step")
      ->type_name("E")
      ->default_str("0.2")
      ->check(CLI::Number);
  app.add_option("--softness", softness,
                 "Makes the coupling whose first joint is JOINT soft: natural frequency in rad/s, damping ratio. "
                 "Repeatable; JOINT#2 is the second coupling of that first joint")
      ->type_name("JOINT=MU,ZETA")
      ->allow_extra_args(false);
  app.add_option("--drive", drives, "Gives a joint a position drive with these gains. Repeatable")
      ->type_name("JOINT=KP,KD")
      ->allow_extra_args(false);
}

void apply(const ModelOptions& options, Model& model) {
  model.root.floating = options.floating;
  model.gravity = options.gravity;
  if (options.erp)
    for (Coupling& coupling : model.couplings)
      if (coupling.softness.kind == Softness::Kind::hard) coupling.softness = Softness::hard(*options.erp);
  for (const std::string& text : options.softness) soften(named_pair(text, "--softness"), model);
  for (const std::string& text : options.drives) drive(named_pair(text, "--drive"), model);
}

Import ModelOptions::load() const {
  Import import = import_urdf_file(file);
  apply(*this, import.model);
  return import;
}

void StepOptions::add_to(CLI::App& app) {
  add_parsed(app, "--dt", settings.dt, [](const std::string& text) { return seconds_of(text, "--dt"); },
             "Step size in s, a number or a fraction")
      ->type_name("H")
      ->default_str("1/240");
  add_parsed(app, "--method", settings.method, method_of,
             "How couplings are solved: automatic, pgs, tgs, direct, reduced")
      ->type_name("M")
      ->default_str("automatic");
  app.add_option("--iterations", settings.iterations, "Sweeps of pgs, sub-steps of tgs")
      ->type_name("K")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000));
  app.add_option("--velocity-iterations", settings.velocity_iterations, "Sweeps after the position update")
      ->type_name("K")
      ->capture_default_str()
      ->check(CLI::Range(0, 1000));
}

Method method_of(const std::string& text) {
  std::string known;
  for (const Method method : all_methods) {
    if (text == name(method)) return method;
    known += std::string(known.empty() ? "" : ", ") + name(method);
  }
  throw InputError(fmt::format("--method: there is no '{}'; the methods are {}", text, known));
}

double seconds_of(const std::string& text, const std::string& what) {
  const std::optional<double> seconds = to_fraction(text);
  if (!seconds || !(*seconds > 0.0) || !std::isfinite(*seconds))
    throw InputError(fmt::format("{}: '{}' is not a time in s, a number or fraction above 0", what, text));
  return *seconds;
}

}  // namespace lockstep::tool
