// Files that are opened by name. SPDX-License-Identifier: Apache-2.0
//
// What is opened is looked at, not the name: between a look at a name and its opening it may come to mean another file.
#pragma once

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>

namespace lockstep::files {

/// Closes a descriptor at its end.
class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() {
    if (number_ >= 0) close(number_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  operator int() const { return number_; }

 private:
  int number_;
};

/// The content of a regular file of at most `most` bytes. Never waits: a pipe is refused. `fail(rule, remedy)` throws.
template <class Fail>
std::string content_of(const std::string& path, std::size_t most, const Fail& fail) {
  const auto why = [] { return std::string(std::strerror(errno)); };
  const Descriptor file(open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY));
  struct stat status;
  if (file < 0 && errno == ENOENT) fail("does not exist", "correct the path");
  if (file < 0 || fstat(file, &status) != 0) fail("cannot be opened: " + why(), "check the path and its permissions");
  if (S_ISDIR(status.st_mode)) fail("is a folder", "name a file in it");
  if (!S_ISREG(status.st_mode))
    fail("is no regular file", "name a file on a disk; write what a pipe gives into one first");
  const std::string too_large = "is larger than " + std::to_string(most >> 20) + " MB";
  if (static_cast<std::size_t>(status.st_size) > most) fail(too_large, "give a smaller file");
  std::string content;
  char piece[1 << 16];
  for (ssize_t count; (count = read(file, piece, sizeof piece)) != 0;) {
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fail("cannot be read to its end: " + why(), "check the file and the disk");
    content.append(piece, static_cast<std::size_t>(count));
    if (content.size() > most) fail(too_large, "give a smaller file");
  }
  return content;
}

/// Opens a file to write, which is empty then. -1, and errno, where that fails. A pipe must have a reader.
inline int open_to_write(const std::string& path) {
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NONBLOCK | O_NOCTTY, 0666);
  if (file >= 0) fcntl(file, F_SETFL, fcntl(file, F_GETFL) & ~O_NONBLOCK);
  return file;
}

/// Why open_to_write() or a write failed.
inline std::string why_not_written() {
  return errno == ENXIO ? "it is a pipe that nobody reads" : std::strerror(errno);
}

}  // namespace lockstep::files
