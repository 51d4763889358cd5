// What other tools add to URDF and what changes the mechanism. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "element.h"
#include "lockstep/import.h"
#include "mimics.h"

namespace lockstep::importer::urdf {

/// Looks for closed loops, couplings and joints of other tools in a <robot>. They are left out with a warning if the
/// options ask for that. Otherwise the first one is an ImportError. A coupling that `followers` have by a <mimic>
/// counts for nothing.
void judge_foreign(Element& robot, const std::vector<std::string>& followers, const ImportOptions& options);

}  // namespace lockstep::importer::urdf
