// Reading a mechanism from a robot file. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "lockstep/model.h"

namespace lockstep {

/// A Model and what became of everything else in the file.
struct Import {
  Model model;
  /// One line per kind of thing: what was read, what was changed (mimics of mimics are resolved), and what was left out
  /// (visual, collision, transmission, ...). Nothing is left out silently.
  std::vector<std::string> report;
};

/// How to repair bodies that a file leaves without inertia; many files are written for drawing or planning. By default
/// nothing is repaired, and a moving link without inertia is an error. A bound above 0 raises smaller values to the
/// bound. It applies to each body: a moving link, or the root, with all links that are fixed to it. A body that has
/// neither mass nor inertia needs both bounds. With either bound, a tensor that no body can have becomes that of a ball
/// with the same mean moment. The report names every link that was changed. MuJoCo calls this boundmass, boundinertia
/// and balanceinertia.
struct ImportOptions {
  double least_mass = 0.0;     ///< kg, >= 0
  double least_inertia = 0.0;  ///< of the principal moments, kg m^2, >= 0
};

/// Reads URDF (docs/importing.md has the details). Meshes are never opened. Throws ImportError where the
/// text is no URDF, ModelError where it describes an impossible mechanism: a moving link without inertia,
/// a mimic multiplier of 0, mimics in a circle, ...; SettingsError where a bound is negative or NaN. The Model is
/// validated. Thread-safe.
LOCKSTEP_API Import import_urdf_file(const std::string& path, const ImportOptions& options = {});

/// The same from text; `source` names it in errors.
LOCKSTEP_API Import import_urdf(const std::string& text, const std::string& source = "URDF text",
                                const ImportOptions& options = {});

}  // namespace lockstep
