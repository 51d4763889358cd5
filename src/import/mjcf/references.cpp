// SPDX-License-Identifier: Apache-2.0
#include "references.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

namespace lockstep::importer::mjcf {
namespace {

struct Reference {
  std::string_view attribute, kind;
};

constexpr Reference references[] = {
    {"actuator", "actuator"}, {"body", "body"},       {"body1", "body"},          {"body2", "body"},
    {"camera", "camera"},     {"cranksite", "site"},  {"flex", "flex"},           {"geom", "geom"},
    {"geom1", "geom"},        {"geom2", "geom"},      {"hfield", "hfield"},       {"joint", "joint"},
    {"joint1", "joint"},      {"joint2", "joint"},    {"jointinparent", "joint"}, {"material", "material"},
    {"mesh", "mesh"},         {"objname", "object"},  {"refname", "object"},      {"refsite", "site"},
    {"sidesite", "site"},     {"site", "site"},       {"site1", "site"},          {"site2", "site"},
    {"slidersite", "site"},   {"target", "body"},     {"tendon", "tendon"},       {"tendon1", "tendon"},
    {"tendon2", "tendon"},    {"texture", "texture"},
};
static_assert(std::is_sorted(std::begin(references), std::end(references),
                             [](const Reference& a, const Reference& b) { return a.attribute < b.attribute; }));

}  // namespace

std::string_view referent(std::string_view attribute) {
  const auto found = std::lower_bound(std::begin(references), std::end(references), attribute,
                                      [](const Reference& a, std::string_view b) { return a.attribute < b; });
  return found != std::end(references) && found->attribute == attribute ? found->kind : "";
}

namespace {

// As referent(); of what another attribute says the kind of.
std::string_view kind_of(const Element::Xml& xml, std::string_view attribute) {
  const std::string_view kind = referent(attribute);
  if (kind != "object") return kind;
  const char* const type = xml.Attribute(attribute == "objname" ? "objtype" : "reftype");
  return !type ? std::string_view() : type == std::string_view("xbody") ? "body" : type;
}

}  // namespace

std::optional<Dangling> dangling(const Document& document, const Element::Xml& xml, const Known& known) {
  for (auto* attribute = xml.FirstAttribute(); attribute; attribute = attribute->Next()) {
    const auto kind = known.find(kind_of(xml, attribute->Name()));
    if (kind != known.end() && *attribute->Value() && !kind->second.contains(attribute->Value()))
      return Dangling{&xml, kind->first, attribute->Value()};
  }
  for (const Element::Xml* child : document.children(xml))
    if (auto found = dangling(document, *child, known)) return found;
  return std::nullopt;
}

void fail_to_find(const Element& element, std::string_view kind, const std::string& name,
                  const std::vector<std::string>& there) {
  const std::string meant = nearest(name, there);
  element.fail(
      fmt::format("names {} '{}', which does not exist", kind == "hfield" ? "height field" : kind, shortened(name)),
      meant.empty() ? "correct the name, or read the file that includes this one" : "correct the name" + exists(meant));
}

}  // namespace lockstep::importer::mjcf
