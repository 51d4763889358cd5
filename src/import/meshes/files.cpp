// SPDX-License-Identifier: Apache-2.0
#include "files.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <string_view>
#include <tuple>

#include "files/regular_file.h"
#include "formats.h"
#include "import/folders.h"
#include "import/paths.h"
#include "import/text.h"
#include "import/xml.h"
#include "lockstep/error.h"

namespace lockstep::importer {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t largest_content = std::size_t{64} << 20;
constexpr Eigen::Index most_vertices = 500'000;  // of a mesh: half a minute for qhull at worst
constexpr Eigen::Index most_vertices_of_all = 2'000'000;
constexpr double least_share = 0.7;     // of its hull that a mesh fills
constexpr double unlikely_size = 10.0;  // m

const char* const or_leave_out = "; or leave meshes out: ImportOptions::leave_out_meshes";

std::string extension_of(const std::string& name) {
  std::string extension = fs::path(name).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  return extension;
}

}  // namespace

MeshFiles::MeshFiles(const ImportOptions& options, const std::string& folder, Report& report)
    : options_(options),
      report_(report),
      folder_(folder.empty() ? fs::path() : real_path(folder)),
      roots_(roots_of(options, folder)) {
  if (options.hull_vertices < 8 || options.hull_vertices > most_hull_corners)
    throw SettingsError("ImportOptions::hull_vertices", fmt::format("is {}", options.hull_vertices),
                        fmt::format("give 8 to {}", most_hull_corners));
}

std::string MeshFiles::unreadable(const std::string& name) {
  const std::string extension = extension_of(name);
  if (extension == ".stl" || extension == ".obj" || extension == ".msh") return "";
  if (extension.empty()) return "has no extension, which would tell its format: convert it to STL";
  if (extension == ".dae") return "is COLLADA, which is not read: convert it to STL";
  return fmt::format("is '{}', which is not read: convert it to STL", shortened(extension));
}

// A folder of that name around the robot file, or beside a folder around it. What lies at the top of the disk is none,
// and no link leads to one.
fs::path MeshFiles::find_package(const std::string& name, const Fail& fail) const {
  if (const auto given = options_.packages.find(name); given != options_.packages.end())
    return real_path(given->second);
  std::error_code ignored;
  const bool is_name = !name.empty() && name != "." && name != "..";
  for (fs::path around = folder_; is_name && around.has_relative_path(); around = around.parent_path()) {
    if (around.filename() == name && around.parent_path().has_relative_path()) return around;
    if (fs::is_directory(around / name, ignored) && real_path(around / name) == around / name) return around / name;
  }
  fail(fmt::format("is in package '{}', which is neither given nor around the file", shortened(name)),
       fmt::format("give its folder: ImportOptions::packages{}", or_leave_out));
  return {};
}

fs::path MeshFiles::find(const std::string& name, const std::string& subfolder, const Fail& fail) {
  const std::string_view text = name;
  std::vector<fs::path> roots = roots_;
  fs::path path;
  if (text.starts_with("package://") || text.starts_with("model://")) {  // model:// is Gazebo's
    const std::string_view rest = text.substr(text.find("//") + 2);
    const std::size_t slash = std::min(rest.find('/'), rest.size());
    const fs::path package = find_package(std::string(rest.substr(0, slash)), fail);
    roots.push_back(package);
    path = package / fs::path(rest.substr(std::min(slash + 1, rest.size()))).relative_path();
  } else if (text.starts_with("file://")) {
    path = fs::path(text.substr(7));
  } else if (text.find("://") != std::string_view::npos) {
    fail(fmt::format("names '{}', which is no file here", shortened(name)),
         "give a path, package://, model:// or file://");
  } else {
    path = fs::path(subfolder) / name;  // `name` alone where it is absolute
  }
  if (path.is_relative() && folder_.empty())
    fail("names a mesh file, which text without a folder cannot",
         fmt::format("read the robot from a file{}", or_leave_out));
  path = real_path(folder_ / path);
  if (!is_within_any(path, roots))
    fail(fmt::format("leads to '{}', outside of the folders that meshes may lie in", shown(path)),
         fmt::format("give a folder around it: ImportOptions::file_roots{}", or_leave_out));
  report_.note_file(path.string());
  return path;
}

std::string MeshFiles::content_of(const fs::path& path, const std::string& what, const Fail& fail) {
  return files::content_of(path, largest_content, [&](const std::string& rule, const std::string& remedy) {
    fail(fmt::format("names the {} '{}', which {}", what, shown(path), rule), remedy + or_leave_out);
  });
}

const Mesh& MeshFiles::read(const fs::path& path, const std::string& extension, const Fail& fail) {
  const auto key = std::make_pair(path, extension);
  if (const auto known = meshes_.find(key); known != meshes_.end()) return known->second;
  const std::string content = content_of(path, "mesh", fail);
  const FailAt fail_at = [&](const std::string& place, const std::string& rule, const std::string& remedy) {
    throw ImportError(fmt::format("{}: {}", shown(path), place), rule, remedy + or_leave_out);
  };
  const auto reader = extension == ".stl" ? read_stl : extension == ".obj" ? read_obj : read_msh;
  Mesh mesh = reader(content, fail_at);
  if (mesh.vertices.cols() > most_vertices)
    fail(fmt::format("names the mesh '{}', which has {} vertices, more than {}", shown(path), mesh.vertices.cols(),
                     most_vertices),
         std::string("simplify the mesh") + or_leave_out);
  return meshes_.emplace(key, std::move(mesh)).first->second;
}

const Solid& MeshFiles::solid(const std::string& name, const std::string& subfolder, const Eigen::Affine3d& placed,
                              const Fail& fail) {
  const fs::path path = find(name, subfolder, fail);
  const auto numbers = placed.matrix().topRows<3>().reshaped();
  const auto key = std::make_tuple(path, extension_of(name), std::vector<double>(numbers.begin(), numbers.end()));
  if (const auto known = solids_.find(key); known != solids_.end()) return known->second;
  Mesh mesh = read(path, extension_of(name), fail);
  vertices_ += mesh.vertices.cols();
  if (vertices_ > most_vertices_of_all)
    fail(fmt::format("makes all meshes have more than {} vertices", most_vertices_of_all),
         std::string("simplify them") + or_leave_out);
  const double stretched = placed.linear().determinant();
  if (!(std::abs(stretched) > 0.0) || !placed.matrix().allFinite())
    fail("has a scale of 0, so that it is flat", "give the three factors of the scale");
  mesh.vertices = placed * mesh.vertices;
  if (stretched < 0.0) mesh.triangles.row(1).swap(mesh.triangles.row(2));
  return solids_.emplace(key, Solid(std::move(mesh))).first->second;
}

Fit MeshFiles::fit_of(const std::string& link) const {
  const auto own = options_.fit_of_links.find(link);
  return own != options_.fit_of_links.end() ? own->second : options_.fit;
}

const Fitted& MeshFiles::shape_of(const Solid& solid, const std::string& link, const std::string& item,
                                  int most_corners, const Fail& fail) const {
  const Fit fit = fit_of(link);
  const Fitted* made = nullptr;
  try {
    made = &solid.fitted(fit, std::min(most_corners, options_.hull_vertices));
  } catch (const std::invalid_argument& error) {
    fail(error.what(), "make it a box, or leave the meshes of its link out: ImportOptions::fit_of_links");
  }
  if (made->inside > 0.0)
    report_.remark("hulls of fewer corners than those of their meshes",
                   fmt::format("{}: {} for {}, {:.2g} mm inside", item, made->corners, solid.hull().corners.cols(),
                               1e3 * made->inside),
                   made->inside);
  if (fit == Fit::hull && solid.is_closed() && solid.share_of_hull() < least_share)
    report_.warn("concave meshes, whose hulls fill their hollows: split them where that matters",
                 fmt::format("{} fills {:.2g} of its hull", item, solid.share_of_hull()));
  if (fit == Fit::hull && !solid.is_closed())
    report_.remark("meshes that are not closed, so what their hulls fill is not known", item);
  if (solid.size() > unlikely_size)
    report_.warn("meshes of more than 10 m, perhaps in millimetres", fmt::format("{}: {:.3g} m", item, solid.size()));
  return *made;
}

}  // namespace lockstep::importer
