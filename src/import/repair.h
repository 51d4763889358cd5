// Inertias that a robot file leaves out or gets wrong. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "draft.h"
#include "lockstep/import.h"
#include "report.h"

namespace lockstep::importer {

/// The kind of remark on collision meshes of formats that are not read.
inline const char* const left_out_meshes = "collision meshes, left out";
/// The kind of remark on links with collision meshes that could have filled in an inertia.
inline const char* const unused_meshes = "collision meshes, not used for inertia";

/// Makes the changes that ImportOptions asks for, with a warning for each kind, and reports odd inertias that stay.
/// False where the report has refused a mesh: what has no inertia for that reason is not refused for another. Throws
/// SettingsError if a number of the options is out of its range, ModelError if links form no tree.
bool repair_inertias(const ImportOptions& options, Draft& draft, Report& report);

}  // namespace lockstep::importer
