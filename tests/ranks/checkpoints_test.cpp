// Checkpoints of several ranks: going on from them, and what is left of a rank that was killed.
// SPDX-License-Identifier: Apache-2.0
#include "lockstep/checkpoints.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <string>

#include "lockstep/error.h"
#include "ranked.h"
#include "unit/combination_scenes.h"

namespace lockstep {
namespace {

namespace fs = std::filesystem;

constexpr int environments = 23;

class CheckpointsOfRanks : public testing::Test {
 protected:
  CheckpointsOfRanks() : folder_(emptied("lockstep_checkpoints_" + name())) {}
  ~CheckpointsOfRanks() override { fs::remove_all(folder_); }

  static fs::path emptied(const std::string& name) {
    const fs::path folder = fs::path(testing::TempDir()) / name;
    fs::remove_all(folder);
    return folder;
  }
  static std::string name() { return testing::UnitTest::GetInstance()->current_test_info()->name(); }

  static std::vector<IdRange> ranges(int ranks) {
    std::vector<IdRange> all;
    for (int rank = 0; rank < ranks; ++rank) all.push_back(ids_of({rank, ranks}, environments));
    return all;
  }

  // Two ranks write checkpoint `number` of what they are after so many updates.
  void write(std::uint64_t number, unsigned updates) {
    std::vector<Batch<float>> batches = ranked::batches_of<float>(plan_, environments, 2, 0);
    for (Batch<float>& batch : batches) {
      for (unsigned update = 0; update < updates; ++update) ranked::control(batch, update);
      checkpoints_.write(number, batch);
    }
  }

  void expect_refused(const std::function<void()>& act, const std::string& words) const {
    try {
      act();
      ADD_FAILURE() << "taken, without: " << words;
    } catch (const UsageError& error) {
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
    }
  }

  fs::path folder_;
  Plan plan_ = ranked::plans()[0];
  Checkpoints checkpoints_{folder_};
};

void overwrite(const fs::path& path, const std::function<void(std::string&)>& change) {
  std::ifstream from(path, std::ios::binary);
  std::string content((std::istreambuf_iterator<char>(from)), {});
  change(content);
  std::ofstream(path, std::ios::binary) << content;
}

TEST_F(CheckpointsOfRanks, let_any_number_of_ranks_go_on_with_the_same_bits) {
  for (const Plan& plan : ranked::plans()) {
    SCOPED_TRACE(plan.model().name);
    const Checkpoints checkpoints(folder_ / plan.model().name);
    std::vector<Batch<double>> whole = ranked::batches_of<double>(plan, environments, 1, 0);
    std::vector<Batch<double>> three = ranked::batches_of<double>(plan, environments, 3, 0);
    const auto run = [](std::vector<Batch<double>>& batches, unsigned from, unsigned to) {
      for (Batch<double>& batch : batches)
        for (unsigned update = from; update < to; ++update) ranked::control(batch, update);
    };
    run(whole, 0, 24), run(three, 0, 12);
    for (const Batch<double>& batch : three) checkpoints.write(12, batch);
    checkpoints.complete(12, ranges(3));
    for (const int ranks : {1, 2, 4}) {
      std::vector<Batch<double>> batches = ranked::batches_of<double>(plan, environments, ranks, 0);
      for (Batch<double>& batch : batches) checkpoints.restore(*checkpoints.latest(), batch);
      run(batches, 12, 24);
      EXPECT_EQ(ranked::joined(plan, batches), ranked::joined(plan, whole)) << ranks;
    }
  }
}

// Two ranks step every scene of the page of combinations, stop, and three go on: with the bits of one process.
TEST_F(CheckpointsOfRanks, let_others_go_on_beside_every_feature) {
  std::size_t number = 0, faults = 0;
  for (const std::vector<combinations::Feature>& features : combinations::all_scenes()) {
    const combinations::Scene scene(features);
    SCOPED_TRACE(scene.name);
    const Plan plan = compile(scene.model, scene.settings);
    const auto run = [](std::vector<Batch<float>>& batches, unsigned from, unsigned to) {
      for (Batch<float>& batch : batches)
        for (unsigned update = from; update < to; ++update) ranked::control(batch, update);
    };
    std::vector<Batch<float>> whole = ranked::batches_of<float>(plan, environments, 1, 0),
                              two = ranked::batches_of<float>(plan, environments, 2, 0),
                              three = ranked::batches_of<float>(plan, environments, 3, 0);
    run(whole, 0, 8), run(two, 0, 4);
    for (const Batch<float>& batch : two) checkpoints_.write(number, batch);
    const Checkpoint last = checkpoints_.complete(number++, ranges(2));
    for (Batch<float>& batch : three) checkpoints_.restore(last, batch);
    run(three, 4, 8);
    EXPECT_EQ(ranked::joined(plan, three), ranked::joined(plan, whole));
    faults += static_cast<std::size_t>(whole[0].faulted());
  }
  EXPECT_GT(number, 150u);
  EXPECT_LT(faults, number * environments / 20);
}

TEST_F(CheckpointsOfRanks, count_only_when_they_are_complete) {
  EXPECT_FALSE(checkpoints_.latest());
  write(5, 1);
  EXPECT_FALSE(checkpoints_.latest());
  const Checkpoint five = checkpoints_.complete(5, ranges(2));
  EXPECT_EQ(five.parts.size(), 2u);
  write(10, 2);  // a rank was killed before all had written
  std::ofstream(checkpoints_.folder_of(11).string() + ".tmp") << "what a killed rank leaves";
  ASSERT_TRUE(checkpoints_.latest());
  EXPECT_EQ(checkpoints_.latest()->number, 5u);
  EXPECT_EQ(checkpoints_.latest()->plan_hash, plan_.hash());
  EXPECT_EQ(checkpoints_.complete(10, ranges(2)).number, 10u);
  EXPECT_EQ(checkpoints_.latest()->number, 10u);
  EXPECT_EQ(checkpoints_.open(5).number, 5u);
}

TEST_F(CheckpointsOfRanks, that_are_old_are_removed_by_later_ones) {
  for (const unsigned number : {1u, 2u, 3u, 4u}) {
    write(number, 0);
    if (number != 2) checkpoints_.complete(number, ranges(2));  // 2 was left half done
  }
  EXPECT_TRUE(fs::exists(checkpoints_.folder_of(4)));
  EXPECT_TRUE(fs::exists(checkpoints_.folder_of(3)));
  EXPECT_FALSE(fs::exists(checkpoints_.folder_of(2)));
  EXPECT_FALSE(fs::exists(checkpoints_.folder_of(1)));
  const Checkpoints all(folder_, 0);
  for (const unsigned number : {5u, 6u, 7u}) {
    write(number, 0);
    all.complete(number, ranges(2));
  }
  EXPECT_TRUE(fs::exists(checkpoints_.folder_of(3)));
}

TEST_F(CheckpointsOfRanks, are_refused_where_they_are_damaged) {
  write(5, 1);
  checkpoints_.complete(5, ranges(2));
  const fs::path part = checkpoints_.folder_of(5) / checkpoints_.latest()->parts[1].file;
  const fs::path manifest = checkpoints_.folder_of(5) / "manifest.json";
  std::vector<Batch<float>> two = ranked::batches_of<float>(plan_, environments, 2, 0);
  const std::vector<std::byte> before = two[1].save();
  const auto restore = [&] { checkpoints_.restore(*checkpoints_.latest(), two[1]); };

  const auto checked = [&](const std::function<void(std::string&)>& change, const std::string& words) {
    std::string before;
    overwrite(manifest, [&](std::string& content) { before = content, change(content); });
    expect_refused([&] { checkpoints_.latest(); }, words);
    overwrite(manifest, [&](std::string& content) { content = before; });
  };
  const auto replaced = [](const std::string& from, const std::string& to) {
    return [=](std::string& content) { content.replace(content.find(from), from.size(), to); };
  };
  checked(replaced("\"first\": 12", "\"first\": 4294967308"), "names files that are no parts");
  checked(replaced("\"count\": 11", "\"count\": 10"), "names files that are no parts");
  checked(replaced("\"number\": 5", "\"number\": 6"), "is that of checkpoint 6");
  checked(replaced("\"plan\": \"", "\"plan\": \"x"), "has no plan or no parts");
  checked(replaced("\"parts\": [", "\"parts\": [], \"others\": ["), "has no plan or no parts");

  overwrite(part, [](std::string& content) { content[content.size() / 2] ^= 1; });
  expect_refused(restore, "is not as its manifest says");
  EXPECT_NO_THROW(checkpoints_.restore(*checkpoints_.latest(), two[0])) << "it needs the other part alone";
  EXPECT_EQ(two[1].save(), before);
  expect_refused([&] { checkpoints_.complete(5, ranges(2)); }, "checksum");
  overwrite(part, [](std::string& content) { content[content.size() / 2] ^= 1, content.pop_back(); });
  expect_refused(restore, "is not as its manifest says");
  fs::remove(part);
  expect_refused(restore, "does not exist");

  for (int i = 0; i < 8; ++i) {
    overwrite(manifest, [](std::string& content) { content.resize(content.size() / 2); });
    expect_refused([&] { checkpoints_.latest(); }, "is no whole manifest");
  }
  overwrite(manifest, [](std::string& content) { content = "{\"format\": 7}"; });
  expect_refused([&] { checkpoints_.latest(); }, "has the format 7");
  overwrite(manifest, [](std::string& content) {
    content =
        "{\"format\":1,\"number\":5,\"lockstep\":\"\",\"plan\":\"0\",\"scalar_bytes\":4,"
        "\"parts\":[{\"first\":0,\"count\":2,\"file\":\"../../../etc/passwd\",\"bytes\":9,\"crc32\":1}]}";
  });
  expect_refused([&] { checkpoints_.latest(); }, "names files that are no parts");
}

TEST_F(CheckpointsOfRanks, are_refused_where_ranks_do_not_agree) {
  write(5, 1);
  expect_refused([&] { checkpoints_.complete(5, ranges(3)); }, "does not exist");
  expect_refused([&] { checkpoints_.complete(5, {}); }, "are none");
  const std::vector<IdRange> overlapping = {{0, 12}, {11, 12}}, gap = {{0, 12}, {13, 10}};
  expect_refused([&] { checkpoints_.complete(5, overlapping); }, "ranks 0 and 1 both own id 11");
  expect_refused([&] { checkpoints_.complete(5, gap); }, "no rank owns id 12");

  // A rank with another plan, then one of another precision.
  Model other = plan_.model();
  other.gravity.setZero();
  const Plan weightless = compile(other, plan_.settings());
  checkpoints_.write(5, ranked::batch_of<float>(weightless, ranges(2)[1]));
  expect_refused([&] { checkpoints_.complete(5, ranges(2)); }, "is of plan");
  checkpoints_.write(5, ranked::batch_of<double>(plan_, ranges(2)[1]));
  expect_refused([&] { checkpoints_.complete(5, ranges(2)); }, "is of numbers of bytes 8");

  write(5, 1);
  const Checkpoint five = checkpoints_.complete(5, ranges(2));
  expect_refused([&] { write(5, 1); }, "is complete already");
  Batch<float> foreign = ranked::batch_of<float>(weightless, {0, environments});
  expect_refused([&] { checkpoints_.restore(five, foreign); }, "and the batch has plan");
  Batch<double> wide = ranked::batch_of<double>(plan_, {0, environments});
  expect_refused([&] { checkpoints_.restore(five, wide); }, "use Batch<float>");
  Batch<float> beyond = ranked::batch_of<float>(plan_, {20, 10});
  expect_refused([&] { checkpoints_.restore(five, beyond); }, "has 3 of the 10 environments of the batch");
  Batch<float> mixed = ranked::batch_of<float>(plan_, {0, 5});
  mixed.ids()[3] = 17;
  expect_refused([&] { checkpoints_.write(6, mixed); }, "do not count on: environment 3 has 17");
  EXPECT_NO_THROW(checkpoints_.restore(five, mixed)) << "any environments of it";
}

TEST_F(CheckpointsOfRanks, that_cannot_be_written_leave_nothing) {
  std::ofstream(folder_ / "file") << "no folder";
  expect_refused([&] { Checkpoints(folder_ / "file" / "below"); }, "is no folder");
  expect_refused([&] { Checkpoints(folder_, -1); }, "give 0 to keep all");
  std::ofstream(checkpoints_.folder_of(5)) << "in the way";
  expect_refused([&] { write(5, 0); }, "cannot be");
  fs::create_directories(checkpoints_.folder_of(6) / "0000000000-12.save");  // where the file would be
  expect_refused([&] { write(6, 0); }, "cannot be written");
  EXPECT_EQ(std::distance(fs::directory_iterator(checkpoints_.folder_of(6)), fs::directory_iterator()), 1);
}

}  // namespace
}  // namespace lockstep
