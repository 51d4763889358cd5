// Where numbers of a caller lie. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <initializer_list>
#include <utility>

namespace lockstep {

/// The bytes from the first number of a strided array to behind its last.
class Extent {
 public:
  /// `axes` are counts and strides, in numbers.
  template <class Number>
  Extent(const Number* data, std::initializer_list<std::pair<std::ptrdiff_t, std::ptrdiff_t>> axes)
      : first_(reinterpret_cast<const std::byte*>(data)), last_(first_) {
    if (!data) return;
    last_ += sizeof(Number);
    for (const auto& [count, stride] : axes) {
      if (count < 1) {
        last_ = first_;
        return;
      }
      (stride > 0 ? last_ : first_) += (count - 1) * stride * static_cast<std::ptrdiff_t>(sizeof(Number));
    }
  }

  bool overlaps(const Extent& other) const {
    return std::less<>()(first_, other.last_) && std::less<>()(other.first_, last_) && first_ != last_ &&
           other.first_ != other.last_;
  }

 private:
  const std::byte *first_, *last_;
};

}  // namespace lockstep
