// Plain names and numbers, and nothing else. SPDX-License-Identifier: Apache-2.0
#include "attributes.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "report.h"
#include "text.h"

namespace lockstep::importer {
namespace {

constexpr std::string_view blanks = " \t\r\n";

enum class Parsed { number, out_of_range, nothing };

// A plain decimal number, and nothing around it.
Parsed parse(std::string_view word, double& value) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);  // from_chars knows no plus
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error == std::errc::result_out_of_range) return Parsed::out_of_range;
  const bool is_number = error == std::errc() && end == word.data() + word.size() && std::isfinite(value);
  return is_number ? Parsed::number : Parsed::nothing;
}

}  // namespace

std::string_view trimmed(std::string_view text) {
  text.remove_prefix(std::min(text.find_first_not_of(blanks), text.size()));
  return text.substr(0, text.find_last_not_of(blanks) + 1);
}

void refuse_unexpanded(const char* attribute, std::string_view text, const Fail& fail) {
  const std::size_t at = std::min(text.find("${"), text.find("$("));
  if (at == std::string_view::npos) return;
  const std::size_t end = text.find(text[at + 1] == '{' ? '}' : ')', at);
  const std::string_view unexpanded = text.substr(at, end == std::string_view::npos ? end : end + 1 - at);
  fail(fmt::format("{}=\"{}\" holds {}, which nothing has expanded", attribute, shortened(text), shortened(unexpanded)),
       "expand it first: xacro robot.urdf.xacro > robot.urdf, with NAME:=VALUE for each $(arg NAME)");
}

std::string name_in(const char* attribute, std::string_view text, const Fail& fail) {
  if (text.find_first_not_of(blanks) == std::string_view::npos)
    fail(fmt::format("{}=\"\" is empty", attribute), "give a name");
  if (!is_plain(text))
    fail(fmt::format("{}=\"{}\" holds invalid UTF-8, or a character that controls or cannot be seen", attribute,
                     shortened(text)),
         "use plain characters in names, in UTF-8");
  return std::string(text);
}

int numbers_in(const char* attribute, std::string_view text, double* values, int least, int most, const Fail& fail) {
  const auto shown = [&] { return fmt::format("{}=\"{}\"", attribute, shortened(text)); };
  const char* const remedy = "write plain decimal numbers such as 0.5 or 1e-3, blanks between them";
  refuse_unexpanded(attribute, text, fail);
  int found = 0;
  std::size_t at = text.find_first_not_of(blanks);
  while (at != std::string_view::npos) {
    const std::size_t stop = std::min(text.find_first_of(blanks, at), text.size());
    const std::string_view word = text.substr(at, stop - at);
    double value = 0.0;
    const Parsed parsed = parse(word, value);
    if (parsed == Parsed::out_of_range)
      fail(fmt::format("{}: '{}' is beyond the range of numbers", shown(), shortened(word)), remedy);
    if (parsed == Parsed::nothing)
      fail(fmt::format("{}: '{}' is not a finite number", shown(), shortened(word)), remedy);
    if (found < most) values[found] = value;
    ++found;
    at = text.find_first_not_of(blanks, stop);
  }
  if (found < least || found > most)
    fail(fmt::format("{} has {}, not {}", shown(), counted(static_cast<std::size_t>(found), "number"),
                     least == most ? fmt::format("{}", least) : fmt::format("{} to {}", least, most)),
         remedy);
  return found;
}

std::optional<double> number_in(std::string_view text) {
  double value = 0.0;
  if (parse(trimmed(text), value) != Parsed::number) return std::nullopt;
  return value;
}

}  // namespace lockstep::importer
