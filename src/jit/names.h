// Names of machine code, for profilers and debuggers. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

namespace lockstep::jit {

struct NamedCode {
  std::string name;
  const void* start;
  int bytes;
};

/// Tells tools of the names, if the environment asks for that. LOCKSTEP_PERF is a folder: `perf` finds the names in
/// the file perf-PID.map there. LOCKSTEP_GDB=1: `gdb` has them, by its interface for code that is made at run time,
/// as long as the returned object lives, which may be null. Thread-safe within this library; another library that
/// tells gdb of code at the same moment is not waited for, hence the variable.
std::shared_ptr<const void> name_code(const std::vector<NamedCode>& code);

}  // namespace lockstep::jit
