// Random numbers of one environment (M98) to (M101): the same bits on every machine. SPDX-License-Identifier:
// Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "lockstep/enums.h"
#include "lockstep/random.h"
#include "simd/sincos.h"

namespace lockstep {

/// What numbers are drawn for. Fields follow `fields`, by Parameter.
enum class Purpose : std::uint32_t { uniform, normal, position, velocity, root_pose, root_velocity, fields = 16 };

inline Purpose purpose_of(Parameter parameter) {
  return static_cast<Purpose>(static_cast<std::uint32_t>(Purpose::fields) + static_cast<std::uint32_t>(parameter));
}

/// log x of a normal number above 0 (M100).
inline double logarithm(double x) {
  int exponent;
  double mantissa = std::frexp(x, &exponent);
  if (mantissa < std::numbers::sqrt2 / 2.0) mantissa *= 2.0, --exponent;
  const double s = (mantissa - 1.0) / (mantissa + 1.0), z = s * s;
  double sum = 0.0;
  for (int k = 21; k > 1; k -= 2) sum = (sum + 1.0 / k) * z;
  return exponent * std::numbers::ln2 + (2.0 * s + 2.0 * s * sum);
}

/// exp x, for results that are normal numbers (M101).
inline double exponential(double x) {
  constexpr double ln2_high = 6.93147180369123816490e-01, ln2_low = 1.90821492927058770002e-10;  // 32 bits and the rest
  const double halvings = std::nearbyint(x / std::numbers::ln2);
  const double r = (x - halvings * ln2_high) - halvings * ln2_low;
  double sum = 1.0;
  for (int k = 14; k > 0; --k) sum = 1.0 + sum * r / k;
  return std::ldexp(sum, static_cast<int>(halvings));
}

/// Numbers of one environment, for one purpose. Four blocks are computed together, which takes hardly longer than one:
/// rows are cheapest in ascending order.
class Draws {
 public:
  Draws(std::uint64_t seed, std::uint32_t id, std::uint32_t episode, unsigned stream, Purpose purpose)
      : key_{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32)},
        id_(id),
        episode_(episode),
        stream_(stream << 16 | static_cast<std::uint32_t>(purpose)) {}

  /// [0, 1), of 24 bits.
  double uniform(int row) {
    take_blocks(row);
    return number(row % words);
  }

  /// Of the standard normal distribution (M99).
  double normal(int row) {
    using One = simd::Wide<double, 1, simd::Unfused>;
    take_blocks(row);
    if (pair_ != row / 2) {
      pair_ = row / 2;
      const int first = row % words & ~1;
      const One radius(std::sqrt(-2.0 * logarithm(number(first) + 0x1p-24)));
      One sine, cosine;
      simd::sincos(One(2.0 * std::numbers::pi * number(first + 1)), sine, cosine);
      normal_ = {(radius * cosine).lane(0), (radius * sine).lane(0)};
    }
    return normal_[static_cast<std::size_t>(row % 2)];
  }

 private:
  static constexpr int blocks = 4, words = 4 * blocks;

  void take_blocks(int row) {
    if (row / words == group_) return;
    group_ = row / words;
    PhiloxBlocks<blocks> of_blocks;
    for (int b = 0; b < blocks; ++b) {
      of_blocks.word[0][b] = id_, of_blocks.word[1][b] = episode_, of_blocks.word[2][b] = stream_;
      of_blocks.word[3][b] = static_cast<std::uint32_t>(blocks * group_ + b);
    }
    of_blocks.run(key_);
    for (int b = 0; b < blocks; ++b)
      for (int k = 0; k < 4; ++k) words_[4 * b + k] = of_blocks.word[k][b];
  }
  double number(int k) const { return static_cast<double>(words_[k] >> 8) * 0x1p-24; }

  std::array<std::uint32_t, 2> key_;
  std::uint32_t id_, episode_, stream_;
  int group_ = -1, pair_ = -1;
  std::uint32_t words_[words];
  std::array<double, 2> normal_;
};

/// Throws UsageError.
void check_stream(unsigned stream);

}  // namespace lockstep
