// Writing a mechanism as a robot file. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "lockstep/model.h"

namespace lockstep {

/// The text of a robot file, and how far it says what the Model says.
struct Export {
  std::string text;  ///< XML, UTF-8
  /// One line per kind of thing: what stands in the text in another way than in the Model, and what does not stand in
  /// it. Nothing is left out silently.
  std::vector<std::string> report;
  /// The lines of the report about what the format cannot say: there the file's mechanism is another one.
  std::vector<std::string> warnings;
};

struct MjcfOptions {
  /// s, 1e-9 to 1000. The step that the file asks MuJoCo to take. Couplings that are hard here are springs there, as
  /// stiff as this step can hold: their error shrinks with it. Absent: Model::time_step, or 0.001 where that is 0.
  std::optional<double> timestep = {};
};

/// Writes MJCF, MuJoCo's XML, for MuJoCo 3 (docs/importing.md has the details). Reading it back with the keyframe
/// "start" and with ImportOptions::colliders gives the Model, but for what the report names, and with the file's step
/// and the pose "start" more. Throws ModelError where the Model is not valid, SettingsError where the step is not above
/// 0. Thread-safe, as are the functions below.
LOCKSTEP_API Export export_mjcf(const Model& model, const MjcfOptions& options = {});

/// Writes URDF, which has no drives, no gravity, no start, and couplings of two joints alone: the report names what is
/// missing. Throws ModelError where the Model is not valid, or moves something by its armature or start alone.
LOCKSTEP_API Export export_urdf(const Model& model);

/// The same into a file, which is replaced. They throw UsageError, too, where the file cannot be written.
LOCKSTEP_API Export export_mjcf_file(const Model& model, const std::string& path, const MjcfOptions& options = {});
LOCKSTEP_API Export export_urdf_file(const Model& model, const std::string& path);

/// One of these by the file's extension: .urdf, or .xml and .mjcf. Throws UsageError where it is none of these.
LOCKSTEP_API Export export_file(const Model& model, const std::string& path, const MjcfOptions& options = {});

}  // namespace lockstep
