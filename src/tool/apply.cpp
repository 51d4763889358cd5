// What options of a command change in a model. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <set>
#include <utility>
#include <vector>

#include "options.h"
#include "text.h"
#include "tool.h"

namespace lockstep::tool {
namespace {

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
    throw InputError(
        fmt::format("--kinematic: joint '{}' has a --drive or a servo of its file, too; set --drive {}=0,0 to take it "
                    "away, or leave out --kinematic",
                    name, name));
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

}  // namespace

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
  refuse_repeats(options.force_limits, "--force-limit"), refuse_repeats(options.drives, "--drive");
  for (const std::string& text : options.force_limits) limit_force(text, model);
  for (const std::string& text : options.drives) drive(text, model);
  for (const std::string& name : options.kinematic) make_kinematic(name, model);
  if (options.ground) add_ground(*options.ground, model);
  for (const std::string& text : options.contacts) add_contact(text, model);
  if (options.leave_out_contacts) model.contacts.clear();
}

}  // namespace lockstep::tool
