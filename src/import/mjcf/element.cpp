// Attributes in layers. SPDX-License-Identifier: Apache-2.0
#include "element.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "import/attributes.h"
#include "lockstep/error.h"

namespace lockstep::importer::mjcf {

Element::Element(Document& document, const Xml& xml, std::vector<const Xml*> defaults)
    : document_(&document), layers_(std::move(defaults)), title_(fmt::format("<{}>", shortened(xml.Name()))) {
  layers_.push_back(&xml);
  document.visit(xml);
}

void Element::fail(const std::string& rule, const std::string& remedy) const {
  throw ImportError(place(), rule, remedy);
}

void Element::fail_in(const Xml& layer, const std::string& rule, const std::string& remedy) const {
  if (&layer == &xml()) fail(rule, remedy);
  throw ImportError(
      fmt::format("{}: default <{}>, which {} takes", document_->line(layer), shortened(layer.Name()), title_), rule,
      remedy);
}

const char* Element::in(const Xml& layer, const char* attribute) const {
  const tinyxml2::XMLAttribute* found = layer.FindAttribute(attribute);
  if (!found) return nullptr;
  document_->note_read(*found);
  return found->Value();
}

const char* Element::last(const char* attribute, const Xml*& layer) const {
  const char* text = nullptr;
  for (const Xml* candidate : layers_)
    if (const char* found = in(*candidate, attribute)) text = found, layer = candidate;
  return text;
}

bool Element::has(const char* attribute) const {
  const Xml* layer = nullptr;
  return last(attribute, layer) != nullptr;
}

bool Element::has_own(const char* attribute) const { return in(xml(), attribute) != nullptr; }

const char* Element::innermost(std::initializer_list<const char*> attributes) const {
  const char* found = nullptr;
  for (const Xml* layer : layers_)
    for (const char* attribute : attributes)
      if (in(*layer, attribute)) found = attribute;
  return found;
}

std::string Element::name(const char* attribute) const {
  if (!has(attribute))
    fail(fmt::format("has no attribute '{}'", attribute), fmt::format("write {}=\"...\"", attribute));
  return name(attribute, "");
}

std::string Element::name(const char* attribute, const std::string& fallback) const {
  const Xml* layer = nullptr;
  const char* text = last(attribute, layer);
  if (!text || !*text) return fallback;
  return name_in(attribute, text,
                 [&](const std::string& rule, const std::string& remedy) { fail_in(*layer, rule, remedy); });
}

int Element::numbers(const char* attribute, double* values, int least, int most) const {
  int count = 0;
  for (const Xml* layer : layers_)
    if (const char* text = in(*layer, attribute))
      count = numbers_in(attribute, text, values, least, most,
                         [&](const std::string& rule, const std::string& remedy) { fail_in(*layer, rule, remedy); });
  return count;
}

std::vector<double> Element::all_numbers(const char* attribute, std::size_t most) const {
  std::vector<double> values(most);
  values.resize(static_cast<std::size_t>(numbers(attribute, values.data(), 0, static_cast<int>(most))));
  return values;
}

double Element::number(const char* attribute, double fallback) const {
  numbers(attribute, &fallback, 1, 1);
  return fallback;
}

double Element::number(const char* attribute) const {
  if (!has(attribute))
    fail(fmt::format("has no attribute '{}'", attribute), fmt::format("write {}=\"...\"", attribute));
  return number(attribute, 0.0);
}

int Element::whole(const char* attribute, int fallback) const {
  const double value = number(attribute, fallback);
  if (value != std::floor(value) || std::abs(value) > 1e9)
    fail(fmt::format("{} is no whole number", attribute), "give a whole number");
  return static_cast<int>(value);
}

Eigen::Vector3d Element::triple(const char* attribute, const Eigen::Vector3d& fallback) const {
  Eigen::Vector3d value = fallback;
  numbers(attribute, value.data(), 3, 3);
  return value;
}

int Element::word(const char* attribute, std::initializer_list<const char*> words, int fallback) const {
  const Xml* layer = nullptr;
  const char* text = last(attribute, layer);
  if (!text) return fallback;
  const auto found = std::find(words.begin(), words.end(), trimmed(text));
  if (found == words.end())
    fail_in(*layer, fmt::format("{}=\"{}\" is not known", attribute, shortened(text)),
            fmt::format("write one of {}", fmt::join(words, ", ")));
  return static_cast<int>(found - words.begin());
}

bool Element::truth(const char* attribute, bool fallback) const {
  return word(attribute, {"false", "true"}, fallback ? 1 : 0) == 1;
}

}  // namespace lockstep::importer::mjcf
