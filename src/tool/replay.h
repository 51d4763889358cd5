// Recordings that `simulate --record` wrote, read back. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "csv.h"
#include "lockstep/batch.h"
#include "view/motion.h"

namespace lockstep::tool {

/// The states of one environment over time.
struct Recording {
  std::vector<double> times;                  ///< s, ascending
  Table states;                               ///< by time: columns as in a file of start states
  std::optional<view::Track::Frozen> frozen;  ///< since when
};

/// From the columns of Recorder. The errors of couplings and the places of sites follow from the state and are not
/// kept. Throws InputError, with file and line, for other columns, for columns of the state that are not there, times
/// that do not ascend, and faults that are none.
Recording recording_of(Table table, const Plan& plan);

/// The motion of one recording or of several, which must have the same times, at about `rate` samples a second. Poses,
/// coupling errors and energies are computed from the recorded states by the library. Links that have `meshes` are
/// drawn as these.
view::Motion replay(const std::vector<Recording>& recordings, const Plan& plan, const std::vector<VisualMesh>& meshes,
                    double rate, int threads);

}  // namespace lockstep::tool
