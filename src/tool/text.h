// Numbers from text and to text. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace lockstep::tool {

/// The number that the whole text stands for, blanks around it apart: "0.5", "-1e-3", "+2". No locale.
/// Nothing for anything else, infinite and out-of-range numbers included.
std::optional<double> to_number(std::string_view text);

/// As to_number, and fractions: "1/240".
std::optional<double> to_fraction(std::string_view text);

/// Exactly `count` numbers with commas between them. Throws InputError, which starts with `what`.
std::vector<double> to_numbers(const std::string& text, std::size_t count, const std::string& what);

/// The parts of a text around a separator; one more than there are separators.
std::vector<std::string> split(const std::string& text, char separator);

/// Three digits and a prefix, with a blank between: "12.3 M", "950", "1.20 k".
std::string with_prefix(double number);

/// A step size as people write it: "1/240" where that is what it is, else the number.
std::string fraction(double dt);

}  // namespace lockstep::tool
