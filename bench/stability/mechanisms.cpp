// SPDX-License-Identifier: Apache-2.0
#include "mechanisms.h"

#include <algorithm>
#include <cmath>

#include "scenes/scenes.h"

namespace lockstep::stability {
namespace {

Joint& append(Model& model, const std::string& parent, const Eigen::Vector3d& offset, JointKind kind,
              const Eigen::Vector3d& axis, const Inertia& inertia) {
  const std::string number = std::to_string(model.joints.size());
  Joint joint;
  joint.name = "j" + number;
  joint.kind = kind;
  joint.parent = parent;
  joint.child = "l" + number;
  joint.origin.translation() = offset;
  joint.axis = axis;
  model.links.push_back({joint.child, inertia});
  model.joints.push_back(joint);
  return model.joints.back();
}

// A link of the scenes: 0.1 x 0.04 x 0.04 m.
Joint& append_bar(Model& model, const std::string& parent, const Eigen::Vector3d& offset, double mass) {
  Joint& joint = append(model, parent, offset, JointKind::revolute, Eigen::Vector3d::UnitY(),
                        Inertia::box(mass, {0.1, 0.04, 0.04}, {0.05, 0, 0}));
  joint.damping = 1e-3;
  return joint;
}

Model on_a_base() {
  Model model;
  model.links = {{"base", {}}};
  return model;
}

}  // namespace

Model hand(int followers) {
  Model model = on_a_base();
  append_bar(model, "base", Eigen::Vector3d::Zero(), 0.2).drive = {.kp = 1.0, .position_target = 0.5};
  for (int i = 0; i < followers; ++i) {
    append_bar(model, "base", {0.1, 0.05 * i, 0}, 0.2);
    model.couplings.push_back(Coupling::mimic(model.joints.back().name, "j0", i % 2 == 0 ? -1.0 : 0.5));
  }
  for (Joint& joint : model.joints) joint.damping = 1e-4;  // so little that it still moves at the end
  return model;
}

Model chain_of_couplings(int couplings) {
  Model model = on_a_base();
  for (int i = 0; i <= couplings; ++i) {
    append_bar(model, model.links.back().name, {i == 0 ? 0.0 : 0.1, 0, 0}, 0.2).position = i % 2 == 0 ? 0.3 : -0.3;
    if (i > 0) model.couplings.push_back(Coupling::mimic(model.joints[i].name, model.joints[i - 1].name, 1.0));
  }
  return model;
}

Model geared_arm(double gear_ratio, double mass_ratio) {
  Model model = scenes::chain8();
  const double slow = 0.3 / std::max(1.0, gear_ratio);
  for (Joint& joint : model.joints) joint.position = slow;
  for (Coupling& coupling : model.couplings) {
    coupling.terms[0].ratio = -gear_ratio;
    model.joints[model.joint_index(coupling.joint)].position = gear_ratio * slow;
  }
  double carried = 0.0;
  for (int i = 8; i > 0; --i) {
    Inertia& inertia = model.links[i].inertia;
    if (i > 4) inertia.mass *= mass_ratio, inertia.about_center *= mass_ratio;
    carried += inertia.mass;
    model.joints[i - 1].damping = 0.02 * carried / (0.2 * (9 - i));
  }
  return model;
}

Model damped_arm(double damping) {
  Model model = scenes::chain8();
  for (Joint& joint : model.joints) joint.damping = damping;
  return model;
}

Model driven_arm(double kp) {
  Model model = scenes::chain8();
  model.joints[0].drive = {.kp = kp, .kd = 1e-3 * kp};
  return model;
}

Model displaced_arm(double error) {
  Model model = scenes::chain8();
  for (const Coupling& coupling : model.couplings) model.joints[model.joint_index(coupling.joint)].position += error;
  return model;
}

Model soft_star(double frequency, double damping_ratio) {
  Model model = on_a_base();
  model.gravity.setZero();
  const Inertia inertia = Inertia::box(1.0, {0.1, 0.1, 0.1}, Eigen::Vector3d::Zero());
  const Softness softness = Frequency{2.0 * M_PI * frequency, damping_ratio};
  for (int i = 0; i < 5; ++i) {
    Joint& joint = append(model, "base", {0, 0.2 * i, 0}, JointKind::prismatic, Eigen::Vector3d::UnitX(), inertia);
    if (i > 0) model.couplings.push_back(Coupling::mimic(joint.name, "j0", -1.0, 0.0, softness));
  }
  model.joints[0].position = 0.1;
  return model;
}

}  // namespace lockstep::stability
