// UTF-8 that can be shown. SPDX-License-Identifier: Apache-2.0
#include "text.h"

#include <fmt/format.h>

#include <algorithm>

namespace lockstep::importer {
namespace {

constexpr std::size_t longest = 40;  // characters

struct Character {
  std::size_t bytes;
  char32_t code;
  bool is_valid;
};

// The first character of a text that is not empty.
Character first(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  if (byte(0) < 0x80) return {1, byte(0), true};
  const std::size_t bytes = byte(0) >= 0xf0 ? 4 : byte(0) >= 0xe0 ? 3 : 2;
  const Character invalid = {1, byte(0), false};
  if (byte(0) < 0xc2 || byte(0) > 0xf4 || text.size() < bytes) return invalid;
  char32_t code = byte(0) & (0x7fu >> bytes);
  for (std::size_t i = 1; i < bytes; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return invalid;
    code = code << 6 | (byte(i) & 0x3f);
  }
  constexpr char32_t least[] = {0, 0, 0x80, 0x800, 0x10000};
  if (code < least[bytes] || code > 0x10ffff || (code >= 0xd800 && code < 0xe000)) return invalid;
  return {bytes, code, true};
}

// Control characters, line separators, marks of direction and characters without width.
bool is_shown(char32_t c) {
  const auto within = [c](char32_t from, char32_t to) { return c >= from && c <= to; };
  return !(c < ' ' || within(0x7f, 0x9f) || c == 0xad || c == 0x61c || within(0x200b, 0x200f) ||
           within(0x2028, 0x202e) || within(0x2060, 0x206f) || c == 0xfeff || within(0xfff9, 0xfffb));
}

}  // namespace

std::string shortened(std::string_view text) {
  std::string result;
  for (std::size_t shown = 0; !text.empty(); ++shown) {
    if (shown == longest) return result + "...";
    const Character c = first(text);
    if (c.is_valid && is_shown(c.code))
      result += text.substr(0, c.bytes);
    else if (c.code == '\t' || c.code == '\n' || c.code == '\r')
      result += ' ';
    else
      result += c.code < 0x100 ? fmt::format("\\x{:02x}", static_cast<unsigned>(c.code))
                               : fmt::format("\\u{:04x}", static_cast<unsigned>(c.code));
    text.remove_prefix(c.bytes);
  }
  return result;
}

bool is_plain(std::string_view text) {
  while (!text.empty()) {
    const Character c = first(text);
    if (!c.is_valid || !is_shown(c.code)) return false;
    text.remove_prefix(c.bytes);
  }
  return true;
}

}  // namespace lockstep::importer
