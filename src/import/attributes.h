// Strict, locale-independent reading of attributes. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>

namespace lockstep::importer {

/// Throws an error about the element, from the rule that it breaks and the remedy.
using Fail = std::function<void(const std::string& rule, const std::string& remedy)>;

/// Without blanks around it.
std::string_view trimmed(std::string_view text);

/// Fails where the text holds what xacro or roslaunch would have expanded: ${...}, $(arg ...), $(find ...).
void refuse_unexpanded(const char* attribute, std::string_view text, const Fail& fail);

/// The attribute as a name. Fails where it is empty or holds characters that cannot be shown as they stand.
std::string name_in(const char* attribute, std::string_view text, const Fail& fail);

/// Reads finite decimal numbers with blanks between them, and returns how many there are. Fails unless they are at
/// least `least` and at most `most`.
int numbers_in(const char* attribute, std::string_view text, double* values, int least, int most, const Fail& fail);

/// Not strict: empty if the text is no finite number.
std::optional<double> number_in(std::string_view text);

}  // namespace lockstep::importer
