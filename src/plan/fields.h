// The fields that may differ per environment: what their rows are called, and the model's values.
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "program.h"

namespace lockstep {

/// By Parameter, then by row.
struct Fields {
  std::vector<std::string> names[parameter_count];
  std::vector<double> values[parameter_count];

  double value(Parameter parameter, int row) const {
    return values[static_cast<unsigned>(parameter)][static_cast<std::size_t>(row)];
  }
};

/// Made when it is first asked for. Thread-safe.
const Fields& fields_of(const Program& program);

/// Rows of Parameter::inertia: ixx, iyy, izz, ixy, ixz, iyz.
inline constexpr int tensor_rows[] = {0, 1, 2, 0, 0, 1}, tensor_columns[] = {0, 1, 2, 1, 2, 2};

}  // namespace lockstep
