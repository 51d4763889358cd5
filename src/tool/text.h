// Converts numbers from text and to text. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace lockstep::tool {

/// The number that the text holds, whatever the locale: "0.5", "-1e-3", "+2". Blanks may stand around it. Empty for
/// other text, and for NaN, infinite and out-of-range numbers.
std::optional<double> to_number(std::string_view text);

/// As to_number, and fractions: "1/240".
std::optional<double> to_fraction(std::string_view text);

/// Exactly `count` numbers separated by commas. Throws InputError, whose message starts with `what`.
std::vector<double> to_numbers(const std::string& text, std::size_t count, const std::string& what);

/// The parts of a text between separators; one more than there are separators.
std::vector<std::string> split(const std::string& text, char separator);

/// Three digits and a prefix: "12.3 M", "950", "1.20 k".
std::string with_prefix(double number);

/// A step size as people write it: as a fraction such as "1/240" if it is one, else as a number.
std::string fraction(double dt);

/// A message of the library with this command's options in place of members: --least-mass for
/// ImportOptions::least_mass.
std::string with_own_options(std::string message);

}  // namespace lockstep::tool
