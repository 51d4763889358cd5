// Strict, locale-independent reading of attributes. SPDX-License-Identifier: Apache-2.0
#include "element.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "lockstep/error.h"

namespace lockstep::urdf {
namespace {

constexpr std::string_view blanks = " \t\r\n";

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

bool is_known(std::string_view name) {
  return name.starts_with("xmlns") || name.starts_with("drake:") ||
         std::find(known.begin(), known.end(), name) != known.end();
}

}  // namespace

std::string shortened(std::string_view text) {
  std::string result(text.substr(0, 40));
  for (char& c : result)
    if (static_cast<unsigned char>(c) < ' ') c = ' ';
  return text.size() > 40 ? result + "..." : result;
}

std::string Element::place() const { return fmt::format("{}:{}: {}", file_->name, xml_->GetLineNum(), title_); }

void Element::fail(const std::string& rule, const std::string& remedy) const {
  throw ImportError(place(), rule, remedy);
}

std::string_view Element::required(const char* attribute) {
  asked_.push_back(attribute);
  const char* text = xml_->Attribute(attribute);
  if (!text) fail(fmt::format("has no attribute '{}'", attribute), fmt::format("write {}=\"...\"", attribute));
  return text;
}

std::string Element::name(const char* attribute) {
  const std::string_view text = required(attribute);
  const auto odd = [](char c) { return c == '&' || static_cast<unsigned char>(c) < ' '; };
  if (text.find_first_not_of(blanks) == std::string_view::npos)
    fail(fmt::format("{}=\"\" is empty", attribute), "give a name");
  if (std::any_of(text.begin(), text.end(), odd))
    fail(fmt::format("{}=\"{}\" holds an entity or a control character", attribute, shortened(text)),
         "use plain characters in names");
  return std::string(text);
}

void Element::numbers(const char* attribute, std::string_view text, double* values, int count) const {
  const std::string shown = fmt::format("{}=\"{}\"", attribute, shortened(text));
  const char* const remedy = text.find("${") == std::string_view::npos
                                 ? "write plain decimal numbers such as 0.5 or 1e-3, blanks between them"
                                 : "expand it first: xacro robot.urdf.xacro > robot.urdf";
  int found = 0;
  std::size_t at = text.find_first_not_of(blanks);
  while (at != std::string_view::npos) {
    const std::size_t stop = std::min(text.find_first_of(blanks, at), text.size());
    std::string_view word = text.substr(at, stop - at);
    if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);  // from_chars knows no plus
    double value = 0.0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error == std::errc::result_out_of_range)
      fail(fmt::format("{}: '{}' is beyond the range of numbers", shown, shortened(word)), remedy);
    if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(value))
      fail(fmt::format("{}: '{}' is not a finite number", shown, shortened(word)), remedy);
    if (found < count) values[found] = value;
    ++found;
    at = text.find_first_not_of(blanks, stop);
  }
  if (found != count) fail(fmt::format("{} has {}, not {}", shown, counted(found, "number"), count), remedy);
}

double Element::number(const char* attribute) {
  double value = 0.0;
  numbers(attribute, required(attribute), &value, 1);
  return value;
}

double Element::number(const char* attribute, double fallback) {
  asked_.push_back(attribute);
  return has(attribute) ? number(attribute) : fallback;
}

Eigen::Vector3d Element::triple(const char* attribute) {
  Eigen::Vector3d value;
  numbers(attribute, required(attribute), value.data(), 3);
  return value;
}

Eigen::Vector3d Element::triple(const char* attribute, const Eigen::Vector3d& fallback) {
  asked_.push_back(attribute);
  return has(attribute) ? triple(attribute) : fallback;
}

std::optional<Element> Element::child(const char* name) {
  asked_.push_back(name);
  const tinyxml2::XMLElement* xml = xml_->FirstChildElement(name);
  if (!xml) return std::nullopt;
  Element found(*xml, *file_, std::string(name) + " of " + title_);
  if (const auto* second = xml->NextSiblingElement(name))
    Element(*second, *file_, found.title_)
        .fail(fmt::format("is there already, in line {}", xml->GetLineNum()), "keep one of them");
  return found;
}

Element Element::only_child(const char* name) {
  std::optional<Element> found = child(name);
  if (!found) fail(fmt::format("has no <{}>", name), fmt::format("add <{} .../>", name));
  return *found;
}

bool Element::asked(std::string_view name) const {
  return std::find(asked_.begin(), asked_.end(), name) != asked_.end();
}

void Element::tally_rest(const std::string& owner) {
  const auto tally = [&](const std::string& what, bool is_of_urdf) {
    is_of_urdf ? report().not_used(what + owner) : report().unknown(what + owner);
  };
  for (auto* attribute = xml_->FirstAttribute(); attribute; attribute = attribute->Next())
    if (!asked(attribute->Name()))
      tally(fmt::format("'{}' of {}", shortened(attribute->Name()), xml_->Name()), is_known(attribute->Name()));
  for (auto* node = xml_->FirstChild(); node; node = node->NextSibling()) {
    if (node->ToComment()) continue;
    const tinyxml2::XMLElement* xml = node->ToElement();
    if (!xml) {
      std::string_view text = node->Value();
      text.remove_prefix(std::min(text.find_first_not_of(blanks), text.size()));
      text = text.substr(0, text.find_last_not_of(blanks) + 1);
      tally(fmt::format("text '{}' in {}", shortened(text), xml_->Name()), false);
      continue;
    }
    const std::string_view tag = xml->Name();
    if (tag.starts_with("xacro:"))
      Element(*xml, *file_, fmt::format("<{}>", shortened(tag)))
          .fail("is xacro, which lockstep does not read", "expand it first: xacro robot.urdf.xacro > robot.urdf");
    if (!asked(tag)) tally(shortened(tag), is_known(tag));
  }
}

}  // namespace lockstep::urdf
