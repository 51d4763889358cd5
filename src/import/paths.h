// Where paths lead. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <filesystem>
#include <string>
#include <system_error>

namespace lockstep::importer {

/// Of a file; never empty.
inline std::string folder_of(const std::string& path) {
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  return folder.empty() ? "." : folder.string();
}

/// Where the path leads, through all links. Never throws: what does not exist stays as it is.
inline std::filesystem::path real_path(const std::filesystem::path& path) {
  std::error_code ignored;
  std::filesystem::path real = std::filesystem::weakly_canonical(path, ignored);
  return ignored ? path : real;
}

/// Both are real paths.
inline bool is_within(const std::filesystem::path& path, const std::filesystem::path& folder) {
  return std::mismatch(folder.begin(), folder.end(), path.begin(), path.end()).first == folder.end();
}

}  // namespace lockstep::importer
