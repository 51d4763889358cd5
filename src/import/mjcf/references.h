// Which attributes name other elements, and whether these exist. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_set>

#include "element.h"

namespace lockstep::importer::mjcf {

/// What the attribute names: "body", "joint", "geom", "site", "tendon", "mesh", ...; empty where it names nothing.
std::string_view referent(std::string_view attribute);

/// The names that a file has, by what referent() says. A kind that is not here is not judged.
using Known = std::map<std::string, std::unordered_set<std::string>, std::less<>>;

struct Dangling {
  const Element::Xml* xml;
  std::string kind, name;
};

/// The first name in the element or below it that nothing has.
std::optional<Dangling> dangling(const Document& document, const Element::Xml& xml, const Known& known);

/// Throws ImportError: the element names something that is not there. `there` are the names of that kind.
[[noreturn]] void fail_to_find(const Element& element, std::string_view kind, const std::string& name,
                               const std::vector<std::string>& there);

}  // namespace lockstep::importer::mjcf
