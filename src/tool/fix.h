// Options that read a file which is refused. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "lockstep/error.h"
#include "options.h"

namespace lockstep::tool {

/// Of this command line, each with its value: "--density", "1000".
using Arguments = std::vector<std::string>;

/// Those that the messages name as remedies, none of which can be left out. Empty where they do not read the file.
Arguments fixing_arguments(const ModelOptions& options, const Ignored& ignore, const Error& refusal);

/// Takes further arguments.
void take(const Arguments& arguments, ModelOptions& options, Ignored& ignore);

/// The words as a shell takes them.
std::string shell_words(const Arguments& words);

/// What is thrown beside an Error of a file that options would read.
struct Fix {
  Arguments arguments;
};

/// E is the class of the error.
template <class E>
struct Fixable : E, Fix {
  Fixable(const E& error, Arguments arguments) : E(error), Fix{std::move(arguments)} {}
};

}  // namespace lockstep::tool
