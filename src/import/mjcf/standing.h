// What rests on colliders where a model starts. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "model/trees.h"

namespace lockstep::importer::mjcf {

/// By collider: the normal force on each of its points where its tree stands in its start on level ground, as on equal
/// springs, N: (M166). What does not stand there gets the mean over the points that do. Infinite where nothing can be
/// known: on trees that do not float, and without gravity.
std::vector<double> loads_at_rest(const Model& model, const Trees& trees);

}  // namespace lockstep::importer::mjcf
