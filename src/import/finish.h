// From what was read to a judged Model. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>

#include "draft.h"
#include "lockstep/import.h"
#include "report.h"

namespace lockstep::importer {

/// Whether the set holds the joint, which follows another or not.
bool holds(const JointSet& set, const std::string& joint, bool follows);

/// Calls `assemble`, which completes the draft, then changes, repairs and validates its model and reports on it.
/// `source` names the text where an error has no line.
Import finished(Draft& draft, const ImportOptions& options, Report& report, const std::string& source,
                const std::function<void()>& assemble);

}  // namespace lockstep::importer
