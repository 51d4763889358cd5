// Finds and runs a Python that can draw. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace lockstep::tool {

struct ProcessResult {
  int status = 0;      ///< exit code; 127 if the program could not be started, 128 + n if signal n ended it
  std::string errors;  ///< what it wrote to stderr
};

/// Runs a program and waits for it. It is found on PATH unless its name has a slash. There is no shell, so arguments
/// need no quotes. Its input is empty, and its output is dropped.
ProcessResult run_process(const std::vector<std::string>& arguments);

/// Runs a script in an interpreter that nothing in the current folder, PYTHONPATH or the user's own packages can
/// change.
ProcessResult run_python(const std::string& python, const std::string& script,
                         const std::vector<std::string>& arguments = {});

/// The Python that can import matplotlib: `named` if it is not empty, else the one that the environment variable
/// LOCKSTEP_PYTHON names, else the first python3 on PATH or in the usual places. Empty if that one cannot.
std::optional<std::string> find_python(const std::string& named);

}  // namespace lockstep::tool
