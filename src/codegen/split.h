// A long step as parts that fit into the instruction cache. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace lockstep::codegen {

struct Definition {
  std::string name;
  bool mask;
};

/// Lines that stay in one part, and the names that they define for later lines.
struct Block {
  std::string code;
  std::vector<Definition> defines;
  int operations = 0;
};

/// Code by part. Values that one part defines and a later one uses go through two arrays: `kept` for numbers, `masks`.
struct Parts {
  std::vector<std::string> code;
  int kept = 0, masks = 0;  ///< the lengths that these arrays need
};

/// Splits blocks into parts of at most `most` operations. A block with more is a part of its own.
Parts split(const std::vector<Block>& blocks, int most);

}  // namespace lockstep::codegen
