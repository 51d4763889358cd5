// Files of numbers on a grid. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string_view>

#include "mesh.h"

namespace lockstep::importer {

/// Reads the whole content of a grey PNG, whose first row is the last of the result, or of MuJoCo's own format: two
/// counts, rows and columns, then numbers by row. Fails where it is neither, or has other than 2 x 2 to `most` numbers.
Eigen::MatrixXd read_grid(std::string_view content, long most, const FailAt& fail);

}  // namespace lockstep::importer
