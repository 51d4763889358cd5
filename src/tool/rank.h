// The option --rank: which of several processes this is. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "lockstep/ranks.h"

namespace CLI {
class App;
}

namespace lockstep::tool {

/// Adds --rank with this help: R/N, or auto for what the launcher says.
void add_rank(CLI::App& app, Rank& rank, const std::string& help);

}  // namespace lockstep::tool
