// A hash that is the same on every machine. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string_view>

namespace lockstep {

/// FNV-1a of 64 bits.
class Hash {
 public:
  void add(unsigned char byte) { value_ = (value_ ^ byte) * 1099511628211ull; }
  void add(std::string_view text) {
    for (const char c : text) add(static_cast<unsigned char>(c));
  }
  /// The lowest byte first, whatever the machine's order.
  void add(std::uint64_t number) {
    for (int shift = 0; shift < 64; shift += 8) add(static_cast<unsigned char>(number >> shift));
  }
  std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 14695981039346656037ull;
};

}  // namespace lockstep
