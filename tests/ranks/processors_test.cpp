// What control groups and the affinity mask grant. SPDX-License-Identifier: Apache-2.0
#include "batch/processors.h"

#include <gtest/gtest.h>
#include <sched.h>

#include <cmath>
#include <fstream>
#include <string>

#include "lockstep/batch.h"
#include "lockstep/plan.h"
#include "scenes/scenes.h"

namespace lockstep {
namespace {

namespace fs = std::filesystem;

// A file system with what the test writes.
class ControlGroups : public testing::Test {
 protected:
  ControlGroups()
      : root_(fs::path(testing::TempDir()) /
              ("lockstep_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()))) {
    fs::remove_all(root_);
  }
  ~ControlGroups() override { fs::remove_all(root_); }

  void file(const std::string& name, const std::string& content) const {
    fs::create_directories((root_ / name).parent_path());
    std::ofstream(root_ / name) << content;
  }
  double quota() const { return processor_quota(root_); }

  fs::path root_;
};

TEST_F(ControlGroups, grant_their_smallest_quota) {
  EXPECT_EQ(quota(), HUGE_VAL) << "there are none";
  file("proc/self/cgroup", "0::/jobs/7/step\n");
  file("sys/fs/cgroup/jobs/cpu.max", "max 100000\n");
  EXPECT_EQ(quota(), HUGE_VAL);
  file("sys/fs/cgroup/jobs/7/cpu.max", "250000 100000\n");
  file("sys/fs/cgroup/jobs/7/step/cpu.max", "800000 100000\n");
  EXPECT_EQ(quota(), 2.5);
}

TEST_F(ControlGroups, are_read_where_a_container_sees_its_own_as_the_root) {
  file("proc/self/cgroup", "0::/docker/0123456789ab\n");
  file("sys/fs/cgroup/cpu.max", "150000 50000\n");
  EXPECT_EQ(quota(), 3.0);
}

TEST_F(ControlGroups, of_the_first_version_are_read_too) {
  file("proc/self/cgroup", "4:cpuset:/\n3:cpu,cpuacct:/slice/job\n0::/\n");
  file("sys/fs/cgroup/cpu,cpuacct/slice/cpu.cfs_quota_us", "-1\n");
  file("sys/fs/cgroup/cpu,cpuacct/slice/cpu.cfs_period_us", "100000\n");
  EXPECT_EQ(quota(), HUGE_VAL);
  file("sys/fs/cgroup/cpu,cpuacct/slice/job/cpu.cfs_quota_us", "50000\n");
  file("sys/fs/cgroup/cpu,cpuacct/slice/job/cpu.cfs_period_us", "100000\n");
  EXPECT_EQ(quota(), 0.5);
}

TEST_F(ControlGroups, that_say_nonsense_grant_everything) {
  file("proc/self/cgroup", "rubbish\n0::/a\n:\n");
  file("sys/fs/cgroup/a/cpu.max", "0 0\n");
  file("sys/fs/cgroup/cpu.max", "much\n");
  EXPECT_EQ(quota(), HUGE_VAL);
}

TEST(Threads, are_as_many_as_the_process_may_use) {
  cpu_set_t mask;
  CPU_ZERO(&mask);
  ASSERT_EQ(sched_getaffinity(0, sizeof mask, &mask), 0);
  const int usable = usable_processors();
  EXPECT_GE(usable, 1);
  EXPECT_LE(usable, CPU_COUNT(&mask));
  const Plan plan = compile(scenes::chain8());
  EXPECT_EQ(Batch<float>(plan, 64).threads(), usable);
  EXPECT_EQ(Batch<float>(plan, 64, {.threads = 1}).threads(), 1);
  EXPECT_EQ(Batch<float>(plan, 64, {.threads = 3}).threads(), 3);
}

TEST(MemoryDomain, holds_the_threads_and_changes_no_bit) {
#ifdef LOCKSTEP_SANITIZED
  GTEST_SKIP() << "oneTBB opens its part for memory domains in a way that the address sanitizer refuses";
#endif
  const Plan plan = compile(scenes::chain8());
  Batch<float> any(plan, 64), held(plan, 64, {.threads = 2, .memory_domain = 0});
  for (Batch<float>* batch : {&any, &held}) batch->step(50);
  EXPECT_EQ(any.save(), held.save());
  EXPECT_EQ(held.threads(), 2);
  EXPECT_NE(held.describe().find("2 threads of memory domain 0."), std::string::npos) << held.describe();
  EXPECT_THROW(Batch<float>(plan, 1, {.memory_domain = -2}), SettingsError);
  try {
    Batch<float>(plan, 1, {.memory_domain = 4096});
    ADD_FAILURE() << "no machine has so many";
  } catch (const SettingsError& error) {
    EXPECT_STREQ(error.code(), "settings.memory_domain");
    EXPECT_NE(std::string(error.what()).find("this process sees"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace lockstep
