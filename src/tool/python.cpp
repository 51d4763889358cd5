// SPDX-License-Identifier: Apache-2.0
#include "python.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>

extern char** environ;

namespace lockstep::tool {

ProcessResult run_process(const std::vector<std::string>& arguments) {
  int ends[2];  // of a pipe: read, write
  if (pipe2(ends, O_CLOEXEC) != 0) return {127, std::strerror(errno)};
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);

  std::vector<char*> argv;
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  pid_t child = 0;
  const int error = posix_spawnp(&child, argv[0], &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  close(ends[1]);

  ProcessResult result;
  if (error != 0) {
    result = {127, std::strerror(error)};
  } else {
    char buffer[4096];
    for (ssize_t count; (count = read(ends[0], buffer, sizeof buffer)) > 0;) result.errors.append(buffer, count);
    int status = 0;
    waitpid(child, &status, 0);
    result.status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  close(ends[0]);
  return result;
}

ProcessResult run_python(const std::string& python, const std::string& script,
                         const std::vector<std::string>& arguments) {
  std::vector<std::string> all = {python, "-I", "-c", script};
  all.insert(all.end(), arguments.begin(), arguments.end());
  return run_process(all);
}

std::optional<std::string> find_python(const std::string& named) {
  // A user who names an interpreter gets that one, or is told that it cannot draw.
  std::vector<std::string> candidates = {"python3", "/usr/bin/python3", "/usr/local/bin/python3", "python"};
  if (const char* chosen = std::getenv("LOCKSTEP_PYTHON"); chosen != nullptr && *chosen != '\0') candidates = {chosen};
  if (!named.empty()) candidates = {named};
  for (const std::string& python : candidates)
    if (run_python(python, "import matplotlib").status == 0) return python;
  return std::nullopt;
}

}  // namespace lockstep::tool
