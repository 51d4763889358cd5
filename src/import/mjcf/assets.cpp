// SPDX-License-Identifier: Apache-2.0
#include "assets.h"

#include <fmt/format.h>

#include <filesystem>
#include <string_view>

namespace lockstep::importer::mjcf {

std::string name_of_asset(const Element::Xml& xml) {
  if (const char* name = xml.Attribute("name")) return name;
  const char* file = xml.Name() == std::string_view("model") ? nullptr : xml.Attribute("file");
  return file ? std::filesystem::path(file).stem().string() : "";
}

Element Assets::find(const GeomPart& geom, const std::string& name) {
  if (!elements_) {
    elements_.emplace();
    for (const Element::Xml* xml : document_.section("asset"))
      if (tag_ == xml->Name()) elements_->emplace(name_of_asset(*xml), xml);
  }
  const auto found = elements_->find(name);
  if (name.empty() || found == elements_->end())
    geom.element.fail(fmt::format("names {} '{}', which does not exist", words_, shortened(name)),
                      fmt::format("correct the name, or add the <{}> to <asset>", tag_));
  Element element = classes_.element(*found->second, "");
  element.rename(fmt::format("{} '{}'", words_, name));
  return element;
}

}  // namespace lockstep::importer::mjcf
