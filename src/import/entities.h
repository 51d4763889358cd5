// Character references and entities of XML. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace lockstep::importer {

/// The text with &amp;, &lt;, &gt;, &quot;, &apos; and references to characters such as &#65; or &#x41; replaced. Empty
/// where it has another entity, or a reference to what is no character of XML.
std::optional<std::string> expanded(std::string_view text);

}  // namespace lockstep::importer
