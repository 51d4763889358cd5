// Elements, and what was not read of them. SPDX-License-Identifier: Apache-2.0
#include "element.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "lockstep/error.h"

namespace lockstep::importer::urdf {
namespace {

// Names that URDF and its tools write and a step does not use. Every other name is unknown.
constexpr std::array known = {
    "visual",
    "collision",
    "material",
    "gazebo",
    "transmission",
    "sensor",
    "mujoco",
    "ros_control",
    "ros2_control",
    "calibration",
    "safety_controller",
    "plugin",
    "self_collision_checking",
    "contact",
    "verbose",
    "version",
    "axis",
    "limit",
    "dynamics",
    "mimic",
    "lower",
    "upper",  // of joints that do not use them
};

bool contains(const std::vector<std::string_view>& names, std::string_view name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

bool speaks_of_mimic(std::string_view name) {
  std::string small(name);
  std::transform(small.begin(), small.end(), small.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  return small.find("mimic") != std::string::npos;
}

bool is_known(std::string_view name) {
  return name.starts_with("xmlns") || name.starts_with("drake:") ||
         std::find(known.begin(), known.end(), name) != known.end();
}

}  // namespace

std::string Element::line() const { return fmt::format("{}:{}", file_->name, xml_->GetLineNum()); }
std::string Element::place() const { return fmt::format("{}: {}", line(), title_); }

void Element::fail(const std::string& rule, const std::string& remedy) const {
  throw ImportError(place(), rule, remedy);
}

void Element::refuse_later(const std::string& rule, const std::string& remedy) const {
  report().refuse(ImportError(place(), rule, remedy));
}

std::string_view Element::required(const char* attribute) {
  asked_attributes_.push_back(attribute);
  const char* text = xml_->Attribute(attribute);
  if (!text) fail(fmt::format("has no attribute '{}'", attribute), fmt::format("write {}=\"...\"", attribute));
  return text;
}

std::string Element::name(const char* attribute) {
  const std::string_view text = required(attribute);
  refuse_unexpanded(attribute, text, failing());
  return name_in(attribute, text, failing());
}

void Element::numbers(const char* attribute, std::string_view text, double* values, int count) const {
  numbers_in(attribute, text, values, count, count, failing());
}

double Element::number(const char* attribute) {
  double value = 0.0;
  numbers(attribute, required(attribute), &value, 1);
  return value;
}

double Element::number(const char* attribute, double fallback) {
  asked_attributes_.push_back(attribute);
  return has(attribute) ? number(attribute) : fallback;
}

std::optional<double> Element::number_if_any(const char* attribute, double fallback) {
  asked_attributes_.push_back(attribute);
  if (!has(attribute)) return fallback;
  return number_in(required(attribute));
}

Eigen::Vector3d Element::triple(const char* attribute) {
  Eigen::Vector3d value;
  numbers(attribute, required(attribute), value.data(), 3);
  return value;
}

Eigen::Vector3d Element::triple(const char* attribute, const Eigen::Vector3d& fallback) {
  asked_attributes_.push_back(attribute);
  return has(attribute) ? triple(attribute) : fallback;
}

std::optional<Element> Element::child(const char* name) {
  asked_children_.push_back(name);
  const tinyxml2::XMLElement* xml = xml_->FirstChildElement(name);
  if (!xml) return std::nullopt;
  Element found(*xml, *file_, std::string(name) + " of " + title_);
  for (auto* other = xml->NextSiblingElement(name); other; other = other->NextSiblingElement(name))
    report().warn("elements that are there already, not used: the first counts",
                  Element(*other, *file_, found.title_).place());
  return found;
}

std::optional<Element> Element::one_child(const char* name) {
  const tinyxml2::XMLElement* xml = xml_->FirstChildElement(name);
  if (const auto* second = xml ? xml->NextSiblingElement(name) : nullptr)
    Element(*second, *file_, std::string(name) + " of " + title_)
        .fail(fmt::format("is there already, in line {}", xml->GetLineNum()), "keep one of them");
  return child(name);
}

Element Element::only_child(const char* name) {
  std::optional<Element> found = one_child(name);
  if (!found) fail(fmt::format("has no <{}>", name), fmt::format("add <{} .../>", name));
  return *found;
}

std::string Element::text() const {
  const char* text = xml_->GetText();
  return text ? std::string(trimmed(text)) : std::string();
}

// Names that speak of a mimic where URDF has none are meant to couple joints.
void Element::refuse_mimic(std::string_view name, const std::string& owner) const {
  if (owner.empty() && speaks_of_mimic(name))
    fail(fmt::format("holds '{}', which URDF does not have here, so no joint would follow", shortened(name)),
         "write <mimic joint=\"...\" multiplier=\"...\" offset=\"...\"/> in the <joint> that follows");
}

void Element::tally_attribute(std::string_view name, const std::string& owner) {
  if (contains(asked_attributes_, name)) return;
  refuse_mimic(name, owner);
  if (contains(asked_children_, name))
    return report().warn("attributes where URDF has elements, not used", fmt::format("{} of {}", name, title_));
  const std::string what = fmt::format("'{}' of {}{}", shortened(name), xml_->Name(), owner);
  is_known(name) ? report().not_used(what) : report().unknown(what);
}

void Element::tally_child(std::string_view tag, const std::string& owner) {
  if (contains(asked_children_, tag)) return;
  refuse_mimic(tag, owner);
  if (contains(asked_attributes_, tag))
    return report().warn("elements where URDF has attributes, not used", fmt::format("{} of {}", tag, title_));
  is_known(tag) ? report().not_used(shortened(tag) + owner) : report().unknown(shortened(tag) + owner);
}

void Element::refuse_xacro() const {
  for (auto* xml = xml_->FirstChildElement(); xml; xml = xml->NextSiblingElement())
    if (std::string_view(xml->Name()).starts_with("xacro:"))
      Element(*xml, *file_, fmt::format("<{}>", shortened(xml->Name())))
          .fail("is xacro, which lockstep does not read", "expand it first: xacro robot.urdf.xacro > robot.urdf");
}

void Element::tally_rest(const std::string& owner) {
  refuse_xacro();
  for (auto* attribute = xml_->FirstAttribute(); attribute; attribute = attribute->Next())
    tally_attribute(attribute->Name(), owner);
  for (auto* node = xml_->FirstChild(); node; node = node->NextSibling()) {
    if (node->ToComment()) continue;
    const tinyxml2::XMLElement* xml = node->ToElement();
    if (!xml) {
      report().unknown(fmt::format("text '{}' in {}{}", shortened(trimmed(node->Value())), xml_->Name(), owner));
      continue;
    }
    tally_child(xml->Name(), owner);
  }
}

void Element::refuse_rest(const std::string& remedy) const {
  for (auto* attribute = xml_->FirstAttribute(); attribute; attribute = attribute->Next())
    if (!contains(asked_attributes_, attribute->Name()))
      fail(fmt::format("has an attribute '{}', which is not read", shortened(attribute->Name())), remedy);
  for (auto* node = xml_->FirstChild(); node; node = node->NextSibling())
    if (!node->ToComment())
      fail(fmt::format("holds {}, which is not read",
                       node->ToElement() ? fmt::format("<{}>", shortened(node->Value()))
                                         : fmt::format("the text '{}'", shortened(trimmed(node->Value())))),
           remedy);
}

}  // namespace lockstep::importer::urdf
