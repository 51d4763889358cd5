// By what a plan is known: its model and its settings. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

namespace lockstep {

struct Program;

struct Identity {
  std::uint64_t plan, model;  ///< hashes
  std::string settings;       ///< "dt 0.01\nmethod automatic\n" ...: one line for each setting, with all its digits
};

const Identity& identity_of(const Program& program);

}  // namespace lockstep
