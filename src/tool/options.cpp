// SPDX-License-Identifier: Apache-2.0
#include "options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <utility>
#include <vector>

#include "fix.h"
#include "output.h"
#include "text.h"
#include "tool.h"

namespace lockstep::tool {
namespace {

constexpr Integrator all_integrators[] = {Integrator::automatic, Integrator::euler, Integrator::leapfrog,
                                          Integrator::extrapolated, Integrator::runge_kutta};
constexpr Method all_methods[] = {Method::automatic, Method::pgs, Method::tgs, Method::direct, Method::reduced};
constexpr Engine all_engines[] = {Engine::automatic, Engine::tables, Engine::compiled, Engine::generated};

constexpr Loops all_loops[] = {Loops::keep, Loops::leave_out};
constexpr Fit all_fits[] = {Fit::hull, Fit::box, Fit::capsule, Fit::none};
constexpr Soft all_soft[] = {Soft::harden, Soft::as_in_file};

using NamedContactSettings = std::pair<const char*, ContactSettings>;
const char* name_of(const NamedContactSettings& settings) { return settings.first; }
template <class E>
const char* name_of(E value) {
  return to_string(value);
}

// The one of `all` whose name is `text`.
template <class E, std::size_t n>
E named(const E (&all)[n], const std::string& text, const char* option, const char* what) {
  std::vector<const char*> known;
  for (const E& value : all) {
    if (text == name_of(value)) return value;
    known.push_back(name_of(value));
  }
  throw InputError(fmt::format("{}: there is no '{}'; the {} are {}", option, text, what, fmt::join(known, ", ")));
}

Fit fit_named(const std::string& text, const char* option) { return named(all_fits, text, option, "fits"); }

// From "NAME=TEXT".
std::pair<std::string, std::string> in_two(const std::string& text, const char* option) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0)
    throw InputError(fmt::format("{}: '{}' should have a name before an equals sign", option, text));
  return {text.substr(0, equals), text.substr(equals + 1)};
}

void add_meshes(CLI::App& app, ImportOptions& import) {
  app.add_flag("--leave-out-meshes", import.leave_out_meshes, "Opens no mesh: they neither touch nor give inertia");
  app.add_option("--hull-vertices", import.hull_vertices, "Corners of the hull of a mesh, 8 to 64")->type_name("N");
  add_parsed(
      app, "--fit", import.fit, [](const std::string& text) { return fit_named(text, "--fit"); },
      "What touches in place of a mesh: hull, box, capsule or none")
      ->type_name("FIT")
      ->default_str("hull");
  app.add_option_function<std::vector<std::string>>(
         "--fit-of-links",
         [&import](const std::vector<std::string>& texts) {
           for (const std::string& text : texts) {
             const auto [link, fit] = in_two(text, "--fit-of-links");
             import.fit_of_links[link] = fit_named(fit, "--fit-of-links");
           }
         },
         "The same for the meshes of one link. Repeatable")
      ->type_name("LINK=FIT")
      ->allow_extra_args(false);
  app.add_option_function<std::vector<std::string>>(
         "--packages",
         [&import](const std::vector<std::string>& texts) {
           for (const std::string& text : texts) {
             const auto [name, folder] = in_two(text, "--packages");
             import.packages[name] = folder;
           }
         },
         "Where the package of package://NAME/... lies. Repeatable")
      ->type_name("NAME=FOLDER")
      ->allow_extra_args(false);
  app.add_option("--file-roots", import.file_roots,
                 "Another folder that meshes and included files may lie in. Repeatable")
      ->type_name("FOLDER")
      ->allow_extra_args(false);
}

}  // namespace

void ModelOptions::add_to(CLI::App& app) {
  app.add_option("MODEL", file, "The mechanism, a URDF or MJCF file")->required();
  const auto bound = [&](const char* name, double& value, const char* unit, const char* help) {
    app.add_option(name, value, help)->type_name(unit)->check(number_from(0.0))->take_last();
  };
  bound("--density", import.density, "KG_M3",
        "Bodies without inertia get that of their collision shapes, of this density");
  app.add_flag("--repair-inertias", import.repair_inertias,
               "An inertia that no body can have becomes the nearest possible one");
  bound("--least-mass", import.least_mass, "KG", "Raises the mass of lighter bodies to this; repairs inertias, too");
  bound("--least-inertia", import.least_inertia, "KG_M2",
        "Raises smaller principal moments of bodies with mass to this; repairs inertias, too");
  app.add_flag("--leave-out-foreign", import.leave_out_foreign,
               "Leaves out closed loops and couplings that other tools add to URDF");
  app.add_option("--keyframe", import.keyframe, "MJCF: the <key> to start in, by name or number from 0")
      ->type_name("KEY");
  app.add_option("--body", import.body, "MJCF: reads this body and what it carries, and leaves out all else")
      ->type_name("BODY");
  add_parsed(
      app, "--loops", import.loops,
      [](const std::string& text) { return named(all_loops, text, "--loops", "choices"); },
      "MJCF: leave_out reads the trees without connect and weld")
      ->type_name("CHOICE")
      ->default_str("keep");
  add_parsed(
      app, "--soft", import.soft, [](const std::string& text) { return named(all_soft, text, "--soft", "choices"); },
      "MJCF: as_in_file leaves couplings as soft as the file says")
      ->type_name("CHOICE")
      ->default_str("harden");
  app.add_flag("!--no-self-collisions", import.self_collisions, "MJCF: leaves out pairs of a robot with itself");
  add_meshes(app, import);
  CLI::Option* floats = app.add_flag_callback(
      "--floating-base", [this] { floating = true; }, "Lets root links float in the world (default: as in the file)");
  app.add_flag_callback(
         "--fixed-base", [this] { floating = false; }, "Bolts root links to the world")
      ->excludes(floats);
  const auto vector = [](const std::string& text) {
    const std::vector<double> numbers = to_numbers(text, 3, "--gravity");
    return Eigen::Vector3d(numbers[0], numbers[1], numbers[2]);
  };
  add_parsed(app, "--gravity", gravity, vector,
             "Gravity in m/s^2, world axes (default: as in the file; 0,0,-9.81 for URDF)")
      ->type_name("X,Y,Z");
  app.add_option("--erp", erp, "Share of its error that every hard coupling corrects per step")
      ->type_name("E")
      ->default_str("0.2")
      ->check(number_from(std::numeric_limits<double>::lowest()));
  app.add_option("--softness", softness,
                 "Makes the coupling whose first joint is JOINT a spring: natural frequency in rad/s, damping ratio. "
                 "JOINT#2 is its second coupling. Without JOINT: all couplings. Repeatable")
      ->type_name("[JOINT=]MU,ZETA")
      ->allow_extra_args(false);
  app.add_option("--damping", damping,
                 "Damping of the joint, N m s/rad or N s/m. Without JOINT: of all joints. Repeatable")
      ->type_name("[JOINT=]D")
      ->allow_extra_args(false);
  app.add_option("--armature", armature,
                 "Rotor inertia of the joint, kg m^2 or kg. Without JOINT: of all joints. Repeatable")
      ->type_name("[JOINT=]A")
      ->allow_extra_args(false);
  app.add_option("--site", sites, "A frame on a link, at X,Y,Z (m) in its axes; --record writes its place. Repeatable")
      ->type_name("NAME=LINK[,X,Y,Z]")
      ->allow_extra_args(false);
  app.add_option("--force-limit", force_limits,
                 "Lets the coupling whose first joint is JOINT slip beyond this force along that joint, N m or N. "
                 "JOINT#2 as for --softness. Repeatable")
      ->type_name("JOINT=F")
      ->allow_extra_args(false);
  app.add_option("--drive", drives,
                 "Gives the joint a servo with these gains, N m/rad and N m s/rad, or N/m and N s/m. Repeatable")
      ->type_name("JOINT=KP,KD")
      ->allow_extra_args(false);
  app.add_flag("--colliders", import.colliders,
               "Collision shapes become colliders of the group 'robot', meshes their hulls");
  app.add_option("--ground", ground, "The robot's colliders may touch the ground z = 0, with this friction of both")
      ->type_name("MU")
      ->check(number_from(0.0));
  app.add_option("--contact", contacts,
                 "These colliders may touch; a group such as 'robot' stands for all of its colliders. Repeatable")
      ->type_name("A,B")
      ->allow_extra_args(false);
  app.add_option("--kinematic", kinematic,
                 "Puts the joint on its target in each step, whatever force that takes. Repeatable")
      ->type_name("JOINT")
      ->allow_extra_args(false);
}

Import ModelOptions::read(const Ignored& ignore) const {
  ImportOptions options = import;
  options.ignore = ignore;
  options.colliders = import.colliders || ground || !contacts.empty();
  options.change = [this](Model& model) { apply(*this, model); };
  return import_file(file, options);
}

Import ModelOptions::load(const Ignored& ignore, const std::vector<std::string>& outputs) const {
  const auto fix = [&](const auto& error) { return Fixable(error, fixing_arguments(*this, ignore, error)); };
  Import read;
  try {
    read = this->read(ignore);
  } catch (const ModelError& error) {
    throw fix(error);
  } catch (const ImportError& error) {
    throw fix(error);
  }
  keep_apart(read.files, outputs);
  for (const std::string& line : read.warnings) to_stderr("warning: " + line);
  return read;
}

void StepOptions::add_to(CLI::App& app) {
  add_parsed(
      app, "--dt", settings.dt, [](const std::string& text) { return seconds_of(text, "--dt"); },
      "Step size in s, a number or a fraction")
      ->type_name("H")
      ->default_str("1/240");
  add_parsed(app, "--method", settings.method, method_of,
             "How couplings are solved: automatic, pgs, tgs, direct, reduced")
      ->type_name("M")
      ->default_str("automatic");
  add_parsed(app, "--integrator", settings.integrator, integrator_of,
             "How a step goes through time: automatic, euler, leapfrog; for scenes without bounds also extrapolated, "
             "runge_kutta")
      ->type_name("I")
      ->default_str("automatic");
  app.add_option("--guard", settings.guard, "Largest coarseness of a step; inf switches the guard off")
      ->type_name("E")
      ->capture_default_str()
      ->check(CLI::Validator([](const std::string& text) { return text == "inf" ? "" : number_from(0.0)(text); }, ""));
  app.add_option("--iterations", settings.iterations, "Sweeps of pgs, sub-steps of tgs")
      ->type_name("K")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000));
  app.add_option("--velocity-iterations", settings.velocity_iterations, "Sweeps after the position update")
      ->type_name("K")
      ->capture_default_str()
      ->check(CLI::Range(0, 1000));
  add_parsed(app, "--contact-settings", settings.contacts, contact_settings_of,
             "How contacts are solved: learning (faster), default, accurate (near the exact law)")
      ->type_name("NAME")
      ->default_str("default");
  add_ignore(app, settings.ignore);
}

void add_ignore(CLI::App& app, Ignored& ignore) {
  app.add_option_function<std::vector<std::string>>(
         "--ignore",
         [&ignore](const std::vector<std::string>& lists) {
           for (const std::string& list : lists) ignore_also(list, ignore);
         },
         "Leaves out bounds of the model: position_limits, velocity_limits, effort_limits, friction, separated by "
         "commas; of one joint with :JOINT behind, of followers with :followers. Repeatable")
      ->type_name("LIST")
      ->allow_extra_args(false);
}

Method method_of(const std::string& text) { return named(all_methods, text, "--method", "methods"); }

Integrator integrator_of(const std::string& text) {
  return named(all_integrators, text, "--integrator", "integrators");
}

Engine engine_of(const std::string& text) { return named(all_engines, text, "--engine", "engines"); }

ContactSettings contact_settings_of(const std::string& text) {
  return named(all_contact_settings, text, "--contact-settings", "contact settings").second;
}

void ignore_also(const std::string& list, Ignored& ignored) {
  const std::pair<const char*, JointSet*> kinds[] = {{"position_limits", &ignored.position_limits},
                                                     {"velocity_limits", &ignored.velocity_limits},
                                                     {"effort_limits", &ignored.effort_limits},
                                                     {"friction", &ignored.friction}};
  for (const std::string& part : split(list, ',')) {
    const std::size_t colon = part.find(':');
    const std::string kind = part.substr(0, colon);
    const auto found = std::find_if(std::begin(kinds), std::end(kinds), [&](const auto& k) { return k.first == kind; });
    const std::string joint = colon == std::string::npos ? "" : part.substr(colon + 1);
    if (found == std::end(kinds) || (colon != std::string::npos && joint.empty()))
      throw InputError(
          fmt::format("--ignore: there is no '{}'; give some of "
                      "position_limits,velocity_limits,effort_limits,friction, each alone or with :JOINT or "
                      ":followers behind",
                      part));
    if (colon == std::string::npos)
      found->second->all = true;
    else if (joint == "followers")
      found->second->followers = true;
    else
      found->second->names.push_back(joint);
  }
}

CLI::Validator number_from(double low, double high) {
  using Limits = std::numeric_limits<double>;
  const std::string wanted = low == Limits::lowest() ? "finite number"
                             : high == Limits::max() ? fmt::format("number of {:g} or more", low)
                                                     : fmt::format("number from {:g} to {:g}", low, high);
  return CLI::Validator(
      [low, high, wanted](const std::string& text) {
        const std::optional<double> number = to_number(text);
        return number && *number >= low && *number <= high ? "" : fmt::format("'{}' is no {}", text, wanted);
      },
      "");
}

double seconds_of(const std::string& text, const std::string& what) {
  const std::optional<double> seconds = to_fraction(text);
  if (!seconds || !(*seconds > 0.0) || !std::isfinite(*seconds))
    throw InputError(fmt::format("{}: '{}' is not a time in s, a number or fraction above 0", what, text));
  return *seconds;
}

}  // namespace lockstep::tool
