// Random numbers, and what is drawn with them. SPDX-License-Identifier: Apache-2.0
//
// There is no generator with a state. A number is a function of its environment's seed, id and episode, of the stream
// and of the row: not of the environment's place, of the size of the batch, of threads, or of what was drawn before.
// Section 22 of docs/mathematics.md has the formulas. They use no mathematical library, so the bits are the same on
// every machine.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace lockstep {

/// Philox4x32-10 (M98) of several counters at once, which one instruction can multiply. word[k][i] is word k of counter
/// i, and then of its block.
template <int count>
struct PhiloxBlocks {
  std::uint32_t word[4][count];

  constexpr void run(std::array<std::uint32_t, 2> key) {
    for (int round = 0; round < 10; ++round) {
      for (int i = 0; i < count; ++i) {
        const std::uint64_t a = std::uint64_t{0xd2511f53u} * word[0][i], b = std::uint64_t{0xcd9e8d57u} * word[2][i];
        word[0][i] = static_cast<std::uint32_t>(b >> 32) ^ word[1][i] ^ key[0];
        word[2][i] = static_cast<std::uint32_t>(a >> 32) ^ word[3][i] ^ key[1];
        word[1][i] = static_cast<std::uint32_t>(b), word[3][i] = static_cast<std::uint32_t>(a);
      }
      key[0] += 0x9e3779b9u, key[1] += 0xbb67ae85u;
    }
  }
};

/// Of one counter: a block of four words.
constexpr std::array<std::uint32_t, 4> philox(std::array<std::uint32_t, 4> counter, std::array<std::uint32_t, 2> key) {
  PhiloxBlocks<1> block = {{{counter[0]}, {counter[1]}, {counter[2]}, {counter[3]}}};
  block.run(key);
  return {block.word[0][0], block.word[1][0], block.word[2][0], block.word[3][0]};
}

/// Streams are 0 to stream_count - 1. Functions that draw for different purposes share none, even in the same stream.
inline constexpr unsigned stream_count = 1u << 15;

enum class Distribution {
  uniform,      ///< from low to high
  log_uniform,  ///< the logarithm is uniform; 0 < low
  normal,       ///< low is the mean, high the standard deviation
};

/// What becomes of a compiled value, which is the model's.
enum class Change {
  scale,     ///< value * draw
  add,       ///< value + draw
  absolute,  ///< draw
};

/// How Batch::randomize() changes a field.
struct Randomization {
  Change change = Change::scale;
  double low = 1.0,
         high = 1.0;  ///< finite, low <= high, high - low finite; of a normal distribution: mean and standard deviation
  Distribution distribution = Distribution::uniform;
  std::vector<int> rows = {};  ///< of the field. Empty: all whose compiled value is finite, as a limit may be infinite
  bool shared = false;         ///< one draw of an environment for all these rows
  unsigned stream = 0;         ///< below stream_count
};

}  // namespace lockstep
