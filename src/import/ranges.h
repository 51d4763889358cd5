// What couplings do to ranges. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lockstep/model.h"
#include "report.h"

namespace lockstep::importer {

/// Reports followers whose limits do not let their leaders reach theirs.
void report_followers_ranges(const Model& model, Report& report);

}  // namespace lockstep::importer
