// What fuzz targets share. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include "lockstep/lockstep.h"

namespace lockstep::fuzz {

/// Runs a function. True if it returns, false if it throws what the library refuses by. All else that is thrown ends
/// the program, which libFuzzer reports.
template <class Function>
bool taken(Function&& function) {
  try {
    function();
    return true;
  } catch (const Error&) {
    return false;
  }
}

/// Ends the program, with words, unless the condition holds.
void require(bool holds, const std::string& words);

/// Whether an input, by its bytes alone, is one of those that get all that takes long: one in `n`. The others only get
/// what is quick, so that more of them are tried.
inline bool one_in(std::size_t n, std::string_view input) { return std::hash<std::string_view>{}(input) % n == 0; }

/// Uses a valid model as a program may: compiles it, steps it, reads and describes it, and exports it. Large ones are
/// only described.
void use(const Model& model);

/// Whether no environment that counts as good has a number that is not finite, nor the other way around.
template <class S>
void require_sound(const Batch<S>& batch);

}  // namespace lockstep::fuzz
