// Text of a file in names and messages. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace lockstep::importer {

/// The beginning of a text, for messages: one line of at most 40 characters. What a terminal would not show as it
/// stands is escaped: invalid UTF-8 and control characters as \x1b, invisible ones and those that turn the direction of
/// writing as \u202e.
std::string shortened(std::string_view text);

/// All of its characters can be shown as they stand.
bool is_plain(std::string_view text);

/// Of these names the one that a misspelling may mean: at most a third of its letters differ. Empty if there is none.
std::string nearest(std::string_view name, const std::vector<std::string>& names);

/// For the end of a remedy: ": 'elbow' exists"; empty without a name.
std::string exists(const std::string& name);

}  // namespace lockstep::importer
