// Names of MJCF that a Model has no use for. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace lockstep::importer::mjcf {

/// An element or attribute of MuJoCo 3. Every other name is unknown.
bool is_known(std::string_view name);

/// An element that says what moves, and how: left out, it leaves another mechanism.
bool is_of_mechanism(std::string_view element);

/// An attribute that names its element or its class: it says nothing of the mechanism by itself.
bool is_for_names(std::string_view attribute);

}  // namespace lockstep::importer::mjcf
