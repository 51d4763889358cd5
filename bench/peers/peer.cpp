// SPDX-License-Identifier: Apache-2.0
#include "peer.h"

#include <stdexcept>

namespace lockstep::peers {

void require_plain(const Model& model) {
  const auto require = [&](bool fits, const char* what) {
    if (!fits) throw std::invalid_argument("peers: model '" + model.name + "' has " + what);
  };
  for (const Link& link : model.links) {
    const Eigen::Matrix3d& tensor = link.inertia.about_center;
    require(tensor.isDiagonal(), "principal axes that are not the link's");
  }
  for (const Joint& joint : model.joints) {
    require(joint.kind == JointKind::revolute, "joints that are not revolute");
    require(joint.armature == 0.0 && joint.effort == 0.0 && joint.stiffness == 0.0, "armatures, efforts or springs");
    require(!joint.drive.kinematic && joint.drive.velocity_target == 0.0, "drives that are not plain servos");
    require(joint.lower == -infinity && joint.upper == infinity && joint.friction == 0.0, "bounds");
  }
  for (const Coupling& coupling : model.couplings)
    require(coupling.terms.size() == 1 && is_hard(coupling.softness),
            "couplings that are not hard mimics of one joint");
  require(model.roots.size() <= 1, "several trees");
  require(root_of(model).velocity.isZero(), "a root that moves at the start");
}

Root root_of(const Model& model) { return model.roots.empty() ? Root{model.links[0].name} : model.roots[0]; }

int joint_of_link(const Model& model, const std::string& link) {
  for (std::size_t j = 0; j < model.joints.size(); ++j)
    if (model.joints[j].child == link) return static_cast<int>(j);
  return -1;
}

}  // namespace lockstep::peers
