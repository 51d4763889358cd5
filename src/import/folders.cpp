// SPDX-License-Identifier: Apache-2.0
#include "folders.h"

#include <algorithm>

#include "lockstep/error.h"
#include "paths.h"
#include "text.h"

namespace lockstep::importer {

namespace fs = std::filesystem;

namespace {

fs::path folder_in(const std::string& option, const std::string& path) {
  std::error_code ignored;
  if (!fs::is_directory(path, ignored))
    throw SettingsError("ImportOptions::" + option, "names '" + shortened(path) + "', which is no folder",
                        "give the path of a folder");
  return real_path(path);
}

}  // namespace

std::vector<fs::path> roots_of(const ImportOptions& options, const std::string& folder) {
  std::vector<fs::path> roots;
  if (!folder.empty()) roots.push_back(real_path(folder));
  for (const std::string& root : options.file_roots) roots.push_back(folder_in("file_roots", root));
  for (const auto& [name, path] : options.packages) roots.push_back(folder_in("packages", path));
  return roots;
}

std::string shown(const fs::path& path) {
  const std::string text = path.string();
  return text.size() < 500 && is_plain(text) ? text : shortened(text);
}

bool is_within_any(const fs::path& path, const std::vector<fs::path>& roots) {
  return std::any_of(roots.begin(), roots.end(), [&](const fs::path& root) { return is_within(path, root); });
}

}  // namespace lockstep::importer
