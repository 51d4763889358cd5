// What both writers do with what they have written. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "import/report.h"
#include "lockstep/export_model.h"

namespace lockstep::exporter {

using importer::Report;

/// Says "wrote 3 links, ..." before the report's own lines.
Export finished(std::string text, const Model& model, const Report& report);

}  // namespace lockstep::exporter
