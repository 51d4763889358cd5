// The sections of a file. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "bodies.h"
#include "export/xml.h"

namespace lockstep::exporter::mjcf {

struct Writing {
  const Model& model;
  const MjcfOptions& options;
  const Trees trees;
  const Layout layout;
  Report& report;
  Xml& xml;
};

/// The resistance and the bounds of a joint, or of a tendon, whose positions `shift` is added to. Into the element that
/// is open.
void write_resistance(const Joint& joint, double shift, Xml& xml, Report& report);

// Each writes its sections, in this order, and reports what they lack.
void write_world(const Writing& writing);
void write_contacts(const Writing& writing);
void write_couplings(const Writing& writing);
void write_actuators_and_start(const Writing& writing);

}  // namespace lockstep::exporter::mjcf
