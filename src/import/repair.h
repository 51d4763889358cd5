// Inertias that a robot file leaves out or gets wrong. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lockstep/import.h"
#include "report.h"

namespace lockstep::urdf {

/// Makes the changes that ImportOptions asks for, with a remark for each kind. Throws ModelError if links form no tree.
void repair_inertias(const ImportOptions& options, Model& model, Report& report);

}  // namespace lockstep::urdf
