// What holds for a whole file. SPDX-License-Identifier: Apache-2.0
#include "settings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

namespace lockstep::importer::mjcf {
namespace {

constexpr std::size_t most_groups = 31;

// All elements of one tag below these, as layers of one element.
std::optional<Element> merged(Document& document, const std::vector<const Element::Xml*>& owners,
                              std::string_view tag) {
  std::vector<const Element::Xml*> sections;
  for (const Element::Xml* owner : owners)
    for (const Element::Xml* child : document.children(*owner))
      if (child->Name() == tag) document.visit(*child), sections.push_back(child);
  if (sections.empty()) return std::nullopt;
  const Element::Xml& last = *sections.back();
  sections.pop_back();
  return Element(document, last, sections);
}

std::optional<Element> flags(Document& document) {
  std::vector<const Element::Xml*> options;
  for (const Element::Xml* section : document.children(document.root()))
    if (std::string_view(section->Name()) == "option") options.push_back(section);
  return merged(document, options, "flag");
}

void read_compiler(const Element& compiler, Settings& settings) {
  settings.angle_is_given = compiler.has("angle");
  settings.degrees = compiler.word("angle", {"radian", "degree"}, 1) == 1;
  settings.euler = compiler.name("eulerseq", "xyz");
  if (settings.euler.size() != 3 || settings.euler.find_first_not_of("xyzXYZ") != std::string::npos)
    compiler.fail("eulerseq is no sequence of three of x, y, z, X, Y, Z", "write one such as xyz or XYZ");
  if (compiler.word("coordinate", {"local", "global"}, 0) == 1)
    compiler.fail("uses global coordinates, which MuJoCo 2.3 gave up", "save the file with an older MuJoCo, as local");
  settings.autolimits = compiler.truth("autolimits", true);
  settings.inertia_from_geoms = static_cast<FromGeoms>(compiler.word("inertiafromgeom", {"false", "true", "auto"}, 2));
  double groups[] = {0.0, 5.0};
  compiler.numbers("inertiagrouprange", groups, 2, 2);
  settings.first_group = static_cast<int>(std::clamp(groups[0], -1e9, 1e9));
  settings.last_group = static_cast<int>(std::clamp(groups[1], -1e9, 1e9));
  settings.least_mass = compiler.number("boundmass", 0.0);
  settings.least_inertia = compiler.number("boundinertia", 0.0);
  settings.balances = compiler.truth("balanceinertia", false);
  settings.total_mass = compiler.number("settotalmass", -1.0);
  settings.strips_paths = compiler.truth("strippath", false);
  settings.fuses_static = compiler.truth("fusestatic", false);
  settings.fits_extents = compiler.truth("fitaabb", false);
  if (compiler.truth("exactmeshinertia", false)) settings.mesh_rule = MeshRule::exact;  // up to MuJoCo 3.2
  settings.aligns_free = compiler.truth("alignfree", false);
}

void read_flag(const Element& flag, Settings& settings) {
  const auto is_on = [&](const char* name, bool matters = true) {
    const bool on = flag.word(name, {"disable", "enable"}, 1) == 1;
    if (!on && matters) flag.report().warn("switched off by the file's flags, left out", name);
    return on;
  };
  const bool constraints = is_on("constraint"), passive = is_on("passive");
  settings.has_equalities = is_on("equality") && constraints;
  settings.has_limits = is_on("limit") && constraints;
  settings.has_friction = is_on("frictionloss") && constraints;
  settings.has_contacts = is_on("contact") && constraints;
  settings.has_springs = is_on("spring") && passive;
  settings.has_damping = is_on("damper") && passive;
  settings.has_actuation = is_on("actuation");
  settings.clamps_controls = is_on("clampctrl", false);
  settings.filters_parents = is_on("filterparent", false);
  if (!is_on("gravity")) settings.gravity.setZero();
  if (flag.word("override", {"disable", "enable"}, 0) == 1) settings.all_contacts.emplace();
}

void read_contact_numbers(const Element& option, ContactNumbers& all) {
  option.numbers("o_friction", all.friction, 1, 5);
  if (all.friction[0] != all.friction[1] || all.friction[3] != all.friction[4])
    option.report().warn("o_friction whose two tangential or two rolling frictions differ, taken as the first",
                         "option");
  all.yielding = yielding_of(option, "o_solref", "o_solimp");
  all.margin = std::max(0.0, option.number("o_margin", 0.0));
}

void read_option(const Element& option, Settings& settings) {
  settings.gravity = option.triple("gravity", settings.gravity);
  const auto lost = [&](const char* what, const Eigen::Vector3d& value) {
    if (!value.isZero(0.0)) option.report().warn("forces of a fluid, left out", what);
  };
  lost("density", {option.number("density", 0.0), 0.0, 0.0});
  lost("viscosity", {option.number("viscosity", 0.0), 0.0, 0.0});
  lost("wind", option.triple("wind", Eigen::Vector3d::Zero()));
  for (const double group : option.all_numbers("actuatorgroupdisable", most_groups)) {
    if (group != std::floor(group) || group < 0.0 || group > 30.0)
      option.fail(fmt::format("actuatorgroupdisable has {:g}, which is no group", group), "give numbers from 0 to 30");
    settings.disabled_groups |= std::uint32_t{1} << static_cast<int>(group);
  }
  if (!option.has("timestep")) return;
  settings.time_step = option.number("timestep");
  option.report().remark("step size of the file, kept as Model::time_step", fmt::format("{:g} s", settings.time_step));
}

// In each section assetdir stands for meshdir, too; the last section that has one of them counts.
void read_mesh_folder(Document& document, const Part& part, Settings& settings) {
  for (const Element::Xml* xml : document.children(*part.root)) {
    if (std::string_view(xml->Name()) != "compiler") continue;
    const Element compiler(document, *xml);
    for (const char* attribute : {"assetdir", "meshdir"})
      settings.mesh_folder = compiler.name(attribute, settings.mesh_folder);
  }
}

}  // namespace

Settings read_settings(Document& document) {
  Settings settings;
  const auto option = merged(document, {&document.root()}, "option");
  if (option) read_option(*option, settings);
  if (const auto flag = flags(document)) read_flag(*flag, settings);
  if (option && settings.all_contacts) read_contact_numbers(*option, *settings.all_contacts);
  std::vector<Settings> parts;
  for (const Part& part : document.parts()) {
    Settings& own = parts.emplace_back(settings);
    read_mesh_folder(document, part, own);
    if (const auto compiler = merged(document, {part.root}, "compiler")) read_compiler(*compiler, own);
    if (parts.size() > 1) own.mesh_folder = (part.folder / own.mesh_folder).string();
  }
  Settings main = std::move(parts.front());
  parts.erase(parts.begin());
  main.attached = std::move(parts);
  return main;
}

SolverSettings read_solver(Document& document, const Settings& settings) {
  SolverSettings solver;
  if (settings.time_step > 0.0) solver.time_step = settings.time_step;
  if (const auto option = merged(document, {&document.root()}, "option")) {
    solver.is_elliptic = option->word("cone", {"pyramidal", "elliptic"}, 0) == 1;
    solver.friction_ratio = std::max(option->number("impratio", 1.0), 1e-15);
  }
  if (const auto flag = flags(document)) solver.is_safe = flag->word("refsafe", {"disable", "enable"}, 1) == 1;
  return solver;
}

}  // namespace lockstep::importer::mjcf
