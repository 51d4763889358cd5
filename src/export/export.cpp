// Reports, and files by their extension. SPDX-License-Identifier: Apache-2.0
#include "export.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <system_error>

#include "lockstep/error.h"

namespace lockstep {
namespace exporter {
namespace {

Export written(Export result, const std::string& path) {
  errno = 0;
  std::ofstream stream(path, std::ios::binary);
  stream << result.text << std::flush;
  if (!stream)
    throw UsageError("file '" + path + "'", "cannot be written: " + std::generic_category().message(errno),
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
