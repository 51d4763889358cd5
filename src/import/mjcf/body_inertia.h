// Masses of bodies. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "bodies.h"

namespace lockstep::importer::mjcf {

/// <inertial>, in the body's frame.
Inertia read_inertial(const Element& element, const Settings& settings);

/// Gives the body the inertia of its geoms where the file asks for that. Geoms whose meshes would add to it are noted.
void add_geoms(Body& body, const Element& element, bool has_inertial, const Settings& settings);

/// Applies the bounds on masses and inertias, their balance and the total mass that the file asks for.
void weigh(std::vector<Body>& bodies, const Settings& settings, Document& document);

}  // namespace lockstep::importer::mjcf
