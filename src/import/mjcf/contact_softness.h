// How soft contacts are in MuJoCo. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "limited.h"
#include "settings.h"

namespace lockstep::importer::mjcf {

/// What a geom says of its contacts.
struct GeomYielding {
  Yielding yielding = {};
  double mix = 1.0;  ///< solmix
  int priority = 0;
  double margin = 0.0;  ///< m
};
GeomYielding geom_yielding_of(const Element& geom);

/// Of the geom of higher priority, or of both by their shares: (M163).
Yielding mixed(const GeomYielding& a, const GeomYielding& b);

/// By MuJoCo's own numbers, so that contacts are lockstep's own, too.
bool is_default(const Yielding& yielding);

/// What the spring of a contact point depends on beside these numbers.
struct YieldingPoint {
  double response;        ///< of both bodies: the sum of their body_responses(), 1/kg
  double friction = 1.0;  ///< the first number
  int dimension = 3;      ///< condim
  double margin = 0.0;    ///< of both geoms, m
  double load;            ///< that rests on it, N; infinite where it is not known
};

/// (M164), (M165): the spring that sinks as far under the load as MuJoCo's, with the same damper, without its virtual
/// mass. Hard where nothing would sink.
Softness softness_of(const Yielding& yielding, const YieldingPoint& point, const SolverSettings& solver);

}  // namespace lockstep::importer::mjcf
