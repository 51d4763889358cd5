// What converts to an EnvironmentSet, and what does not fit a batch. SPDX-License-Identifier: Apache-2.0
#include <array>
#include <span>

#include "contract.h"
#include "lockstep/error.h"

namespace lockstep {
namespace {

std::vector<int> places_of(const EnvironmentSet& which, int environments = 5) {
  std::vector<int> places;
  which.for_each(environments, [&](int e) { places.push_back(e); });
  return places;
}

using Places = std::vector<int>;

TEST(EnvironmentSet, is_all_or_places_or_a_mask) {
  EXPECT_EQ(places_of(EnvironmentSet::all()), (Places{0, 1, 2, 3, 4}));
  EXPECT_EQ(places_of({}), Places{});
  EXPECT_EQ(places_of({3}), (Places{3}));
  EXPECT_EQ(places_of({1, 0, 1}), (Places{1, 0, 1}));
  EXPECT_EQ(places_of({true, false, false, true, true}), (Places{0, 3, 4}));

  const std::vector<int> places = {4, 2};
  const int array[] = {4, 2};
  EXPECT_EQ(places_of(places), places);
  EXPECT_EQ(places_of(array), places);
  EXPECT_EQ(places_of(std::array<int, 2>{4, 2}), places);
  EXPECT_EQ(places_of(std::span<const int>(array)), places);

  const bool bools[] = {false, false, true, false, true};
  EXPECT_EQ(places_of(bools), (Places{2, 4}));
  EXPECT_EQ(places_of(std::span<const bool>(bools)), (Places{2, 4}));
  EXPECT_EQ(places_of(std::vector<bool>(std::begin(bools), std::end(bools))), (Places{2, 4}));
  EXPECT_EQ(places_of(std::vector<std::uint8_t>{0, 0, 1, 0, 1}), (Places{2, 4}));
}

TEST(EnvironmentSet, is_a_row_or_column_of_bools_of_eigen) {
  Eigen::ArrayXXf numbers = Eigen::ArrayXXf::Zero(2, 5);
  numbers(1, 3) = 2.0f;
  EXPECT_EQ(places_of(numbers.row(1) > 1.0f), (Places{3}));
  EXPECT_EQ(places_of(numbers.row(0) > 1.0f || numbers.row(1) < 1.0f), (Places{0, 1, 2, 4}));
  const Eigen::Array<bool, 1, Eigen::Dynamic> row = numbers.row(1) > 1.0f;
  EXPECT_EQ(places_of(row), (Places{3}));
  EXPECT_EQ(places_of(row.transpose()), (Places{3}));
  EXPECT_THROW(EnvironmentSet(numbers > 1.0f), UsageError);
}

// What it copies may be forgotten, and copies of it do not share memory that is gone.
TEST(EnvironmentSet, of_braces_lives_on) {
  std::vector<EnvironmentSet> kept;
  for (int i = 0; i < 20; ++i) kept.push_back({i % 5, 4});
  const EnvironmentSet copy = kept[7];
  kept.clear();
  EXPECT_EQ(places_of(copy), (Places{2, 4}));
}

TEST(EnvironmentSet, that_does_not_fit_the_batch_is_refused_before_anything_is_done) {
  const std::vector<bool> few(4);
  std::vector<std::uint8_t> counts = {0, 1, 1, 0, 2};
  Eigen::Array<bool, 6, 1> many;
  many.setConstant(true);
  int calls = 0;
  const auto refused = [&](const EnvironmentSet& which) {
    try {
      which.for_each(5, [&](int) { ++calls; });
    } catch (const UsageError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_NE(refused({1, 5}).find("environment 5: is outside the batch of 5; give 0 to 4"), std::string::npos);
  EXPECT_NE(refused({-1}).find("environment -1"), std::string::npos);
  EXPECT_NE(refused(Places{2, 9}).find("environment 9"), std::string::npos);
  EXPECT_NE(refused(few).find("has 4 entries for 5 environments"), std::string::npos);
  EXPECT_NE(refused(many).find("has 6 entries for 5 environments"), std::string::npos);
  EXPECT_NE(refused({true}).find("has 1 entries for 5 environments"), std::string::npos);
  EXPECT_NE(refused(counts).find("has a 2 at 4, not 0 or 1"), std::string::npos);
  EXPECT_EQ(calls, 0);
}

static_assert(!std::is_default_constructible_v<EnvironmentSet>);
static_assert(!std::is_convertible_v<int, EnvironmentSet>);
static_assert(!std::is_convertible_v<std::vector<unsigned>, EnvironmentSet>);
static_assert(!std::is_convertible_v<std::vector<double>, EnvironmentSet>);
static_assert(!std::is_convertible_v<ResetOptions, EnvironmentSet>);

TEST(EnvironmentSet, chooses_what_is_reset) {
  Batch<float> batch(compile(scenes::chain8()), 5, {.threads = 1});
  batch.step(3);
  batch.reset({});
  EXPECT_EQ(batch.steps()[0], 3u);
  batch.reset({0, 2});
  batch.positions().row(0).setZero();
  batch.positions()(0, 4) = 1.0f;
  batch.reset(batch.positions().row(0) > 0.5f, {.keep_inputs = true});
  EXPECT_EQ(std::vector<std::uint32_t>(batch.steps().begin(), batch.steps().end()),
            (std::vector<std::uint32_t>{0, 3, 0, 3, 0}));
}

}  // namespace
}  // namespace lockstep
