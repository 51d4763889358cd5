// Names that elements have, and names that they refer to. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <string_view>

#include "names.h"
#include "scene.h"

namespace lockstep::importer::mjcf {
namespace {

class Resolver {
 public:
  explicit Resolver(Scene& scene) : scene_(scene) {}

  void resolve() {
    know_bodies();
    take("tendon");
    auto& tendons = scene_.known["tendon"];
    for (const Element::Xml* xml : scene_.sections["tendon"])
      if (const char* name = xml->Attribute("name")) tendons.insert(name);
    take("equality");
    take("actuator");
    if (scene_.options.colliders) take("contact");
    for (const char* tag : {"sensor", "keyframe"}) check_names(tag, scene_.document.inside(tag));
  }

 private:
  void know_bodies() {
    Known& known = scene_.known;
    auto &bodies = known["body"], &joints = known["joint"], &geoms = known["geom"], &sites = known["site"];
    for (const Body& body : scene_.bodies.all) {
      bodies.insert(body.name);
      for (const JointPart& part : body.joints) joints.insert(part.ball.empty() ? part.name : part.ball);
      for (const GeomPart& part : body.geoms) geoms.insert(part.name);
      for (const SitePart& part : body.sites) sites.insert(part.name);
    }
  }

  // The elements of a section that name nothing which is not there.
  void take(const char* tag) {
    auto& taken = scene_.sections[tag];
    for (const Element::Xml* xml : scene_.document.section(tag))
      scene_.report().attempt([&] {
        if (is_resolved(*xml, tag)) taken.push_back(xml);
      });
    check_names(tag, taken);
  }

  bool is_resolved(const Element::Xml& xml, std::string_view section) const {
    const auto found = dangling(scene_.document, xml, scene_.known);
    if (!found) return true;
    if (scene_.document.parts()[scene_.document.part_of(xml)].body) {
      scene_.report().remark("elements of attached models that name what is not attached, left out",
                             scene_.document.line(xml) + ": " + title_of(xml, section));
      return false;
    }
    Element element(scene_.document, *found->xml);
    if (found->xml == &xml) element.rename(title_of(xml, section));
    scene_.fail_to_find(element, found->kind, found->name);
  }

  static std::string title_of(const Element::Xml& xml, std::string_view section) {
    const std::string tag = shortened(xml.Name());
    const char* name = xml.Attribute("name");
    const bool is_general = section == "tendon" || section == "actuator";
    if (name) return fmt::format("{} '{}'", is_general ? section : tag, shortened(name));
    return section == "equality" ? fmt::format("equality <{}>", tag) : fmt::format("<{}>", tag);
  }

  // Pairs and excludes have names of their own.
  void check_names(std::string_view section, const std::vector<const Element::Xml*>& elements) const {
    std::map<std::string, Names> names;
    for (const Element::Xml* xml : elements) {
      const char* name = xml->Attribute("name");
      if (!name || !*name || names[section == "contact" ? xml->Name() : ""].take(name)) continue;
      Element element(scene_.document, *xml);
      element.rename(title_of(*xml, section));
      element.fail("has a name that is taken", fmt::format("give each {} its own name", section));
    }
  }

  Scene& scene_;
};

}  // namespace

void resolve(Scene& scene) { Resolver(scene).resolve(); }

}  // namespace lockstep::importer::mjcf
