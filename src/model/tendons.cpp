// SPDX-License-Identifier: Apache-2.0
#include "tendons.h"

namespace lockstep {

bool has_slack_spring(const Joint& joint) {
  return joint.kind == JointKind::tendon && !is_hard(joint.limit_softness) &&
         (joint.lower > -infinity || joint.upper < infinity);
}

const Joint* tendon_of(const Coupling& coupling, const Model& model) {
  const Joint& follower = model.joints[static_cast<std::size_t>(model.joint_index(coupling.joint))];
  return follower.kind == JointKind::tendon ? &follower : nullptr;
}

void place_tendons(Model& model) {
  for (const Coupling& coupling : model.couplings) {
    if (!tendon_of(coupling, model)) continue;
    Joint& tendon = model.joints[static_cast<std::size_t>(model.joint_index(coupling.joint))];
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
