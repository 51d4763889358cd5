// The sections of a file. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "bodies.h"
#include "export/xml.h"
#include "loops.h"

namespace lockstep::exporter::mjcf {

struct Writing {
  const Model& model;
  const double timestep;  ///< of the file, s
  const Trees trees;
  const Layout layout;
  const std::vector<HeldPoint> held;
  Report& report;
  Xml& xml;
};

/// The resistance and the bounds of a joint, or of a tendon, whose positions `shift` is added to. Into the element that
/// is open.
void write_resistance(const Joint& joint, double shift, Xml& xml, Report& report);

/// The time constant of the springs that hold what is hard here, s.
double time_constant(double timestep);
/// These springs. Into the element that is open.
void write_hardness(double timestep, Xml& xml);

/// Adds the sites that spatial tendons need and the model lacks.
void add_sites_of_tendons(Model& model);

// Each writes its sections, in this order, and reports what they lack.
void write_world(const Writing& writing);
void write_contacts(const Writing& writing);
void write_couplings(const Writing& writing);
void write_spatial_tendons(const Writing& writing);
void write_loops(const Writing& writing);
void write_actuators_and_start(const Writing& writing);

}  // namespace lockstep::exporter::mjcf
