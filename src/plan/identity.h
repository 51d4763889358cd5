// By what a plan is known: its model and its settings. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

namespace lockstep {

struct Program;

/// Of save points and of the hashes in them. Raise it where a number, a row or a setting gets another meaning: what was
/// saved before is then refused, and not taken for what it is not.
inline constexpr std::uint32_t identity_format = 11;

struct Identity {
  std::uint64_t plan, model;  ///< hashes
  std::string settings;       ///< "dt 0.01\nmethod automatic\n" ...: one line for each setting, with all its digits
};

const Identity& identity_of(const Program& program);

}  // namespace lockstep
