// Memory that holds machine code. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace lockstep::jit {

/// A mapping with code in it, never writable and executable at once. Freed with the object.
class CodeMemory {
 public:
  /// Maps the bytes. If the system refuses that, start() is null and refusal() says why.
  explicit CodeMemory(const std::vector<std::uint8_t>& bytes);
  ~CodeMemory();
  CodeMemory(const CodeMemory&) = delete;
  CodeMemory& operator=(const CodeMemory&) = delete;

  const void* start() const { return start_; }
  std::size_t size() const { return size_; }
  const std::string& refusal() const { return refusal_; }

 private:
  void* start_ = nullptr;
  std::size_t size_ = 0;
  std::string refusal_;
};

}  // namespace lockstep::jit
