// Ranges that a file may switch off, and softness. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "element.h"

namespace lockstep::importer::mjcf {

struct Range {
  double lower, upper;
};

/// The range if it limits: the switch says so, or it is automatic and there is a range. "0 0" is none.
/// An empty one is none, with a warning, unless the switch says that it limits. Throws ImportError then, and where
/// MuJoCo would ask for the switch.
std::optional<Range> limited_range(const Element& element, const char* range, const char* limited, bool autolimits);

/// How a constraint yields, by MuJoCo's numbers where the file has none.
struct Yielding {
  double solref[2] = {0.02, 1.0}, solimp[5] = {0.9, 0.95, 0.001, 0.5, 2.0};
};
Yielding yielding_of(const Element& element, const char* solref, const char* solimp);

/// "of solref 0.02 1, solimp ...".
std::string words_of(const Yielding& yielding);

/// The bound of an interval about 0. Warns where the ends differ in size, and takes the smaller one.
double symmetric(const Range& range, const std::string& what, Report& report);

}  // namespace lockstep::importer::mjcf
