// Files and XML, and how they fail. SPDX-License-Identifier: Apache-2.0
#include "xml.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string_view>
#include <vector>

#include "attributes.h"
#include "entities.h"
#include "files/regular_file.h"
#include "lockstep/error.h"
#include "text.h"

namespace lockstep::importer {

std::string text_of(const std::string& path) {
  return files::content_of(path, largest_file, [&](const std::string& rule, const std::string& remedy) {
    throw ImportError(path, rule, remedy);
  });
}

namespace {

constexpr std::size_t most_attributes = 5000;  // of an element

void refuse_usd(std::string_view text, const std::string& source) {
  const bool is_package = source.ends_with(".usdz") && text.starts_with("PK");
  if (text.starts_with("#usda ") || text.starts_with("PXR-USDC") || is_package)
    throw ImportError(source, "is USD, which lockstep does not read",
                      "read the URDF or MJCF that it was made from, or export one of them from Isaac Sim");
}

void refuse_sdf(const tinyxml2::XMLElement& root, const std::string& source) {
  if (std::string_view(root.Name()) == "sdf")
    throw ImportError(fmt::format("{}:{}: <sdf>", source, root.GetLineNum()), "is SDF, which lockstep does not read",
                      "read the robot's URDF, or convert it: sdf2mjcf of the package sdformat-mjcf writes MJCF");
}

// Up to its last tag. What is behind that, such as the zero byte of a C string, is a warning.
std::string_view without_tail(std::string_view text, const std::string& source, Report& report) {
  const auto place_of = [&](std::size_t at) {
    return fmt::format("{}:{}", source, 1 + std::ranges::count(text.substr(0, at), '\n'));
  };
  const std::size_t end = text.rfind('>') + 1;  // 0 without any
  if (const std::size_t zero = text.find('\0'); zero != std::string_view::npos && (zero < end || end == 0))
    throw ImportError(place_of(zero), "is not UTF-8 text: it holds a zero byte", "save it as UTF-8");
  const std::string_view tail = trimmed(text.substr(end));
  if (end == 0 || tail.empty() || tail.find('<') != std::string_view::npos) return text;
  report.warn("bytes behind the root element, not used",
              fmt::format("{}: '{}'", place_of(static_cast<std::size_t>(tail.data() - text.data())), shortened(tail)));
  return text.substr(0, end);
}

// In place, in all attributes. tinyxml2 would keep unknown entities as they stand, and cut a text off at a zero.
void expand_entities(tinyxml2::XMLElement& root, const std::string& source) {
  std::vector<tinyxml2::XMLElement*> todo = {&root};
  while (!todo.empty()) {
    tinyxml2::XMLElement& at = *todo.back();
    todo.pop_back();
    for (auto* attribute = at.FirstAttribute(); attribute; attribute = attribute->Next()) {
      if (std::string_view(attribute->Value()).find('&') == std::string_view::npos) continue;
      const std::optional<std::string> text = expanded(attribute->Value());
      if (!text)
        throw ImportError(fmt::format("{}:{}: <{}>", source, at.GetLineNum(), shortened(at.Name())),
                          fmt::format("{}=\"{}\" holds an entity that XML does not define",
                                      shortened(attribute->Name()), shortened(attribute->Value())),
                          "write the character itself, or &amp; for an ampersand");
      at.SetAttribute(attribute->Name(), text->c_str());
    }
    for (auto* child = at.FirstChildElement(); child; child = child->NextSiblingElement()) todo.push_back(child);
  }
}

// The parser compares each attribute of an element with all before it, so their number is bounded first.
void refuse_many_attributes(std::string_view text, const std::string& source) {
  const auto end_of = [&](std::string_view what, std::size_t from) {
    return std::min(text.find(what, from), text.size());
  };
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '<') continue;
    const std::string_view rest = text.substr(i);
    if (rest.starts_with("<!--") || rest.starts_with("<![CDATA[")) {
      i = end_of(rest.starts_with("<!--") ? "-->" : "]]>", i);
      continue;
    }
    const std::size_t begin = i;
    std::size_t count = 0;
    for (++i; i < text.size() && text[i] != '>'; ++i) {
      if (text[i] != '"' && text[i] != '\'') continue;
      i = end_of(text.substr(i, 1), i + 1);
      if (++count > most_attributes)
        throw ImportError(fmt::format("{}:{}", source, 1 + std::count(text.begin(), text.begin() + begin, '\n')),
                          fmt::format("has an element of more than {} attributes", most_attributes),
                          "give a robot description; none needs that");
    }
  }
}

}  // namespace

tinyxml2::XMLElement& parsed(const std::string& text, const std::string& source, const std::string& wanted,
                             tinyxml2::XMLDocument& document, Report& report) {
  refuse_usd(text, source);
  const std::string_view content = without_tail(text, source, report);
  refuse_many_attributes(content, source);
  if (document.Parse(content.data(), content.size()) != tinyxml2::XML_SUCCESS) {
    const std::string place = fmt::format("{}:{}", source, document.ErrorLineNum());
    if (document.ErrorID() == tinyxml2::XML_ERROR_EMPTY_DOCUMENT)
      throw ImportError(source, "is empty", "give " + wanted);
    if (document.ErrorID() == tinyxml2::XML_ELEMENT_DEPTH_EXCEEDED)
      throw ImportError(place, fmt::format("nests elements deeper than {}", TINYXML2_MAX_ELEMENT_DEPTH),
                        "bodies of MJCF stand within each other: give a chain as long as this as URDF");
    throw ImportError(place, fmt::format("is not well-formed XML ({})", document.ErrorName()),
                      "check the tags and quotes there");
  }
  tinyxml2::XMLElement* root = document.RootElement();
  for (auto* node = document.FirstChild(); node; node = node->NextSibling()) {
    const std::string place = fmt::format("{}:{}", source, node->GetLineNum());
    if (node->ToText() || (node->ToElement() && node != root))
      throw ImportError(place, "has text or elements outside of the root element", "keep one root element");
    if (node->ToUnknown() && std::string_view(node->Value()).find("ENTITY") != std::string_view::npos)
      throw ImportError(place, "declares entities, which are not expanded", "replace them by their text");
  }
  if (!root) throw ImportError(source, "has no XML element", "give " + wanted);
  refuse_sdf(*root, source);
  if (text.find('&') != std::string::npos) expand_entities(*root, source);
  return *root;
}

}  // namespace lockstep::importer
