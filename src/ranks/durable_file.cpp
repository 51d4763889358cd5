// SPDX-License-Identifier: Apache-2.0
#include "durable_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>

#include "files/regular_file.h"
#include "lockstep/error.h"

namespace lockstep::ranks {
namespace {

namespace fs = std::filesystem;

bool write_all(int file, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = ::write(file, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
  return true;
}

}  // namespace

bool sync_folder(const fs::path& folder) {
  const files::Descriptor own(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  return own >= 0 && (fsync(own) == 0 || errno == EINVAL);  // EINVAL: it knows no such thing
}

void write_durably(const fs::path& path, std::span<const std::byte> bytes) {
  const fs::path other = path.string() + "." + std::to_string(getpid()) + ".tmp";
  const bool written = [&] {
    const files::Descriptor file(files::open_to_write(other));
    return file >= 0 && write_all(file, bytes) && fsync(file) == 0;
  }();
  if (written && rename(other.c_str(), path.c_str()) == 0 && sync_folder(path.parent_path())) return;
  const std::string why = files::why_not_written();
  unlink(other.c_str());
  throw UsageError("checkpoint '" + path.string() + "'", "cannot be written: " + why,
                   "check the folder, its permissions and the room on the disk");
}

}  // namespace lockstep::ranks
