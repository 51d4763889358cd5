// Where machine code is not allowed, the tables run and say why. SPDX-License-Identifier: Apache-2.0
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>

#include "contract.h"
#include "jit/memory.h"
#include "lockstep/error.h"

namespace lockstep {
namespace {

constexpr int no_exec_gain = 65;  // PR_SET_MDWE

// Runs `check` in a process of its own, which `restrict` has restricted. False if the system cannot restrict it.
template <class Restrict, class Check>
bool in_restricted_process(Restrict restrict, Check check) {
  const pid_t child = fork();
  if (child == 0) {
    if (!restrict()) _exit(77);
    check();
    _exit(testing::Test::HasFailure() ? 1 : 0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  if (WIFEXITED(status) && WEXITSTATUS(status) == 77) return false;
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << "status " << status;
  return true;
}

bool no_page_becomes_executable() { return prctl(no_exec_gain, 1, 0, 0, 0) == 0; }
bool no_file_grows() {
  std::signal(SIGXFSZ, SIG_IGN);
  const rlimit none{0, 0};
  return setrlimit(RLIMIT_FSIZE, &none) == 0;
}

void expect_no_page_to_be_writable_and_executable() {
  std::ifstream maps("/proc/self/maps");
  int executable = 0;
  for (std::string line; std::getline(maps, line);) {
    const std::string rights = line.substr(line.find(' ') + 1, 4);
    executable += rights[2] == 'x';
    EXPECT_FALSE(rights[1] == 'w' && rights[2] == 'x') << line;
  }
  EXPECT_GT(executable, 0);
}

class Restricted : public testing::Test {
 protected:
  void SetUp() override {
    if (physics::engines().size() < 2) GTEST_SKIP() << "there is no machine code here";
  }
};

TEST_F(Restricted, code_is_never_writable_and_executable) {
  Batch<float> batch(compile(scenes::chain8()), 20, {.threads = 1, .engine = Engine::compiled});
  expect_no_page_to_be_writable_and_executable();
  batch.step(3);
  expect_no_page_to_be_writable_and_executable();
}

TEST_F(Restricted, code_runs_where_no_page_may_become_executable) {
  const auto runs = [] {
    Batch<float> batch(compile(scenes::chain8()), 20, {.threads = 1, .engine = Engine::compiled});
    batch.step(3);
    EXPECT_EQ(batch.faulted(), 0);
    expect_no_page_to_be_writable_and_executable();
  };
  if (!in_restricted_process(no_page_becomes_executable, runs)) GTEST_SKIP() << "the system has no such restriction";
}

TEST_F(Restricted, tables_run_where_the_system_refuses_code) {
  const auto falls_back = [] {
    const Plan plan = compile(scenes::chain8());
    EXPECT_EQ(Batch<float>(plan, 1).engine(), Engine::tables);
    try {
      Batch<float>(plan, 1, {.engine = Engine::compiled});
      ADD_FAILURE() << "accepted";
    } catch (const SettingsError& error) {
      EXPECT_NE(error.rule().find("executable memory"), std::string::npos) << error.what();
    }
  };
  const auto restrict = [] { return no_page_becomes_executable() && no_file_grows(); };
  if (!in_restricted_process(restrict, falls_back)) GTEST_SKIP() << "the system has no such restriction";
}

TEST_F(Restricted, tables_run_where_the_environment_forbids_code) {
  const auto falls_back = [] {
    const Plan plan = compile(scenes::chain8());
    EXPECT_EQ(Batch<float>(plan, 1).engine(), Engine::tables);
    EXPECT_NE(plan.describe().find("LOCKSTEP_COMPILED"), std::string::npos) << plan.describe();
    EXPECT_THROW(Batch<float>(plan, 1, {.engine = Engine::compiled}), SettingsError);
  };
  EXPECT_TRUE(in_restricted_process([] { return setenv("LOCKSTEP_COMPILED", "0", 1) == 0; }, falls_back));
}

}  // namespace
}  // namespace lockstep
