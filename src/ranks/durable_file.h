// Files that are whole or not there, whatever ends the process. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>

namespace lockstep::ranks {

/// Writes a file that appears under its name once all of it is on the disk: another name, fsync, rename, fsync of the
/// folder. A file of that name is replaced. Throws UsageError where that fails.
void write_durably(const std::filesystem::path& path, std::span<const std::byte> bytes);

/// Brings to the disk which files a folder has, so far as its file system does that. Returns whether it has not failed.
bool sync_folder(const std::filesystem::path& folder);

}  // namespace lockstep::ranks
