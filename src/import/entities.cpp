// The five entities that XML defines by itself, and characters by number. SPDX-License-Identifier: Apache-2.0
#include "entities.h"

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <utility>

namespace lockstep::importer {
namespace {

constexpr std::pair<std::string_view, char> entities[] = {
    {"amp", '&'}, {"lt", '<'}, {"gt", '>'}, {"quot", '"'}, {"apos", '\''}};

void append_utf8(std::uint32_t code, std::string& text) {
  const auto continued = [&](int shift) { text += static_cast<char>(0x80 | (code >> shift & 0x3f)); };
  if (code < 0x80) {
    text += static_cast<char>(code);
  } else if (code < 0x800) {
    text += static_cast<char>(0xc0 | code >> 6);
    continued(0);
  } else if (code < 0x10000) {
    text += static_cast<char>(0xe0 | code >> 12);
    continued(6), continued(0);
  } else {
    text += static_cast<char>(0xf0 | code >> 18);
    continued(12), continued(6), continued(0);
  }
}

// "#65" or "#x41", without ampersand and semicolon.
bool append_character(std::string_view reference, std::string& text) {
  const bool is_hexadecimal = reference.starts_with("#x");
  reference.remove_prefix(is_hexadecimal ? 2 : 1);
  std::uint32_t code = 0;
  const char* const end = reference.data() + reference.size();
  const auto [stop, error] = std::from_chars(reference.data(), end, code, is_hexadecimal ? 16 : 10);
  if (error != std::errc() || stop != end || code > 0x10ffff || (code >= 0xd800 && code < 0xe000)) return false;
  if (code < 0x20 && code != '\t' && code != '\n' && code != '\r') return false;
  append_utf8(code, text);
  return true;
}

}  // namespace

std::optional<std::string> expanded(std::string_view text) {
  std::string result;
  for (std::size_t at = text.find('&'); at != std::string_view::npos; at = text.find('&')) {
    result += text.substr(0, at);
    const std::size_t end = text.find(';', at);
    if (end == std::string_view::npos) return std::nullopt;
    const std::string_view name = text.substr(at + 1, end - at - 1);
    const auto entity = std::find_if(std::begin(entities), std::end(entities),
                                     [&](const auto& candidate) { return candidate.first == name; });
    if (entity != std::end(entities))
      result += entity->second;
    else if (!name.starts_with('#') || !append_character(name, result))
      return std::nullopt;
    text.remove_prefix(end + 1);
  }
  return result += text;
}

}  // namespace lockstep::importer
