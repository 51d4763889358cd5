// SPDX-License-Identifier: Apache-2.0
#include "options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <set>
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

struct Named {
  std::string name;
  std::vector<double> numbers;
};

// From "NAME=X" or "NAME=X,Y". No number may be negative. The name may hold an equals sign.
Named named_numbers(const std::string& text, std::size_t count, const std::string& option) {
  const std::size_t equals = text.rfind('=');
  if (equals == std::string::npos || equals == 0)
    throw InputError(fmt::format("{}: '{}' should be JOINT=NUMBER{}", option, text, count == 2 ? ",NUMBER" : ""));
  const std::string what = option + " " + text.substr(0, equals);
  const std::vector<double> numbers = to_numbers(text.substr(equals + 1), count, what);
  for (const double number : numbers)
    if (number < 0.0) throw InputError(fmt::format("{}: '{}' is negative", what, text));
  return {text.substr(0, equals), numbers};
}

Coupling& coupling_of(Model& model, const std::string& name, const char* option) {
  const std::vector<std::string> names = coupling_names(model);
  for (std::size_t c = 0; c < names.size(); ++c)
    if (names[c] == name) return model.couplings[c];
  throw InputError(fmt::format("{}: no coupling has '{}' as its first joint; the couplings are: {}", option, name,
                               names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "))));
}

Joint& moving_joint(Model& model, const std::string& name, const char* option) {
  std::vector<std::string> moving;
  for (Joint& joint : model.joints) {
    if (joint.moves()) moving.push_back(joint.name);
    if (joint.name != name) continue;
    if (!joint.moves()) throw InputError(fmt::format("{}: joint '{}' is fixed; name a moving one", option, name));
    return joint;
  }
  throw InputError(fmt::format("{}: model '{}' has no joint '{}'; its moving joints are: {}", option, model.name, name,
                               moving.empty() ? "none" : fmt::format("{}", fmt::join(moving, ", "))));
}

// A number that is given twice: the user sees one of them.
void refuse_repeats(const std::vector<std::string>& texts, const char* option) {
  std::set<std::string> names;
  for (const std::string& text : texts) {
    const std::size_t equals = text.rfind('=');
    const std::string name = equals == std::string::npos ? "" : text.substr(0, equals);
    if (!names.insert(name).second)
      throw InputError(
          fmt::format("{}: is given twice for {}; keep one", option, name.empty() ? "all" : "'" + name + "'"));
  }
}

// Texts without a name are for all: set(nullptr, numbers). They come first, so that a name takes precedence.
template <class Set>
void set_all_then_named(const std::vector<std::string>& texts, std::size_t count, const char* option, const Set& set) {
  refuse_repeats(texts, option);
  for (const std::string& text : texts)
    if (text.find('=') == std::string::npos) set(nullptr, named_numbers("all=" + text, count, option).numbers);
  for (const std::string& text : texts) {
    if (text.find('=') == std::string::npos) continue;
    const Named named = named_numbers(text, count, option);
    set(&named.name, named.numbers);
  }
}

const Joint& joint_of(const Model& model, const std::string& name) {
  return model.joints[static_cast<std::size_t>(model.joint_index(name))];
}

void soften(const std::vector<std::string>& texts, Model& model) {
  set_all_then_named(texts, 2, "--softness", [&](const std::string* name, const std::vector<double>& numbers) {
    const Frequency softness{numbers[0], numbers[1]};
    if (name) coupling_of(model, *name, "--softness").softness = softness;
    for (Coupling& coupling : model.couplings)
      if (!name && joint_of(model, coupling.joint).kind != JointKind::tendon) coupling.softness = softness;
  });
}

void set_number(const std::vector<std::string>& texts, const char* option, double Joint::*number, Model& model) {
  set_all_then_named(texts, 1, option, [&](const std::string* name, const std::vector<double>& numbers) {
    if (name) moving_joint(model, *name, option).*number = numbers[0];
    for (Joint& joint : model.joints)
      if (!name && joint.moves() && joint.kind != JointKind::tendon) joint.*number = numbers[0];
  });
}

void add_site(const std::string& text, Model& model) {
  const std::size_t equals = text.find('=');
  const std::vector<std::string> parts = split(equals == std::string::npos ? "" : text.substr(equals + 1), ',');
  if (equals == 0 || parts[0].empty() || (parts.size() != 1 && parts.size() != 4))
    throw InputError(fmt::format("--site: '{}' should be NAME=LINK or NAME=LINK,X,Y,Z", text));
  Site site{text.substr(0, equals), parts[0], Pose::Identity()};
  if (parts.size() == 4) {
    const std::size_t numbers = text.find(',', equals) + 1;
    const std::vector<double> at = to_numbers(text.substr(numbers), 3, "--site " + site.name);
    site.pose.translation() = Eigen::Vector3d(at[0], at[1], at[2]);
  }
  model.sites.push_back(std::move(site));
}

void limit_force(const std::string& text, Model& model) {
  const Named limit = named_numbers(text, 1, "--force-limit");
  coupling_of(model, limit.name, "--force-limit").force_limit = limit.numbers[0];
}

void drive(const std::string& text, Model& model) {
  const Named gains = named_numbers(text, 2, "--drive");
  Drive& drive = moving_joint(model, gains.name, "--drive").drive;
  drive.kp = gains.numbers[0], drive.kd = gains.numbers[1];
}

void make_kinematic(const std::string& name, Model& model) {
  Drive& drive = moving_joint(model, name, "--kinematic").drive;
  if (drive.kp != 0.0 || drive.kd != 0.0)
    throw InputError(fmt::format("--kinematic: joint '{}' has a --drive too; give it one of them", name));
  drive.kinematic = true;
}

void add_ground(double friction, Model& model) {
  for (Collider& collider : model.colliders) collider.friction = friction;
  model.colliders.push_back({.name = "ground", .shape = Shape::half_space(), .friction = friction});
  model.contacts.push_back({"ground", "robot"});
}

void add_contact(const std::string& text, Model& model) {
  const std::vector<std::string> names = split(text, ',');
  if (names.size() != 2) throw InputError(fmt::format("--contact: '{}' should be COLLIDER,COLLIDER", text));
  model.contacts.push_back({names[0], names[1]});
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
      ->default_str("refuse");
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

void apply(const ModelOptions& options, Model& model) {
  if (options.floating)
    for (Root& root : model.roots) root.floating = *options.floating;
  if (options.gravity) model.gravity = *options.gravity;
  if (options.erp)
    for (Coupling& coupling : model.couplings)
      if (std::holds_alternative<Hard>(coupling.softness)) coupling.softness = Hard{*options.erp};
  soften(options.softness, model);
  set_number(options.damping, "--damping", &Joint::damping, model);
  set_number(options.armature, "--armature", &Joint::armature, model);
  for (const std::string& text : options.sites) add_site(text, model);
  for (const std::string& text : options.force_limits) limit_force(text, model);
  for (const std::string& text : options.drives) drive(text, model);
  refuse_repeats(options.force_limits, "--force-limit"), refuse_repeats(options.drives, "--drive");
  for (const std::string& name : options.kinematic) make_kinematic(name, model);
  if (options.ground) add_ground(*options.ground, model);
  for (const std::string& text : options.contacts) add_contact(text, model);
  if (options.leave_out_contacts) model.contacts.clear();
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
