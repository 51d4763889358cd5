// Memory of a batch: rows of environments. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <new>

namespace lockstep {

inline constexpr std::size_t cache_line = 64;

/// A zeroed block aligned to cache lines.
template <class E>
class AlignedBlock {
 public:
  AlignedBlock() = default;
  explicit AlignedBlock(std::size_t count) : count_(count) {
    if (count == 0) return;
    block_.reset(static_cast<E*>(::operator new(count * sizeof(E), std::align_val_t{cache_line})));
    std::fill_n(block_.get(), count, E{});
  }
  E* data() const { return block_.get(); }
  std::size_t size() const { return count_; }

 private:
  struct Free {
    void operator()(E* p) const { ::operator delete(p, std::align_val_t{cache_line}); }
  };
  std::unique_ptr<E, Free> block_;
  std::size_t count_ = 0;
};

/// Numbers from one row to the next: whole cache lines, an odd number of them, so that a column of rows
/// does not fall into the same few sets of the cache.
template <class S>
std::ptrdiff_t row_stride(int environments) {
  const std::size_t per_line = cache_line / sizeof(S);
  const std::size_t lines = (static_cast<std::size_t>(environments) + per_line - 1) / per_line;
  return static_cast<std::ptrdiff_t>((lines | 1) * per_line);
}

}  // namespace lockstep
