// SPDX-License-Identifier: Apache-2.0
#include "assets.h"

#include <fmt/format.h>

#include <filesystem>

namespace lockstep::importer::mjcf {
namespace {

// Without a name it has that of its file.
std::string name_of(const Element::Xml& xml) {
  if (const char* name = xml.Attribute("name")) return name;
  const char* file = xml.Attribute("file");
  return file ? std::filesystem::path(file).stem().string() : "";
}

}  // namespace

Element Assets::find(const GeomPart& geom, const std::string& name) {
  if (!elements_) {
    elements_.emplace();
    for (const Element::Xml* xml : document_.section("asset"))
      if (tag_ == xml->Name() && !elements_->try_emplace(name_of(*xml), xml).second)
        Element(document_, *xml)
            .fail(fmt::format("has the name '{}', which is taken", shortened(name_of(*xml))),
                  fmt::format("give each {} its own name", words_));
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
