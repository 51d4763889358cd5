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

/// What to make of bodies that a file leaves without inertia: many are written for drawing or planning. By default nothing
/// is made up, and a moving link without inertia is an error. A bound above 0 raises what is less, body by body: a moving
/// link, or the root, with all that is fixed to it. Bodies that have neither need both bounds. With either of them, tensors
/// that no body can have become those of balls with the same mean moment. The report names every link that was changed.
/// What MuJoCo calls boundmass, boundinertia and balanceinertia.
struct ImportOptions {
  double least_mass = 0.0;     ///< kg, >= 0
  double least_inertia = 0.0;  ///< of the principal moments, kg m^2, >= 0
};

/// Reads URDF (docs/importing.md has the details). Meshes are never opened. Throws ImportError where the
/// text is no URDF, ModelError where it describes an impossible mechanism: a moving link without inertia,
/// a mimic multiplier of 0, mimics in a circle, ...; SettingsError where a bound is negative or no number. The Model is
/// validated. Thread-safe.
Import import_urdf_file(const std::string& path, const ImportOptions& options = {});

/// The same from text; `source` names it in errors.
Import import_urdf(const std::string& text, const std::string& source = "URDF text", const ImportOptions& options = {});

}  // namespace lockstep
