// SPDX-License-Identifier: Apache-2.0
#include "text.h"

#include <fmt/format.h>

#include <cctype>
#include <charconv>
#include <cmath>

#include "tool.h"

namespace lockstep::tool {
namespace {

std::string_view trimmed(std::string_view text) {
  const std::string_view blanks = " \t";
  const std::size_t first = text.find_first_not_of(blanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(blanks) - first + 1);
}

}  // namespace

std::optional<double> to_number(std::string_view text) {
  text = trimmed(text);
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);  // from_chars refuses a plus
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::optional<double> to_fraction(std::string_view text) {
  const std::size_t slash = text.find('/');
  if (slash == std::string_view::npos) return to_number(text);
  const std::optional<double> above = to_number(text.substr(0, slash)), below = to_number(text.substr(slash + 1));
  if (!above || !below || *below == 0.0) return std::nullopt;
  return *above / *below;
}

std::vector<double> to_numbers(const std::string& text, std::size_t count, const std::string& what) {
  const std::vector<std::string> parts = split(text, ',');
  if (parts.size() != count)
    throw InputError(count == 1 ? fmt::format("{}: '{}' should be one number", what, text)
                                : fmt::format("{}: '{}' should be {} numbers separated by commas", what, text, count));
  std::vector<double> numbers;
  for (const std::string& part : parts) {
    const std::optional<double> number = to_number(part);
    if (!number) throw InputError(fmt::format("{}: '{}' is not a finite number", what, part));
    numbers.push_back(*number);
  }
  return numbers;
}

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == separator)
      parts.emplace_back();
    else
      parts.back() += c;
  }
  return parts;
}

std::string with_prefix(double number) {
  const char* prefixes[] = {"", " k", " M", " G", " T"};
  int prefix = 0;
  while (std::abs(number) >= 999.5 && prefix < 4) number /= 1000.0, ++prefix;
  const int decimals = std::abs(number) >= 99.95 ? 0 : std::abs(number) >= 9.995 ? 1 : 2;
  return fmt::format("{:.{}f}{}", number, decimals, prefixes[prefix]);
}

std::string fraction(double dt) {
  const double below = std::round(1.0 / dt);
  if (below > 1.0 && std::abs(below * dt - 1.0) < 1e-12) return fmt::format("1/{:.0f}", below);
  return fmt::format("{}", dt);
}

std::string with_own_options(std::string message) {
  for (const std::string_view members : {"ImportOptions::", "StepSettings::"})
    for (std::size_t at; (at = message.find(members)) != std::string::npos;) {
      message.replace(at, members.size(), "--");
      for (at += 2;
           at < message.size() && (std::isalpha(static_cast<unsigned char>(message[at])) || message[at] == '_'); ++at)
        if (message[at] == '_') message[at] = '-';
    }
  constexpr std::string_view armature = "Joint::armature";
  for (std::size_t at; (at = message.find(armature)) != std::string::npos;)
    message.replace(at, armature.size(), "--armature");
  return message;
}

}  // namespace lockstep::tool
