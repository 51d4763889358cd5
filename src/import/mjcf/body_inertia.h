// Masses of bodies. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "bodies.h"
#include "meshes.h"

namespace lockstep::importer::mjcf {

/// <inertial>, in the body's frame.
Inertia read_inertial(const Element& element, const Settings& settings);

/// Gives bodies the inertia of their geoms where the file asks for that, and applies the bounds on masses and inertias,
/// their balance and the total mass that it asks for. Opens the meshes of moving bodies that are read; of all bodies
/// where the total mass is given.
void weigh(Bodies& bodies, const std::vector<bool>& is_read, const Settings& settings, bool leaves_out_meshes,
           Meshes& meshes, Report& report);

}  // namespace lockstep::importer::mjcf
