// Memory of a batch: rows of environments. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/mman.h>

#include <algorithm>
#include <cstddef>
#include <memory>
#include <new>

namespace lockstep {

inline constexpr std::size_t cache_line = 64;
inline constexpr std::size_t huge_page = 2u << 20;

/// A block of zeros, aligned to cache lines, or to huge pages if it fills one. A tile accesses every row, and in a
/// large batch each row lies in a different small page. The processor could not keep the translations of so many pages.
template <class E>
class AlignedBlock {
 public:
  AlignedBlock() = default;
  explicit AlignedBlock(std::size_t count) : count_(count) {
    if (count == 0) return;
    const std::size_t bytes = count * sizeof(E);
    const std::align_val_t alignment{bytes < huge_page ? cache_line : huge_page};
    block_ = {static_cast<E*>(::operator new(bytes, alignment)), Free{alignment}};
    if (bytes >= huge_page) madvise(block_.get(), bytes / huge_page * huge_page, MADV_HUGEPAGE);  // only a hint
    std::fill_n(block_.get(), count, E{});
  }
  E* data() const { return block_.get(); }
  std::size_t size() const { return count_; }

 private:
  struct Free {
    std::align_val_t alignment{};
    void operator()(E* p) const { ::operator delete(p, alignment); }
  };
  std::unique_ptr<E, Free> block_;
  std::size_t count_ = 0;
};

/// How many numbers apart rows begin: an odd number of cache lines, so that the rows' numbers of one environment do not
/// fall into the same few sets of the cache.
template <class S>
std::ptrdiff_t row_stride(int environments) {
  const std::size_t per_line = cache_line / sizeof(S);
  const std::size_t lines = (static_cast<std::size_t>(environments) + per_line - 1) / per_line;
  return static_cast<std::ptrdiff_t>((lines | 1) * per_line);
}

}  // namespace lockstep
