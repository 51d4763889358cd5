// Which environments are whose, and that it does not matter. SPDX-License-Identifier: Apache-2.0
#include "lockstep/ranks.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <functional>
#include <limits>
#include <map>
#include <string>

#include "lockstep/error.h"
#include "ranked.h"

namespace lockstep {
namespace {

std::string refusal(const std::function<void()>& act) {
  try {
    act();
  } catch (const UsageError& error) {
    EXPECT_STREQ(error.code(), "usage.rank");
    return error.what();
  }
  return "taken";
}

void expect_refused(const std::function<void()>& act, const std::string& words) {
  const std::string said = refusal(act);
  EXPECT_NE(said.find(words), std::string::npos) << said;
}

TEST(IdsOfRanks, share_all_environments_evenly_in_their_order) {
  for (const std::int64_t environments : {1, 2, 3, 7, 64, 1000, 1023}) {
    for (int ranks = 1; ranks <= std::min<std::int64_t>(environments, 9); ++ranks) {
      std::vector<IdRange> ranges;
      std::int64_t next = 50;
      for (int rank = 0; rank < ranks; ++rank) {
        ranges.push_back(ids_of({rank, ranks}, environments, 50));
        EXPECT_EQ(ranges.back().first, next);
        EXPECT_LE(std::abs(ranges.back().count - static_cast<double>(environments) / ranks), 1.0 - 1e-9);
        next += ranges.back().count;
      }
      EXPECT_EQ(next, 50 + environments);
      std::reverse(ranges.begin(), ranges.end());
      EXPECT_NO_THROW(require_partition(ranges, environments, 50));
    }
  }
}

TEST(IdsOfRanks, are_refused_where_they_cannot_be) {
  expect_refused([] { ids_of({2, 2}, 10); }, "rank: is 2 of 2");
  expect_refused([] { ids_of({0, 0}, 10); }, "rank: is 0 of 0");
  expect_refused([] { ids_of({-1, 2}, 10); }, "rank: is -1 of 2");
  expect_refused([] { ids_of({0, 3}, 2); }, "2 environments are fewer than 3 ranks");
  expect_refused([] { ids_of({1, 2}, std::int64_t{1} << 26); }, "are 33554432 for rank 1, more than a batch holds");
  expect_refused([] { ids_of({0, 512}, std::int64_t{1} << 32, 1); }, "are 4294967296 from 1 on, beyond 2^32 - 1");
  expect_refused([] { ids_of({0, 1}, std::numeric_limits<std::int64_t>::max(), 1); }, "beyond 2^32 - 1");
  EXPECT_EQ(ids_of({255, 256}, std::int64_t{1} << 32), (IdRange{0xff000000u, 1 << 24}));
}

TEST(IdsOfRanks, that_overlap_or_leave_gaps_name_the_ranks) {
  const auto partition = [](std::vector<IdRange> ranges) { return [=] { require_partition(ranges, 30); }; };
  EXPECT_NO_THROW(partition({{10, 20}, {0, 10}})());
  expect_refused(partition({{0, 10}, {12, 18}}), "no rank owns ids 10 to 11");
  expect_refused(partition({{1, 29}}), "no rank owns id 0");
  expect_refused(partition({{0, 10}, {10, 10}}), "no rank owns ids 20 to 29");
  expect_refused(partition({{0, 12}, {20, 10}, {10, 10}}), "ranks 0 and 2 both own ids 10 to 11");
  expect_refused(partition({{0, 30}, {0, 30}}), "ranks 0 and 1 both own ids 0 to 29");
  expect_refused(partition({{0, 10}, {10, 25}}), "go on to 34 for rank 1, beyond 29");
  expect_refused(partition({{0, 30}, {30, 0}}), "are none for rank 1");
  expect_refused([] { require_partition(std::vector<IdRange>{{3, 10}}, 10, 5); }, "begin with 3 for rank 0, below 5");
  expect_refused(partition({}), "no rank owns ids 0 to 29");
}

// The variables of launchers, set while it lives and as they were after it.
class Launched {
 public:
  explicit Launched(const std::map<std::string, std::string>& variables) {
    for (const char* name : {"OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE", "PMI_RANK", "PMI_SIZE", "RANK",
                             "WORLD_SIZE", "SLURM_PROCID", "SLURM_NTASKS"}) {
      const char* const value = std::getenv(name);
      if (value) before_[name] = value;
      unsetenv(name);
    }
    for (const auto& [name, value] : variables) setenv(name.c_str(), value.c_str(), 1), set_.push_back(name);
  }
  ~Launched() {
    for (const std::string& name : set_) unsetenv(name.c_str());
    for (const auto& [name, value] : before_) setenv(name.c_str(), value.c_str(), 1);
  }
  Launched(const Launched&) = delete;
  Launched& operator=(const Launched&) = delete;

 private:
  std::map<std::string, std::string> before_;
  std::vector<std::string> set_;
};

TEST(RankOfLauncher, is_what_the_launcher_says) {
  const auto said = [](const std::map<std::string, std::string>& variables) {
    const Launched launched(variables);
    const Rank own = rank_of_launcher();
    return std::pair(own.rank, own.ranks);
  };
  EXPECT_EQ(said({}), std::pair(0, 1));
  EXPECT_EQ(said({{"OMPI_COMM_WORLD_RANK", "2"}, {"OMPI_COMM_WORLD_SIZE", "4"}}), std::pair(2, 4));
  EXPECT_EQ(said({{"PMI_RANK", "0"}, {"PMI_SIZE", "3"}}), std::pair(0, 3));
  EXPECT_EQ(said({{"RANK", "5"}, {"WORLD_SIZE", "6"}}), std::pair(5, 6));
  EXPECT_EQ(said({{"SLURM_PROCID", "1"}, {"SLURM_NTASKS", "2"}}), std::pair(1, 2));
  EXPECT_EQ(said({{"RANK", "3"}}), std::pair(0, 1)) << "a rank of nobody knows how many is none";
  EXPECT_EQ(said({{"RANK", "captain"}}), std::pair(0, 1));
  // Within a job of Slurm, mpirun counts.
  EXPECT_EQ(
      said(
          {{"SLURM_PROCID", "0"}, {"SLURM_NTASKS", "1"}, {"OMPI_COMM_WORLD_RANK", "1"}, {"OMPI_COMM_WORLD_SIZE", "2"}}),
      std::pair(1, 2));
  expect_refused([&] { said({{"RANK", "two"}, {"WORLD_SIZE", "6"}}); }, "rank in RANK: is 'two'");
  expect_refused([&] { said({{"RANK", "6"}, {"WORLD_SIZE", "6"}}); }, "rank in RANK and WORLD_SIZE: is 6 of 6");
}

TEST(Ranks, give_together_the_bytes_of_one_process) {
  constexpr int environments = 41;
  for (const Plan& plan : ranked::plans()) {
    SCOPED_TRACE(plan.model().name);
    std::vector<std::byte> alone;
    for (const int ranks : {1, 2, 3, 4}) {
      std::vector<Batch<float>> batches = ranked::batches_of<float>(plan, environments, ranks, 1000);
      for (unsigned update = 0; update < 25; ++update)
        for (Batch<float>& batch : batches) ranked::control(batch, update);
      const std::vector<std::byte> bytes = ranked::joined(plan, batches);
      if (ranks == 1) alone = bytes;
      EXPECT_EQ(bytes, alone) << ranks;
      EXPECT_NE(batches[0].save(std::vector{0}), batches[0].save(std::vector{1}));
    }
  }
}

}  // namespace
}  // namespace lockstep
