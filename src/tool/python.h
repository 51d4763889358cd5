// Finding and running a Python that can draw. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace lockstep::tool {

struct ProcessResult {
  int status = 0;      ///< exit code; 127 where the program could not be started, 128 + n where signal n ended it
  std::string errors;  ///< what it wrote to stderr
};

/// Runs a program, found on PATH unless its name has a slash, and waits for it. No shell: arguments arrive as
/// they are. It has no input and its output goes nowhere.
ProcessResult run_process(const std::vector<std::string>& arguments);

/// The first of the interpreters that can import matplotlib: `asked` alone if it is not empty, else the one
/// that the environment variable LOCKSTEP_PYTHON names, else python3 from PATH and the usual places.
std::optional<std::string> find_python(const std::string& asked);

}  // namespace lockstep::tool
