// Numbers as text. SPDX-License-Identifier: Apache-2.0
#include "xml.h"

#include <fmt/format.h>

namespace lockstep::exporter {

std::string numbers(const std::vector<double>& values) {
  std::string text;
  for (const double value : values) text += fmt::format("{}{}", text.empty() ? "" : " ", value + 0.0);
  return text;
}

}  // namespace lockstep::exporter
