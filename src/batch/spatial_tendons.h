// Spatial tendons of one environment, in double, whatever the state's precision is. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "loop_state.h"
#include "model/tendons.h"

namespace lockstep {

/// act(joint of the tables, length, how it changes with LoopState::velocity, state): by tendon.
template <class S, class Act>
void each_spatial_tendon(const Program& program, const Trees& trees, const StatePointers<S>& rows, int e,
                         const Act& act) {
  if (!program.f64.spatial.used()) return;
  const LoopState state = loop_state(program, trees, rows, e);
  for (std::size_t j = 0; j < program.model.joints.size(); ++j) {
    const Joint& joint = program.model.joints[j];
    if (!is_spatial(joint)) continue;
    const Eigen::RowVectorXd jacobian = length_jacobian(program.model, trees, state.at, joint);
    act(program.solver_joint[j], length_of(program.model, trees, state.at, joint), jacobian, state);
  }
}

}  // namespace lockstep
