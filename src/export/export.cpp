// Reports, and files by their extension. SPDX-License-Identifier: Apache-2.0
#include "export.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <string_view>

#include "files/regular_file.h"
#include "lockstep/error.h"

namespace lockstep {
namespace exporter {
namespace {

Export written(Export result, const std::string& path) {
  std::string_view left = result.text;
  const files::Descriptor file(files::open_to_write(path));
  while (file >= 0 && !left.empty()) {
    const ssize_t count = ::write(file, left.data(), left.size());
    if (count > 0) left.remove_prefix(static_cast<std::size_t>(count));
    if (count < 0 && errno != EINTR) break;
  }
  if (file < 0 || !left.empty())
    throw UsageError("file '" + path + "'", "cannot be written: " + files::why_not_written(),
                     "check the path, its permissions and the disk");
  return result;
}

}  // namespace

Export finished(std::string text, const Model& model, const Report& report) {
  Export result{std::move(text), report.lines(), report.warnings()};
  result.report.insert(result.report.begin(), "wrote " + importer::contents_of(model));
  return result;
}

}  // namespace exporter

Export export_mjcf_file(const Model& model, const std::string& path, const MjcfOptions& options) {
  return exporter::written(export_mjcf(model, options), path);
}

Export export_urdf_file(const Model& model, const std::string& path) {
  return exporter::written(export_urdf(model), path);
}

Export export_file(const Model& model, const std::string& path, const MjcfOptions& options) {
  const std::string extension = std::filesystem::path(path).extension().string();
  if (extension == ".urdf") return export_urdf_file(model, path);
  if (extension == ".xml" || extension == ".mjcf") return export_mjcf_file(model, path, options);
  throw UsageError("file '" + path + "'", "has an extension that names no format",
                   "let it end with .urdf for URDF, .xml or .mjcf for MJCF");
}

}  // namespace lockstep
