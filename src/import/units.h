// Numbers that look as if they were in another unit. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lockstep/model.h"
#include "report.h"

namespace lockstep::importer {

/// Warns of ranges that look like degrees and of inertias that look like mm. They are taken as they are.
void report_units(const Model& model, Report& report);

}  // namespace lockstep::importer
