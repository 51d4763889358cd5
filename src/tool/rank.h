// The option --rank: which of several processes this is. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "lockstep/ranks.h"

namespace CLI {
class App;
}

namespace lockstep::tool {

struct RankOption : Rank {
  bool by_launcher = false;  ///< so all ranks have the same words of the command
};

/// Adds --rank with this help: R/N, or auto for what the launcher says.
void add_rank(CLI::App& app, RankOption& rank, const std::string& help);

/// What the option calls a file of this rank: "{rank}" in the name is its number. Throws InputError where ranks that
/// one command has started would all write the same file.
std::string name_of_rank(const std::string& option, std::string name, const RankOption& rank);

}  // namespace lockstep::tool
