// Wide numbers have the properties that the kernels rely on. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>

#include "lockstep/batch.h"
#include "simd_operations.h"

namespace lockstep {
namespace {

using simd_test::Operations;

constexpr int most_lanes = 16;
template <class S>
using Numbers = std::array<S, most_lanes>;
using Truths = std::array<bool, most_lanes>;

template <class S>
constexpr S not_a_number = std::numeric_limits<S>::quiet_NaN();
template <class S>
constexpr S infinite = std::numeric_limits<S>::infinity();

template <class S>
Numbers<S> all(S x) {
  Numbers<S> numbers;
  numbers.fill(x);
  return numbers;
}

// Calls check(operations) for every width and arithmetic that this machine has.
template <class Check>
void for_every_wide_type(Check check) {
  constexpr auto baseline_f32 = simd_test::operations<float, 4, simd::Unfused>("baseline");
  constexpr auto baseline_f64 = simd_test::operations<double, 2, simd::Unfused>("baseline");
  constexpr auto scalar_f32 = simd_test::operations<float, 1, simd::Unfused>("baseline_scalar");
  constexpr auto scalar_f64 = simd_test::operations<double, 1, simd::Unfused>("baseline_scalar");
  const auto each = [&](const auto&... operations) {
    const auto one = [&](const auto& wide) {
      SCOPED_TRACE(std::string(wide.name) + (wide.lanes > 1 ? ", wide" : ""));
      check(wide);
    };
    (one(operations), ...);
  };
  each(baseline_f32, baseline_f64, scalar_f32, scalar_f64);
#ifdef __aarch64__
  each(simd_test::neon_f32, simd_test::neon_f64, simd_test::neon_scalar_f32, simd_test::neon_scalar_f64);
#else
  if (supported(Target::avx2))
    each(simd_test::avx2_f32, simd_test::avx2_f64, simd_test::avx2_scalar_f32, simd_test::avx2_scalar_f64);
  if (supported(Target::avx512)) each(simd_test::avx512_f32, simd_test::avx512_f64);
#endif
}

// The largest error of sincos() for arguments up to `reach`, against long doubles of the C library.
template <class S>
double largest_error(const Operations<S>& wide, double reach) {
  std::mt19937_64 engine(1);
  double largest = 0.0;
  for (int tile = 0; tile < 20000; ++tile) {
    Numbers<S> x, sine, cosine;
    for (S& number : x) number = static_cast<S>(reach * (2.0 * (static_cast<double>(engine() >> 11) * 0x1p-53) - 1.0));
    wide.sincos(x.data(), sine.data(), cosine.data());
    for (int i = 0; i < wide.lanes; ++i) {
      const long double exact = x[static_cast<std::size_t>(i)];
      largest = std::max(largest, std::abs(static_cast<double>(sine[static_cast<std::size_t>(i)] - std::sin(exact))));
      largest = std::max(largest, std::abs(static_cast<double>(cosine[static_cast<std::size_t>(i)] - std::cos(exact))));
    }
  }
  return largest;
}

TEST(Sincos, is_as_accurate_as_promised) {
  for_every_wide_type([]<class S>(const Operations<S>& wide) {
    constexpr bool single = sizeof(S) == 4;
    for (double reach : {0.8, 3.2, 100.0, single ? 8192.0 : 1e6})
      EXPECT_LE(largest_error(wide, reach), single ? 1.1e-7 : 3e-16) << "up to " << reach;
  });
}

// The quadrant changes at multiples of pi / 4, and with it the polynomial and the sign.
TEST(Sincos, has_the_right_sign_in_every_quadrant) {
  for_every_wide_type([]<class S>(const Operations<S>& wide) {
    constexpr S tolerance = sizeof(S) == 4 ? S(1.1e-7) : S(3e-16);
    for (int eighth = -64; eighth <= 64; ++eighth)
      for (S nudge : {S(-1), S(0), S(1)}) {
        const S exact = static_cast<S>(eighth * 0.78539816339744830962L);
        const S x = nudge == S(0) ? exact : std::nextafter(exact, nudge * infinite<S>);
        Numbers<S> sine, cosine, minus_sine, minus_cosine;
        wide.sincos(all(x).data(), sine.data(), cosine.data());
        wide.sincos(all(-x).data(), minus_sine.data(), minus_cosine.data());
        EXPECT_NEAR(sine[0], static_cast<S>(std::sin(static_cast<long double>(x))), tolerance) << x;
        EXPECT_NEAR(cosine[0], static_cast<S>(std::cos(static_cast<long double>(x))), tolerance) << x;
        EXPECT_EQ(minus_sine[0], -sine[0]) << "the sine of " << x << " is not odd";
        EXPECT_EQ(minus_cosine[0], cosine[0]) << "the cosine of " << x << " is not even";
      }
    Numbers<S> sine, cosine;
    wide.sincos(all(S(0)).data(), sine.data(), cosine.data());
    EXPECT_EQ(sine[0], S(0));
    EXPECT_EQ(cosine[0], S(1));
  });
}

TEST(Sincos, returns_nan_for_nan_and_infinity) {
  for_every_wide_type([]<class S>(const Operations<S>& wide) {
    for (S x : {not_a_number<S>, -not_a_number<S>, infinite<S>, -infinite<S>}) {
      Numbers<S> sine, cosine;
      wide.sincos(all(x).data(), sine.data(), cosine.data());
      for (std::size_t i = 0; i < static_cast<std::size_t>(wide.lanes); ++i)
        EXPECT_TRUE(std::isnan(sine[i]) && std::isnan(cosine[i])) << x;
    }
  });
}

TEST(Beyond, catches_large_numbers_infinities_and_nan) {
  for_every_wide_type([]<class S>(const Operations<S>& wide) {
    const std::size_t last = static_cast<std::size_t>(wide.lanes) - 1;
    const auto is_beyond = [&](S x, S bound) {  // in the last lane, with zero in all others
      Numbers<S> x_in_last = all(S(0));
      x_in_last[last] = x;
      Truths result;
      wide.beyond(x_in_last.data(), all(bound).data(), result.data());
      EXPECT_EQ(std::count(result.begin(), result.begin() + static_cast<std::ptrdiff_t>(last), true), 0);
      return result[last];
    };
    for (S bound : {S(1e-20), S(1), S(1e5), std::numeric_limits<S>::max()})
      for (S sign : {S(1), S(-1)}) {
        EXPECT_TRUE(is_beyond(std::copysign(not_a_number<S>, sign), bound));
        EXPECT_TRUE(is_beyond(sign * infinite<S>, bound));
        EXPECT_TRUE(is_beyond(std::nextafter(sign * bound, sign * infinite<S>), bound));
        EXPECT_FALSE(is_beyond(sign * bound, bound));
        EXPECT_FALSE(is_beyond(std::nextafter(sign * bound, S(0)), bound));
        EXPECT_FALSE(is_beyond(sign * S(0), bound));
        EXPECT_FALSE(is_beyond(sign * std::numeric_limits<S>::denorm_min(), bound));
      }
  });
}

TEST(Farther, is_the_larger_magnitude_and_keeps_nan) {
  for_every_wide_type([]<class S>(const Operations<S>& wide) {
    const auto farther = [&](S most, S a) {
      Numbers<S> result;
      wide.farther(all(most).data(), all(a).data(), result.data());
      for (int i = 1; i < wide.lanes; ++i)
        EXPECT_EQ(std::isnan(result[static_cast<std::size_t>(i)]), std::isnan(result[0]));
      return result[static_cast<std::size_t>(wide.lanes) - 1];
    };
    const S tiny = std::numeric_limits<S>::denorm_min(), numbers[] = {S(0), tiny, S(1e-20), S(1), S(1e5), infinite<S>};
    for (S most : numbers)
      for (S a : numbers)
        for (S sign : {S(1), S(-1)}) EXPECT_EQ(farther(most, sign * a), std::max(most, a));
    for (S a : numbers)
      for (S nan : {not_a_number<S>, -not_a_number<S>}) {
        EXPECT_TRUE(std::isnan(farther(a, nan)));
        EXPECT_TRUE(std::isnan(farther(std::abs(nan), -a)));
      }
  });
}

TEST(MultiplyAdd, rounds_once_if_fused_and_twice_if_not) {
  for_every_wide_type([]<class S>(const Operations<S>& wide) {
    const S epsilon = std::numeric_limits<S>::epsilon(), a = S(1) + epsilon;
    const volatile S rounded = a * a;  // loses epsilon squared
    const S product = rounded, rest = wide.fused ? epsilon * epsilon : S(0);
    Numbers<S> plus, minus;
    wide.fma(all(a).data(), all(a).data(), all(-product).data(), plus.data());
    wide.fnma(all(a).data(), all(a).data(), all(product).data(), minus.data());
    for (std::size_t i = 0; i < static_cast<std::size_t>(wide.lanes); ++i) {
      EXPECT_EQ(plus[i], rest);
      EXPECT_EQ(minus[i], -rest);
    }
  });
}

// Every lane has different numbers, so the test notices lanes that are mixed up.
TEST(Wide, works_lane_by_lane) {
  for_every_wide_type([]<class S>(const Operations<S>& wide) {
    const std::size_t lanes = static_cast<std::size_t>(wide.lanes);
    for (int shift = 0; shift < 3; ++shift) {
      Numbers<S> a, b, arithmetic, root, selected;
      for (std::size_t i = 0; i < most_lanes; ++i)
        a[i] = S(1.5) + S(i + 1), b[i] = S(0.75) * S((i + shift) % 5) - S(1.6);
      wide.arithmetic(a.data(), b.data(), arithmetic.data());
      wide.sqrt(a.data(), root.data());
      wide.select_less(b.data(), all(S(0)).data(), a.data(), b.data(), selected.data());
      Truths both, either, neither;
      wide.masks(b.data(), a.data(), both.data(), either.data(), neither.data());
      bool negative = false;
      for (std::size_t i = 0; i < lanes; ++i) {
        const volatile S sum = a[i] + b[i], difference = a[i] - b[i], product = sum * difference;
        EXPECT_EQ(arithmetic[i], -product / b[i]);
        EXPECT_EQ(root[i], std::sqrt(a[i]));
        EXPECT_EQ(selected[i], b[i] < S(0) ? a[i] : b[i]);
        EXPECT_FALSE(both[i]);
        EXPECT_EQ(either[i], b[i] < S(0));
        EXPECT_EQ(neither[i], !(b[i] < S(0)));
        negative = negative || b[i] < S(0);
      }
      EXPECT_EQ(wide.any_less(b.data(), all(S(0)).data()), negative);
    }
    EXPECT_FALSE(wide.any_less(all(not_a_number<S>).data(), all(S(0)).data()));
    EXPECT_FALSE(wide.any_less(all(S(0)).data(), all(not_a_number<S>).data()));
  });
}

TEST(Wide, loads_and_stores_its_own_lanes_only) {
  alignas(64) float memory[16];
  std::fill(std::begin(memory), std::end(memory), -1.0f);
  using Four = simd::Wide<float, 4, simd::Unfused>;
  store(memory + 4, Four(2.5f));
  for (int i = 0; i < 16; ++i) EXPECT_EQ(memory[i], i >= 4 && i < 8 ? 2.5f : -1.0f);
  memory[6] = 7.0f;
  EXPECT_EQ(Four::load(memory + 4).lane(2), 7.0f);
  EXPECT_EQ(Four::from_bits(bits(Four::load(memory + 4))).lane(2), 7.0f);
}

}  // namespace
}  // namespace lockstep
