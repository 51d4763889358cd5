// XML text of a robot description. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tinyxml2.h>

#include <string>

#include "report.h"

namespace lockstep::importer {

/// No robot needs more text. The limit keeps a path such as /dev/zero from filling the memory.
inline constexpr std::size_t largest_file = std::size_t{256} << 20;

/// The content of a file. Throws ImportError where it cannot be read or is larger than largest_file.
std::string text_of(const std::string& path);

/// The root element. `source` names the text in errors, `wanted` says what it should be. Throws ImportError where it is
/// no well-formed XML, has anything beside its root element, or is of another format that has a name. Text and zero
/// bytes behind the last tag are a warning. Entities in attributes are expanded.
tinyxml2::XMLElement& parsed(const std::string& text, const std::string& source, const std::string& wanted,
                             tinyxml2::XMLDocument& document, Report& report);

}  // namespace lockstep::importer
