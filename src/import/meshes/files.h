// Mesh files of one robot. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "import/attributes.h"
#include "import/report.h"
#include "lockstep/import.h"
#include "solid.h"

namespace lockstep::importer {

/// Finds mesh files and reads them, each once, and only those that are asked for. Height fields are files, too.
class MeshFiles {
 public:
  /// `folder` is that of the robot file; empty for text. Throws SettingsError for options that cannot be.
  MeshFiles(const ImportOptions& options, const std::string& folder, Report& report);

  /// Why a file of this name is not read, where its format is none that is: a rule that it breaks. Empty otherwise.
  static std::string unreadable(const std::string& name);

  /// The mesh of a file, moved, turned and scaled. The name is package://NAME/path, file://path, or a path that begins
  /// in the robot file's folder, below `subfolder`. Calls `fail` for a file that cannot be found, read or understood,
  /// or that lies outside of the folders that it may be in.
  const Solid& solid(const std::string& name, const std::string& subfolder, const Eigen::Affine3d& placed,
                     const Fail& fail);

  /// Where such a file is. Calls `fail` for one that cannot be found, or that lies outside of the folders that it may
  /// be in.
  std::filesystem::path find(const std::string& name, const std::string& subfolder, const Fail& fail);
  /// What it has, at most 64 MB. `what` names it in messages, as "mesh".
  static std::string content_of(const std::filesystem::path& path, const std::string& what, const Fail& fail);

  /// What a collider of the mesh is. Tells the report what is lost: `item` names the collider. `most_corners` bounds
  /// those of a hull, beside the options.
  const Fitted& shape_of(const Solid& solid, const std::string& link, const std::string& item, int most_corners,
                         const Fail& fail) const;
  /// How meshes of the link touch.
  Fit fit_of(const std::string& link) const;

 private:
  using Path = std::filesystem::path;

  Path find_package(const std::string& name, const Fail& fail) const;
  const Mesh& read(const Path& path, const std::string& extension, const Fail& fail);

  const ImportOptions& options_;
  Report& report_;
  Path folder_;                                          // real; empty for text
  std::vector<Path> roots_;                              // real: where files may lie
  std::map<std::pair<Path, std::string>, Mesh> meshes_;  // by extension, too: a link may have another one
  std::map<std::tuple<Path, std::string, std::vector<double>>, Solid> solids_;  // by the file and how it is placed
  Eigen::Index vertices_ = 0;                                                   // of solids_
};

}  // namespace lockstep::importer
