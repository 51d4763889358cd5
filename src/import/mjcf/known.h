// What MJCF has, beside what a Model has use for. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace lockstep::importer::mjcf {

/// An element of MJCF, from MuJoCo 2.2 to 3.14. Every other one is unknown.
bool is_known(std::string_view tag);

/// Whether an element may have the attribute, in elements of this owner. Of an element that nothing is read of: true.
bool has_attribute(std::string_view owner, std::string_view tag, std::string_view name);

/// An element that says what moves, and how: left out, it leaves another mechanism.
bool is_of_mechanism(std::string_view element);

/// An attribute that names its element or its class: it says nothing of the mechanism by itself.
bool is_for_names(std::string_view attribute);

}  // namespace lockstep::importer::mjcf
