// Reading a mechanism from a robot file. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "lockstep/model.h"

namespace lockstep {

/// A Model and what became of everything else in the file.
struct Import {
  Model model;
  /// One line per kind of thing: what was read, what was changed on the way (mimics of mimics
  /// resolved), what the file holds that lockstep has no use for (visual, collision,
  /// transmission, ...). Nothing is left out silently.
  std::vector<std::string> report;
};

/// Reads URDF (docs/importing.md has the details). Meshes are never opened. Throws ImportError where the
/// text is no URDF, ModelError where it describes an impossible mechanism: a moving link without inertia,
/// a mimic multiplier of 0, mimics in a circle, ... The Model is validated. Thread-safe.
Import import_urdf_file(const std::string& path);

/// The same from text; `source` names it in errors.
Import import_urdf(const std::string& text, const std::string& source = "URDF text");

}  // namespace lockstep
