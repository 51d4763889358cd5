// A long step as many functions that fit into the first cache for code. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace lockstep::codegen {

struct Definition {
  std::string name;
  bool mask;
};

/// Lines that stay together, and what they define for later ones.
struct Block {
  std::string code;
  std::vector<Definition> defines;
  int operations = 0;
};

/// Code by part. What a part defines and a later one uses goes through two arrays, `kept` of numbers and `masks`.
struct Parts {
  std::vector<std::string> code;
  int kept = 0, masks = 0;  ///< how long these must be
};

/// In parts of no more than `most` operations where blocks allow it.
Parts split(const std::vector<Block>& blocks, int most);

}  // namespace lockstep::codegen
