// Folders that the files of one robot may lie in. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "lockstep/import.h"

namespace lockstep::importer {

/// Real paths: that of the robot file's own folder, which is empty for text, and those of ImportOptions::file_roots and
/// packages. Throws SettingsError for what is no folder.
std::vector<std::filesystem::path> roots_of(const ImportOptions& options, const std::string& folder);

/// A path as messages have it, whole where that can be.
std::string shown(const std::filesystem::path& path);

/// The real path lies in one of them.
bool is_within_any(const std::filesystem::path& path, const std::vector<std::filesystem::path>& roots);

}  // namespace lockstep::importer
