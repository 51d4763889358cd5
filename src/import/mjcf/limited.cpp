// Which ranges limit. SPDX-License-Identifier: Apache-2.0
#include "limited.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

namespace lockstep::importer::mjcf {

std::optional<Range> limited_range(const Element& element, const char* range, const char* limited, bool autolimits) {
  enum { no, yes, automatic };
  const int mode = element.word(limited, {"false", "true", "auto"}, automatic);
  if (mode == no) return std::nullopt;
  double ends[] = {0.0, 0.0};
  element.numbers(range, ends, 2, 2);
  const bool is_given = ends[0] != 0.0 || ends[1] != 0.0;
  if (mode == automatic && !is_given) return std::nullopt;
  if (mode == automatic && !autolimits)
    element.fail(fmt::format("has {}, but not {}, with autolimits=\"false\"", range, limited),
                 fmt::format("write {}=\"true\" or \"false\"", limited));
  if (!is_given)
    element.fail(fmt::format("has {}=\"true\", but no {}", limited, range),
                 fmt::format("give a {}, or write {}=\"false\"", range, limited));
  if (!(ends[0] < ends[1])) {
    if (mode == yes) element.fail(fmt::format("{} is empty", range), "give the lower end first");
    element.report().warn("ranges that are empty, so that they limit nothing",
                          fmt::format("{} of {}", range, element.title()));
    return std::nullopt;
  }
  return Range{ends[0], ends[1]};
}

Yielding yielding_of(const Element& element, const char* solref, const char* solimp) {
  Yielding yielding;
  element.numbers(solref, yielding.solref, 1, 2);
  element.numbers(solimp, yielding.solimp, 1, 5);
  return yielding;
}

std::string words_of(const Yielding& yielding) {
  return fmt::format("of solref {:g}, solimp {:g}", fmt::join(yielding.solref, " "), fmt::join(yielding.solimp, " "));
}

double symmetric(const Range& range, const std::string& what, Report& report) {
  const double bound = std::max(0.0, std::min(-range.lower, range.upper));
  if (-range.lower != range.upper)
    report.warn("effort limits whose ends differ, taken as the smaller one",
                fmt::format("{} is {:g} to {:g}", what, range.lower, range.upper));
  return bound;
}

}  // namespace lockstep::importer::mjcf
