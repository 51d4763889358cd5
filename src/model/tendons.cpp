// SPDX-License-Identifier: Apache-2.0
#include "tendons.h"

namespace lockstep {

bool has_slack_spring(const Joint& joint) {
  return joint.kind == JointKind::tendon && !is_hard(joint.limit_softness) &&
         (joint.lower > -infinity || joint.upper < infinity);
}

void place_tendons(Model& model) {
  for (const Coupling& coupling : model.couplings) {
    Joint& tendon = model.joints[static_cast<std::size_t>(model.joint_index(coupling.joint))];
    if (tendon.kind != JointKind::tendon) continue;
    tendon.position = -coupling.offset;
    tendon.velocity = 0.0;
    for (const CouplingTerm& term : coupling.terms) {
      const Joint& joint = model.joints[static_cast<std::size_t>(model.joint_index(term.joint))];
      tendon.position -= term.ratio * joint.position;
      tendon.velocity -= term.ratio * joint.velocity;
    }
  }
}

}  // namespace lockstep
