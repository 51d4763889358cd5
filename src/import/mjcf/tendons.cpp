// <tendon>. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "scene.h"

namespace lockstep::importer::mjcf {
namespace {

void read_fixed(const Element& element, Tendon& tendon, const Scene& scene) {
  for (const Element::Xml* xml : element.children()) {
    if (std::string_view(xml->Name()) != "joint") continue;
    const Element term(scene.document, *xml);
    const int joint = scene.scalar_joint(term.name("joint"), term);
    const double coefficient = term.number("coef");
    const auto& terms = tendon.length.terms;
    if (std::any_of(terms.begin(), terms.end(), [&](const auto& other) { return other.first == joint; }))
      scene.report().warn("joints that a tendon names twice, summed; the last alone gives forces in MuJoCo",
                          fmt::format("{} of {}", scene.joint(joint).name, element.title()));
    joint < 0 ? void(tendon.is_whole = false) : tendon.length.add(joint, coefficient);
  }
  if (tendon.length.terms.empty() && tendon.is_whole)
    element.fail("has no joints", "add <joint joint=\"...\" coef=\"...\"/>");
}

// From site to site. A pulley begins a branch of its own, of which a share counts.
void read_spatial(const Element& element, Tendon& tendon, const Scene& scene) {
  std::string last;
  double share = 1.0;
  int sites = 0;  // of a branch
  const auto end_branch = [&](bool is_first_pulley) {
    if (sites < 2 && !is_first_pulley)
      element.fail("joins no two sites, or has a branch beside a pulley that joins none",
                   "add <site site=\"...\"/> for both ends of each branch");
    sites = 0;
  };
  const std::vector<const Element::Xml*> path = element.children();
  for (const Element::Xml* xml : path) {
    const std::string_view tag = xml->Name();
    const Element part(scene.document, *xml);
    if (tag == "site") {
      const std::string site = part.name("site");
      if (!last.empty()) tendon.strands.push_back({last, site, share});
      last = site, ++sites;
    } else if (tag == "geom") {
      tendon.wrapped = fmt::format("geom '{}'", part.name("geom"));
      part.name("sidesite", "");
    } else if (tag == "pulley") {
      const double divisor = part.number("divisor");
      if (!(divisor > 0.0)) part.fail("divisor is not above 0", "give the number of strands, such as 2");
      end_branch(xml == path.front());
      last.clear(), share = 1.0 / divisor;
    }
  }
  end_branch(false);
}

void read_tendon(const Element::Xml& xml, Scene& scene) {
  Element element(scene.classes.element(xml, "", "tendon"));
  const Settings& settings = scene.settings.of(element);
  Tendon tendon;
  tendon.name = element.name("name", "");
  if (!tendon.name.empty()) element.rename("tendon '" + tendon.name + "'");
  tendon.place = element.place();
  tendon.is_spatial = element.tag() == "spatial";
  tendon.is_spatial ? read_spatial(element, tendon, scene) : read_fixed(element, tendon, scene);
  if (settings.has_limits) tendon.range = limited_range(element, "range", "limited", settings.autolimits);
  if (tendon.range)
    element.report().tally("position limits made hard, soft in MuJoCo",
                           words_of(yielding_of(element, "solreflimit", "solimplimit")));
  const auto linear = [&](const char* attribute) {
    double terms[] = {0.0, 0.0, 0.0};
    element.numbers(attribute, terms, 1, 3);
    if (terms[1] != 0.0 || terms[2] != 0.0)
      element.fail(std::string(attribute) + " has terms of higher order, which lockstep lacks",
                   "keep the first number alone");
    if (terms[0] < 0.0) element.fail(std::string("has a negative ") + attribute, "give 0 or more");
    return terms[0];
  };
  if (settings.has_springs) tendon.stiffness = linear("stiffness");
  if (settings.has_damping) tendon.damping = linear("damping");
  double lengths[] = {-1.0, -1.0};
  const int given = element.numbers("springlength", lengths, 1, 2);
  tendon.shortest = lengths[0];
  tendon.longest = given == 2 ? lengths[1] : lengths[0];
  if (tendon.longest < tendon.shortest)
    element.fail("springlength ends before it begins", "give the shorter length first");
  if (settings.has_friction) tendon.friction = element.number("frictionloss", 0.0);
  tendon.armature = element.number("armature", 0.0);
  if (const auto range = limited_range(element, "actuatorfrcrange", "actuatorfrclimited", settings.autolimits))
    tendon.effort_limit = symmetric(*range, "actuatorfrcrange of " + element.title(), element.report());
  if (!tendon.name.empty()) scene.tendon_of.emplace(tendon.name, static_cast<int>(scene.tendons.size()));
  scene.tendons.push_back(std::move(tendon));
}

}  // namespace

void read_tendons(Scene& scene) {
  for (const Element::Xml* xml : scene.section("tendon")) {
    const std::string_view tag = xml->Name();
    if (tag == "fixed" || tag == "spatial") scene.report().attempt([&] { read_tendon(*xml, scene); });
  }
}

}  // namespace lockstep::importer::mjcf
