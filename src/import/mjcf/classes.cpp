// Defaults, class by class. SPDX-License-Identifier: Apache-2.0
#include "classes.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <string_view>

#include "import/text.h"
#include "known.h"
#include "references.h"

namespace lockstep::importer::mjcf {
namespace {

// What a Model takes from defaults.
constexpr std::string_view used[] = {"joint",  "geom",     "site",     "equality",    "tendon", "general",
                                     "motor",  "position", "velocity", "intvelocity", "damper", "cylinder",
                                     "muscle", "adhesion", "pair",     "mesh"};

// What an element is called, and which others it is about, no class says.
void refuse_names(const Element& element) {
  for (auto* attribute = element.xml().FirstAttribute(); attribute; attribute = attribute->Next()) {
    const std::string_view name = attribute->Name(), kind = referent(name);
    if (is_for_names(name) || !(kind.empty() || kind == "material" || kind == "mesh" || kind == "hfield"))
      element.fail(fmt::format("has a {}, which a default cannot give", name), "give it to the elements of the class");
  }
}

}  // namespace

Classes::Classes(Document& document) : document_(document) {
  for (const Part& part : document.parts()) {
    Named& classes = classes_.emplace_back();
    Class& outermost = classes["main"];
    for (const Element::Xml* xml : document.children(*part.root)) {
      if (std::string_view(xml->Name()) != "default") continue;
      const Element section(document, *xml);
      if (section.name("class", "main") != "main")
        section.fail("has a class other than 'main' at the top", "leave the class of the outermost default out");
      read(section, outermost, classes);
    }
  }
}

void Classes::read(const Element& section, Class& own, Named& classes) {
  const std::vector<const Element::Xml*> children = section.children();
  std::set<std::string_view> tags;
  for (const Element::Xml* xml : children) {
    if (std::find(std::begin(used), std::end(used), xml->Name()) == std::end(used)) continue;
    const Element element(document_, *xml);
    if (!tags.insert(xml->Name()).second)
      element.fail("stands in this <default> once more", "put all its attributes into one element");
    refuse_names(element);
    own.elements.push_back(xml);
  }
  for (const Element::Xml* xml : children) {
    if (std::string_view(xml->Name()) != "default") continue;
    const Element nested(document_, *xml);
    const std::string name = nested.name("class");
    const auto [place, is_new] = classes.try_emplace(name, Class{&own, own.elements.size(), {}});
    if (!is_new) nested.fail(fmt::format("defines class '{}' once more", shortened(name)), "define each class once");
    read(nested, place->second, classes);
  }
}

const Classes::Class& Classes::find(const Element& element, const char* attribute, const std::string& name) const {
  const Named& classes = classes_[document_.part_of(element.xml())];
  if (const auto found = classes.find(name); found != classes.end()) return found->second;
  std::vector<std::string> names;
  for (const auto& known : classes) names.push_back(known.first);
  const std::string meant = nearest(name, names);
  element.fail(fmt::format("has {} '{}', which no <default> defines", attribute, shortened(name)),
               meant.empty() ? "correct the name" : fmt::format("correct the name: '{}' is defined", shortened(meant)));
}

std::vector<const Element::Xml*> Classes::defaults(const Element::Xml& xml, const std::string& childclass,
                                                   const std::vector<std::string_view>& tags) const {
  const Element element(document_, xml);
  const std::string name = element.name("class", childclass.empty() ? "main" : childclass);
  std::vector<const Element::Xml*> layers;  // the innermost first
  const Class* own = &find(element, "class", name);
  for (std::size_t count = own->elements.size(); own; count = own->taken, own = own->parent)
    for (std::size_t i = count; i-- > 0;)
      if (std::find(tags.begin(), tags.end(), own->elements[i]->Name()) != tags.end())
        layers.push_back(own->elements[i]);
  std::reverse(layers.begin(), layers.end());
  return layers;
}

Element Classes::element(const Element::Xml& xml, const std::string& childclass, const char* tag) const {
  return Element(document_, xml, defaults(xml, childclass, {tag ? tag : xml.Name()}));
}

std::string Classes::childclass(const Element& element, const std::string& around) const {
  const std::string name = element.name("childclass", around);
  if (!name.empty()) find(element, "childclass", name);
  return name;
}

}  // namespace lockstep::importer::mjcf
