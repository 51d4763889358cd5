// Names that elements have, and names that they refer to. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <string_view>

#include "assets.h"
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
    judge_unused();
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

  // Elements that a Model has no use for. A misspelt name among them is a mistake in the file all the same.
  void judge_unused() {
    know("actuator", scene_.document.inside("actuator"));
    std::vector<const Element::Xml*> cameras, lights, replicates, world = scene_.document.inside("worldbody");
    for (const Element::Xml* xml : world)
      find("camera", *xml, cameras), find("light", *xml, lights), find("replicate", *xml, replicates);
    if (replicates.empty()) know("camera", cameras);  // which make further names
    for (const Element::Xml* xml : scene_.document.inside("asset"))
      scene_.known[xml->Name()].insert(name_of_asset(*xml));
    for (const char* kind : {"mesh", "hfield", "texture", "material"}) scene_.known[kind];
    const Known assets = with({"mesh", "hfield", "texture", "material"});
    judge("worldbody", world, assets);
    for (const char* tag : {"asset", "deformable"}) judge(tag, scene_.document.inside(tag), assets);
    for (const auto& aimed : {cameras, lights}) judge("worldbody", aimed, with({"body"}));
    if (!scene_.options.colliders) judge("contact", scene_.document.inside("contact"), scene_.known);
    for (const char* tag : {"sensor", "custom"}) judge(tag, scene_.document.inside(tag), scene_.known);
    for (const char* tag : {"sensor", "keyframe", "custom", "asset"}) check_names(tag, scene_.document.inside(tag));
    check_names("camera", cameras), check_names("light", lights);
  }

  void know(const char* kind, const std::vector<const Element::Xml*>& elements) {
    auto& names = scene_.known[kind];
    for (const Element::Xml* xml : elements)
      if (const char* name = xml->Attribute("name")) names.insert(name);
  }

  // Adds the elements of this tag at or below `xml`.
  void find(std::string_view tag, const Element::Xml& xml, std::vector<const Element::Xml*>& found) const {
    if (tag == xml.Name()) found.push_back(&xml);
    for (const Element::Xml* child : scene_.document.children(xml)) find(tag, *child, found);
  }

  Known with(std::initializer_list<const char*> kinds) {
    Known some;
    for (const char* kind : kinds) some[kind] = scene_.known[kind];
    return some;
  }

  void judge(std::string_view section, const std::vector<const Element::Xml*>& elements, const Known& known) {
    for (const Element::Xml* xml : elements) scene_.report().attempt([&] { is_resolved(*xml, section, known); });
  }

  // The elements of a section that name nothing which is not there.
  void take(const char* tag) {
    auto& taken = scene_.sections[tag];
    for (const Element::Xml* xml : scene_.document.section(tag))
      scene_.report().attempt([&] {
        if (is_resolved(*xml, tag, scene_.known)) taken.push_back(xml);
      });
    check_names(tag, taken);
  }

  bool is_resolved(const Element::Xml& xml, std::string_view section, const Known& known) const {
    const auto found = dangling(scene_.document, xml, known);
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

  // In some sections each kind of element has names of its own.
  void check_names(std::string_view section, const std::vector<const Element::Xml*>& elements) const {
    const bool by_tag = section == "contact" || section == "asset" || section == "custom";
    std::map<std::string, Names> names;
    for (const Element::Xml* xml : elements) {
      const std::string name = section == "asset"       ? name_of_asset(*xml)
                               : xml->Attribute("name") ? xml->Attribute("name")
                                                        : "";
      if (name.empty() || names[by_tag ? xml->Name() : ""].take(name)) continue;
      Element element(scene_.document, *xml);
      element.rename(title_of(*xml, section));
      element.fail("has a name that is taken",
                   fmt::format("give each {} its own name", by_tag ? xml->Name() : section));
    }
  }

  Scene& scene_;
};

}  // namespace

void resolve(Scene& scene) { Resolver(scene).resolve(); }

}  // namespace lockstep::importer::mjcf
