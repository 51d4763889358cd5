// UTF-8 that can be shown. SPDX-License-Identifier: Apache-2.0
#include "text.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <utility>

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

// Letters to insert, remove, replace or swap with the next one.
std::size_t steps_between(std::string_view from, std::string_view to) {
  std::vector<std::size_t> before, row(to.size() + 1), next(to.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < from.size(); ++i) {
    next[0] = i + 1;
    for (std::size_t j = 0; j < to.size(); ++j) {
      next[j + 1] = std::min({next[j] + 1, row[j + 1] + 1, row[j] + (from[i] != to[j])});
      if (i > 0 && j > 0 && from[i] == to[j - 1] && from[i - 1] == to[j])
        next[j + 1] = std::min(next[j + 1], before[j - 1] + 1);
    }
    before = std::exchange(row, next);
  }
  return row.back();
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

std::string nearest(std::string_view name, const std::vector<std::string>& names) {
  constexpr std::size_t longest_compared = 100, most_compared = 20000;
  std::string best;
  std::size_t least = name.size() / 3 + 1;  // what the best must fall below
  if (name.size() > longest_compared) return best;
  for (std::size_t i = 0; i < std::min(names.size(), most_compared); ++i) {
    const std::size_t longer = std::max(name.size(), names[i].size());
    if (longer - std::min(name.size(), names[i].size()) >= least) continue;
    const std::size_t distance = steps_between(name, names[i]);
    if (distance < least) least = distance, best = names[i];
  }
  return best;
}

std::string exists(const std::string& name) {
  return name.empty() ? "" : fmt::format(": '{}' exists", shortened(name));
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
