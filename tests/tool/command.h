// Runs the built command in a temporary folder. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

extern char** environ;

namespace lockstep::tool {

using Arguments = std::vector<std::string>;

inline const std::string model = LOCKSTEP_LINKAGE;

inline std::string contents(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

// Each test works in a folder of its own. Its name has a blank and a quote, which careless shell commands split.
class Command : public testing::Test {
 protected:
  struct Ran {
    int status;
    std::string out, err;
  };

  void SetUp() override {
    const testing::TestInfo& test = *testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::temp_directory_path() /
              ("lockstep it's " + std::string(test.name()) + std::to_string(getpid()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(path(name), std::ios::binary) << text;
    return path(name);
  }

  Ran run(Arguments arguments) const {
    arguments.insert(arguments.begin(), LOCKSTEP_COMMAND);
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    for (const auto& [descriptor, name] : {std::pair(1, "out"), std::pair(2, "err")})
      posix_spawn_file_actions_addopen(&actions, descriptor, path(name).c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    pid_t child = 0;
    EXPECT_EQ(posix_spawn(&child, argv[0], &actions, nullptr, argv.data(), environ), 0);
    posix_spawn_file_actions_destroy(&actions);
    int status = 0;
    waitpid(child, &status, 0);
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, contents(path("out")), contents(path("err"))};
  }

  // Runs `simulate` on the model and expects it to succeed.
  Ran simulate(Arguments arguments) const {
    arguments.insert(arguments.begin(), {"simulate", model, "--envs", "9"});
    Ran ran = run(arguments);
    EXPECT_EQ(ran.status, 0) << ran.err;
    return ran;
  }

  // The trajectory that a run records, as CSV.
  std::string recorded(Arguments arguments, const std::string& name = "record.csv") const {
    arguments.insert(arguments.end(), {"--record", path(name)});
    simulate(arguments);
    return contents(path(name));
  }

  std::filesystem::path folder_;
};

inline std::vector<std::string> lines(const std::string& text) {
  std::vector<std::string> result;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) result.push_back(line);
  return result;
}

// One line that starts with "lockstep: " and contains `said`.
inline void expect_one_complaint(const std::string& err, const std::string& said) {
  EXPECT_EQ(lines(err).size(), 1u) << err;
  EXPECT_TRUE(err.starts_with("lockstep: ")) << err;
  EXPECT_NE(err.find(said), std::string::npos) << err << " does not say: " << said;
}

}  // namespace lockstep::tool
