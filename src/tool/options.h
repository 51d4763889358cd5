// Options that several subcommands have: the mechanism and the step. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "lockstep/batch.h"
#include "lockstep/import.h"
#include "lockstep/step.h"

namespace CLI {
class Validator;
class App;
class Option;
}  // namespace CLI

namespace lockstep::tool {

/// The mechanism, and what is changed in it before it is compiled.
struct ModelOptions {
  std::string file;
  ImportOptions import;
  std::optional<bool> floating;            ///< as in the file if empty
  std::optional<Eigen::Vector3d> gravity;  ///< as in the file if empty
  std::optional<double> erp;               ///< of every hard coupling
  std::vector<std::string> softness;       ///< "JOINT=MU,ZETA", or "MU,ZETA" for all couplings
  std::vector<std::string> damping;        ///< "JOINT=D", or "D" for all joints
  std::vector<std::string> armature;       ///< "JOINT=A", or "A" for all joints
  std::vector<std::string> sites;          ///< "NAME=LINK" or "NAME=LINK,X,Y,Z"
  std::vector<std::string> force_limits;   ///< "JOINT=F"
  std::vector<std::string> drives;         ///< "JOINT=KP,KD"
  std::vector<std::string> kinematic;      ///< "JOINT"
  std::optional<double> ground;            ///< friction of a half-space below z = 0, which the robot may touch
  std::vector<std::string> contacts;       ///< "COLLIDER,COLLIDER", groups too
  bool leave_out_contacts = false;         ///< all, those of the file too

  void add_to(CLI::App& app);
  /// Reads the file and applies the other options. What is ignored is not judged. Throws InputError and
  /// lockstep::Error.
  Import read(const Ignored& ignore) const;
  /// The same, with the import's warnings on standard error. An error of the file is a Fixable. Throws InputError where
  /// one of the outputs is a file that was read, such as a mesh.
  Import load(const Ignored& ignore, const std::vector<std::string>& outputs = {}) const;
};

/// Applies the options to a model, without reading a file.
void apply(const ModelOptions& options, Model& model);

/// The settings of the step.
struct StepOptions {
  StepSettings settings;
  void add_to(CLI::App& app);
};

/// Adds --ignore alone. StepOptions adds it too.
void add_ignore(CLI::App& app, Ignored& ignore);

/// The value of this name. They throw InputError, which lists the known names.
Method method_of(const std::string& name);
Integrator integrator_of(const std::string& name);
Engine engine_of(const std::string& name);
ContactSettings contact_settings_of(const std::string& name);

/// Adds those of a list such as "position_limits:left,friction:followers,effort_limits". Throws InputError, which lists
/// the known names.
void ignore_also(const std::string& list, Ignored& ignored);

/// Adds an option. `parse` turns its text into `value`, or throws InputError.
template <class App, class Value, class Parse>
CLI::Option* add_parsed(App& app, const std::string& names, Value& value, Parse parse, const std::string& help) {
  return app.template add_option_function<std::string>(
      names, [&value, parse](const std::string& text) { value = parse(text); }, help);
}

/// Checks that an option is a finite number from `low` to `high`.
CLI::Validator number_from(double low, double high = std::numeric_limits<double>::max());

/// A time in s above 0, written as a number or a fraction. Throws InputError, whose message starts with `what`.
double seconds_of(const std::string& text, const std::string& what);

}  // namespace lockstep::tool
