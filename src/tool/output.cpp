// SPDX-License-Identifier: Apache-2.0
#include "output.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <set>

#include "files/regular_file.h"
#include "tool.h"

namespace lockstep::tool {

void keep_apart(const std::vector<std::string>& inputs, const std::vector<std::string>& outputs) {
  const auto resolved = [](const std::string& file) {
    std::error_code ignored;  // a path that cannot be resolved is refused when it is opened
    return std::filesystem::weakly_canonical(std::filesystem::absolute(file), ignored);
  };
  std::vector<std::filesystem::path> used;
  std::set<std::filesystem::path> written;
  for (const std::string& file : inputs)
    if (!file.empty()) used.push_back(resolved(file));
  for (const std::string& file : outputs) {
    if (file.empty()) continue;
    std::error_code ignored;
    const auto is_output = [&](const std::filesystem::path& input) {  // links to one file have several names
      return input == resolved(file) || std::filesystem::equivalent(input, file, ignored);
    };
    if (!written.insert(resolved(file)).second || std::any_of(used.begin(), used.end(), is_output))
      throw InputError(
          fmt::format("{}: would be overwritten, but it is another input or output; give another name", file));
  }
}

void require_writable(const std::string& path) {
  if (path.empty()) return;
  std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (folder.empty()) folder = ".";
  const bool exists = access(path.c_str(), F_OK) == 0;
  const bool writable = exists ? access(path.c_str(), W_OK) == 0 : access(folder.c_str(), W_OK | X_OK) == 0;
  std::error_code ignored;
  if (writable && !std::filesystem::is_directory(path, ignored)) return;
  throw InputError(
      fmt::format("{}: cannot be written: {}", path, writable ? std::strerror(EISDIR) : std::strerror(errno)));
}

OutputFile::OutputFile(std::string path)
    : path_(std::move(path)), file_(nullptr, [](std::FILE* file) { return std::fclose(file); }) {
  const int file = files::open_to_write(path_);
  if (file >= 0) file_.reset(fdopen(file, "w"));
  if (!file_) fail();
}

void OutputFile::write(const std::string& text) {
  if (std::fwrite(text.data(), 1, text.size(), file_.get()) != text.size()) fail();
}

void OutputFile::close() {
  if (std::fclose(file_.release()) != 0) fail();
}

void OutputFile::fail() const {
  throw InputError(fmt::format("{}: cannot be written: {}", path_, files::why_not_written()));
}

void open_standard_streams() {
  // The lowest number that is free is taken, so each gets its own. Nothing can be written to a full disk.
  const std::pair<const char*, int> files[] = {
      {"/dev/null", O_RDONLY}, {"/dev/full", O_WRONLY}, {"/dev/null", O_WRONLY}};
  for (int number = 0; number < 3; ++number)
    if (fcntl(number, F_GETFD) < 0) (void)!open(files[number].first, files[number].second);
}

bool is_output_written() { return std::cout.flush() && std::fflush(stdout) == 0 && !std::ferror(stdout); }

void to_stderr(std::string message) {
  std::replace(message.begin(), message.end(), '\n', ' ');
  std::fputs(("lockstep: " + message + "\n").c_str(), stderr);
}

}  // namespace lockstep::tool
