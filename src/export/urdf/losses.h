// What URDF does not have. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "export/export.h"

namespace lockstep::exporter::urdf {

/// Whether URDF has the shape.
bool is_written(ShapeKind kind);

void report_losses(const Model& model, Report& report);

void report_losses(const Loop& loop, Report& report);

/// Of a moving joint. `start` is where readers start it.
void report_losses(const Joint& joint, double start, Report& report);

}  // namespace lockstep::exporter::urdf
