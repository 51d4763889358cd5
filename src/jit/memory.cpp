// SPDX-License-Identifier: Apache-2.0
#include "memory.h"

#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace lockstep::jit {
namespace {

// Pages that are written first, and executable after that.
void* turned_executable(const std::vector<std::uint8_t>& bytes) {
  void* const pages = mmap(nullptr, bytes.size(), PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (pages == MAP_FAILED) return nullptr;
  std::memcpy(pages, bytes.data(), bytes.size());
  if (mprotect(pages, bytes.size(), PROT_READ | PROT_EXEC) == 0) return pages;
  const int error = errno;
  munmap(pages, bytes.size());
  errno = error;
  return nullptr;
}

// Systems that let no page become executable may still map a file of this process so.
void* mapped_from_file(const std::vector<std::uint8_t>& bytes) {
  const int file = memfd_create("lockstep", MFD_CLOEXEC);
  if (file < 0) return nullptr;
  std::size_t written = 0;
  while (written < bytes.size()) {
    const ssize_t more = write(file, bytes.data() + written, bytes.size() - written);
    if (more < 0 && errno == EINTR) continue;
    if (more <= 0) break;
    written += static_cast<std::size_t>(more);
  }
  void* const pages =
      written == bytes.size() ? mmap(nullptr, bytes.size(), PROT_READ | PROT_EXEC, MAP_PRIVATE, file, 0) : MAP_FAILED;
  const int error = errno;
  close(file);
  errno = error;
  return pages == MAP_FAILED ? nullptr : pages;
}

}  // namespace

CodeMemory::CodeMemory(const std::vector<std::uint8_t>& bytes) : size_(bytes.size()) {
  start_ = turned_executable(bytes);
  if (!start_) start_ = mapped_from_file(bytes);
  if (!start_) refusal_ = std::string("the system allows no executable memory: ") + std::strerror(errno);
}

CodeMemory::~CodeMemory() {
  if (start_) munmap(start_, size_);
}

}  // namespace lockstep::jit
