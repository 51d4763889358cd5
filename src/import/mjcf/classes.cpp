// Defaults, class by class. SPDX-License-Identifier: Apache-2.0
#include "classes.h"

#include <fmt/format.h>

#include <algorithm>

#include "import/text.h"

namespace lockstep::importer::mjcf {
namespace {

// What a Model takes from defaults.
constexpr std::string_view used[] = {"joint",    "geom",        "site",   "equality", "tendon", "general", "motor",   "position",
                                     "velocity", "intvelocity", "damper", "cylinder", "muscle", "adhesion", "pair"};

}  // namespace

Classes::Classes(Document& document) : document_(document) {
  classes_["main"];
  for (const Element::Xml* xml : document.children(document.root())) {
    if (std::string_view(xml->Name()) != "default") continue;
    Element section(document, *xml);
    if (section.name("class", "main") != "main")
      section.fail("has a class other than 'main' at the top", "leave the class of the outermost default out");
    read(section, "main");
  }
}

void Classes::read(const Element& section, const std::string& name) {
  for (const Element::Xml* xml : section.children()) {
    const std::string_view tag = xml->Name();
    if (tag == "default") {
      Element nested(document_, *xml);
      const std::string own = nested.name("class");
      if (!classes_.try_emplace(own, Class{name, {}}).second)
        nested.fail(fmt::format("defines class '{}' once more", shortened(own)), "define each class once");
      read(nested, own);
    } else if (std::find(std::begin(used), std::end(used), tag) != std::end(used)) {
      document_.visit(*xml);
      classes_[name].elements.push_back(xml);
    }
  }
}

std::vector<const Element::Xml*> Classes::defaults(const Element::Xml& xml, const std::string& childclass,
                                                   const std::vector<std::string_view>& tags) const {
  const Element element(document_, xml);
  std::string name = element.name("class", childclass.empty() ? "main" : childclass);
  if (!classes_.contains(name))
    element.fail(fmt::format("has class '{}', which no <default> defines", shortened(name)), "correct the name");
  std::vector<const Class*> chain;
  for (; !name.empty(); name = classes_.at(name).parent) chain.push_back(&classes_.at(name));
  std::vector<const Element::Xml*> found;
  for (auto own = chain.rbegin(); own != chain.rend(); ++own)
    for (const Element::Xml* candidate : (*own)->elements)
      if (std::find(tags.begin(), tags.end(), candidate->Name()) != tags.end()) found.push_back(candidate);
  return found;
}

Element Classes::element(const Element::Xml& xml, const std::string& childclass, const char* tag) const {
  return Element(document_, xml, defaults(xml, childclass, {tag ? tag : xml.Name()}));
}

std::string Classes::childclass(const Element& element, const std::string& around) const {
  const std::string name = element.name("childclass", around);
  if (!name.empty() && !classes_.contains(name))
    element.fail(fmt::format("has childclass '{}', which no <default> defines", shortened(name)), "correct the name");
  return name;
}

}  // namespace lockstep::importer::mjcf
