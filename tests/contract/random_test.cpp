// Random numbers: known answers, what they depend on, how they are distributed. SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

#include "batch/draws.h"
#include "contract.h"
#include "lockstep/error.h"

namespace lockstep {
namespace {

using Words = std::array<std::uint32_t, 4>;

// The known answers that come with Random123.
TEST(Philox, gives_the_published_words) {
  EXPECT_EQ(philox({0, 0, 0, 0}, {0, 0}), (Words{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  constexpr std::uint32_t ones = 0xffffffff;
  EXPECT_EQ(philox({ones, ones, ones, ones}, {ones, ones}), (Words{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
  EXPECT_EQ(philox({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
            (Words{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

TEST(Logarithm, and_exponential_are_right_to_rounding) {
  contract::Random random(3);
  for (int i = 0; i < 20000; ++i) {
    const double x = std::exp(random.uniform(-30.0, 30.0)), y = random.uniform(-30.0, 30.0);
    EXPECT_NEAR(logarithm(x), std::log(x), 4e-16 * std::abs(std::log(x)) + 1e-17) << x;
    EXPECT_NEAR(exponential(y), std::exp(y), 4e-16 * std::exp(y)) << y;
  }
  EXPECT_EQ(logarithm(1.0), 0.0);
  EXPECT_EQ(exponential(0.0), 1.0);
  EXPECT_NEAR(logarithm(1.0 - 0x1p-24), std::log(1.0 - 0x1p-24), 1e-22);
}

const Plan& plan() {
  static const Plan it = compile(scenes::chain8());
  return it;
}

// [rows][environments]
template <class S>
using Numbers = typename Batch<S>::Array;

template <class S>
Numbers<S> drawn(const Batch<S>& batch, int rows, unsigned stream = 0, bool normal = false) {
  Numbers<S> numbers = Numbers<S>::Constant(rows, batch.environments(), S(-7));
  const StridedRows<S> out{numbers.data(), numbers.cols(), 1};
  normal ? batch.draw_normal(out, rows, stream) : batch.draw(out, rows, stream);
  return numbers;
}

TEST(Draw, is_a_function_of_seed_id_episode_stream_and_row) {
  Batch<double> batch(plan(), 3, {.threads = 1, .seed = 0x123456789abcdef0u, .first_id = 40});
  EXPECT_EQ(batch.ids()[2], 42u);
  EXPECT_EQ(batch.seeds()[1], 0x123456789abcdef0u);
  batch.seeds()[1] = 77;
  batch.ids()[0] = 5;
  batch.reset({0});
  const Numbers<double> numbers = drawn(batch, 11, 9);
  const std::uint32_t id[] = {5, 41, 42}, episode[] = {1, 0, 0}, low[] = {0x9abcdef0u, 77, 0x9abcdef0u},
                      high[] = {0x12345678u, 0, 0x12345678u};
  for (std::uint32_t e = 0; e < 3; ++e)
    for (std::uint32_t row = 0; row < 11; ++row) {
      const Words words = philox({id[e], episode[e], 9u << 16, row / 4}, {low[e], high[e]});
      EXPECT_EQ(numbers(row, e), static_cast<double>(words[row % 4] >> 8) / 16777216.0) << e << " " << row;
    }
}

TEST(Draw, does_not_depend_on_place_size_threads_order_or_precision) {
  constexpr int environments = 100;
  Batch<float> all(plan(), environments, {.threads = 1, .seed = 11});
  Batch<float> threaded(plan(), environments, {.threads = 2, .seed = 11});
  Batch<double> fine(plan(), environments, {.threads = 1, .seed = 11});
  Batch<float> seven(plan(), 7, {.threads = 1, .seed = 11, .first_id = 40});
  Batch<float> reversed(plan(), environments, {.threads = 1, .seed = 11});
  for (std::uint32_t e = 0; e < environments; ++e) reversed.ids()[e] = environments - 1 - e;
  for (const bool normal : {false, true}) {
    drawn(all, 5, 1, normal);  // what was drawn before does not matter
    const Numbers<float> numbers = drawn(all, 30, 0, normal);
    EXPECT_TRUE((drawn(threaded, 30, 0, normal) == numbers).all());
    EXPECT_TRUE((drawn(fine, 30, 0, normal).cast<float>() == numbers).all());
    EXPECT_TRUE((drawn(seven, 30, 0, normal) == numbers.middleCols(40, 7)).all());
    EXPECT_TRUE((drawn(reversed, 30, 0, normal) == numbers.rowwise().reverse()).all());
    EXPECT_TRUE((drawn(all, 9, 0, normal) == numbers.topRows(9)).all());
  }
}

TEST(Draw, is_another_one_for_each_seed_id_episode_stream_row_and_purpose) {
  Batch<double> batch(plan(), 2, {.threads = 1, .seed = 11});
  std::vector<double> numbers;
  const auto keep = [&](const Numbers<double>& more) {
    numbers.insert(numbers.end(), more.data(), more.data() + more.size());
  };
  keep(drawn(batch, 6));
  keep(drawn(batch, 6, 1));
  keep(drawn(batch, 6, stream_count - 1));
  keep(drawn(batch, 6, 0, true));
  batch.reset();
  keep(drawn(batch, 6));
  batch.seeds()[0] = batch.seeds()[1] = 11ull << 32;
  keep(drawn(batch, 6));
  std::sort(numbers.begin(), numbers.end());
  EXPECT_EQ(std::adjacent_find(numbers.begin(), numbers.end()), numbers.end());
}

TEST(Draw, writes_the_chosen_columns_alone_with_any_strides) {
  Batch<float> batch(plan(), 5, {.threads = 1});
  const Numbers<float> expected = drawn(batch, 3);
  std::vector<float> memory(5 * 8, -7.0f);  // one row of 8 for each environment, of which every second is used
  batch.draw({memory.data(), 2, 8}, 3, 0, {4, 1});
  for (int e = 0; e < 5; ++e)
    for (int k = 0; k < 8; ++k) {
      const bool written = (e == 4 || e == 1) && k % 2 == 0 && k < 6;
      EXPECT_EQ(memory[static_cast<std::size_t>(8 * e + k)], written ? expected(k / 2, e) : -7.0f) << e << " " << k;
    }
}

TEST(Draw, refuses_streams_rows_and_memory_that_are_none) {
  const Batch<float> batch(plan(), 2, {.threads = 1});
  float number = 0.0f;
  const StridedRows<float> out{&number, 0, 0};
  EXPECT_THROW(batch.draw(out, 1, stream_count), UsageError);
  EXPECT_THROW(batch.draw_normal(out, 1, stream_count), UsageError);
  EXPECT_THROW(batch.draw(out, -1), UsageError);
  EXPECT_THROW(batch.draw({}, 1), UsageError);
  EXPECT_THROW(batch.draw(out, 1, 0, {2}), UsageError);
  EXPECT_NO_THROW(batch.draw({}, 0));
  EXPECT_EQ(number, 0.0f);
}

// ---------------------------------------------------------------- distributions

// Chi-square of counts that are expected to be as given, less its mean, in standard deviations of it.
double excess(const std::vector<long>& counts, const std::vector<double>& expected) {
  double chi = 0.0;
  for (std::size_t i = 0; i < counts.size(); ++i)
    chi +=
        (static_cast<double>(counts[i]) - expected[i]) * (static_cast<double>(counts[i]) - expected[i]) / expected[i];
  const double freedom = static_cast<double>(counts.size() - 1);
  return (chi - freedom) / std::sqrt(2.0 * freedom);
}

constexpr int many = 4096, rows = 64;

TEST(UniformDraws, fill_every_bin_alike_and_neighbours_do_not_correlate) {
  const Batch<double> batch(plan(), many, {.threads = 1, .seed = 1});
  for (unsigned stream : {0u, 1u, 300u}) {
    const Numbers<double> u = drawn(batch, rows, stream);
    EXPECT_GE(u.minCoeff(), 0.0);
    EXPECT_LT(u.maxCoeff(), 1.0);
    std::vector<long> counts(256), pairs(1024);
    for (Eigen::Index row = 0; row < rows; ++row)
      for (Eigen::Index e = 0; e < many; ++e) {
        ++counts[static_cast<std::size_t>(256.0 * u(row, e))];
        // Of an environment and the next, of a row and the next.
        const double other = e % 2 == 0 ? u(row, (e + 1) % many) : u((row + 1) % rows, e);
        ++pairs[static_cast<std::size_t>(32.0 * u(row, e)) * 32 + static_cast<std::size_t>(32.0 * other)];
      }
    EXPECT_LT(std::abs(excess(counts, std::vector<double>(256, rows * many / 256.0))), 4.0) << stream;
    EXPECT_LT(std::abs(excess(pairs, std::vector<double>(1024, rows * many / 1024.0))), 4.0) << stream;
    const double n = static_cast<double>(u.size());
    EXPECT_NEAR(u.mean(), 0.5, 4.0 * std::sqrt(1.0 / 12.0 / n));
    EXPECT_NEAR((u - 0.5).square().mean(), 1.0 / 12.0, 4.0 * std::sqrt(1.0 / 180.0 / n));
  }
}

TEST(NormalDraws, have_the_moments_and_the_bins_of_the_normal_distribution) {
  const Batch<double> batch(plan(), many, {.threads = 1, .seed = 2});
  const Numbers<double> z = drawn(batch, rows, 0, true);
  const double n = static_cast<double>(z.size());
  EXPECT_NEAR(z.mean(), 0.0, 4.0 / std::sqrt(n));
  EXPECT_NEAR(z.square().mean(), 1.0, 4.0 * std::sqrt(2.0 / n));
  EXPECT_NEAR(z.cube().mean(), 0.0, 4.0 * std::sqrt(15.0 / n));
  EXPECT_NEAR(z.square().square().mean(), 3.0, 4.0 * std::sqrt(96.0 / n));
  EXPECT_NEAR((z.topRows(rows - 1) * z.bottomRows(rows - 1)).mean(), 0.0, 4.0 / std::sqrt(n));
  EXPECT_LT(z.abs().maxCoeff(), 5.77);
  const auto below = [](double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); };
  std::vector<long> counts(60);
  std::vector<double> expected(60);
  for (std::size_t i = 0; i < 60; ++i) {
    const double low = -3.0 + 0.1 * static_cast<double>(i);
    expected[i] = n * ((i == 59 ? 1.0 : below(low + 0.1)) - (i == 0 ? 0.0 : below(low)));
  }
  for (const double x : z.reshaped())
    ++counts[static_cast<std::size_t>(std::clamp(std::floor((x + 3.0) / 0.1), 0.0, 59.0))];
  EXPECT_LT(std::abs(excess(counts, expected)), 4.0);
}

}  // namespace
}  // namespace lockstep
