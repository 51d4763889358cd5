// The mechanisms of the stability tests. SPDX-License-Identifier: Apache-2.0
#include "mechanisms.h"

#include "physics.h"
#include "scenes/scenes.h"

namespace lockstep::stability {

Model star(int followers, const std::string& carrier) {
  Model model;
  model.links = {{"base", {}}};
  physics::append_link(model, "base", {0, 0, 0}, Eigen::Vector3d::UnitY()).drive = {10.0, 1.0, 0.5, 0.0};
  for (int i = 0; i < followers; ++i) {
    Joint& joint = physics::append_link(model, carrier, {0.1, 0.05 * i, 0}, Eigen::Vector3d::Unit(i % 3), 0.05);
    joint.position = 1.0;
    joint.damping = 1e-3;
    model.couplings.push_back(Coupling::mimic(joint.name, "j0", i % 2 == 0 ? -1.0 : 0.5));
  }
  return model;
}

Model serial() {
  Model model;
  model.links = {{"base", {}}};
  for (int i = 0; i < 17; ++i) {
    Joint& joint = physics::append_link(model, i == 0 ? "base" : model.links.back().name, {i == 0 ? 0.0 : 0.1, 0, 0},
                                        Eigen::Vector3d::UnitY());
    joint.position = i % 2 == 0 ? 0.5 : -0.5;
    joint.damping = 0.05;
    if (i > 0) model.couplings.push_back(Coupling::mimic(joint.name, model.joints[i - 1].name, -1.0));
  }
  return model;
}

Model geared(double ratio) {
  Model model = scenes::chain8();
  for (Joint& joint : model.joints) joint.position = 0.0;
  for (Coupling& coupling : model.couplings) {
    coupling.terms[0].ratio = -ratio;
    model.joints[static_cast<std::size_t>(model.joint_index(coupling.joint))].position = 1.0;
  }
  return model;
}

Model with_masses(const std::function<double(int)>& mass) {
  Model model = scenes::chain8();
  for (int i = 0; i < 8; ++i) {
    model.links[i + 1].inertia = physics::link_box(mass(i));
    model.joints[i].damping *= mass(i) / 0.2;
    model.joints[i].position = i % 4 < 2 ? 0.8 : -0.2;
  }
  return model;
}

Model turning() {
  Model model;
  model.links = {{"base", {}}};
  for (int i = 0; i < 2; ++i) {
    Joint& joint = physics::append_link(model, "base", {0, 0.3 * i, 0}, Eigen::Vector3d::UnitZ());
    joint.kind = JointKind::continuous;
    joint.damping = 0.01;
  }
  model.joints[1].effort = 1.0;
  model.couplings = {Coupling::mimic("j0", "j1", -2.0)};
  return model;
}

Model pair(Arrangement arrangement, double ratio) {
  const bool stacked = arrangement == Arrangement::second_on_first;
  Model model;
  model.links = {{"base", {}}};
  physics::append_link(model, "base", {0, 0, 0}, Eigen::Vector3d::UnitY());
  physics::append_link(model, stacked ? "l0" : "base", {stacked ? 0.1 : 0.0, 0.3, 0}, Eigen::Vector3d::UnitY());
  for (Joint& joint : model.joints) joint.damping = 0.01;
  model.couplings = {Coupling::mimic("j0", "j1", ratio)};
  return model;
}

Model sliding(int sliders) { return physics::sliders(std::vector<double>(static_cast<std::size_t>(sliders), 1.0)); }

Model loop(double offset) {
  Model model = scenes::redundant();
  model.couplings[2].offset = offset;
  return model;
}

double height_range(const Model& model) {
  double sum = 0.0;
  std::vector<double> reach(model.links.size(), 0.0);
  for (const Joint& joint : model.joints) {  // down the tree
    const auto child = static_cast<std::size_t>(model.link_index(joint.child));
    reach[child] = reach[static_cast<std::size_t>(model.link_index(joint.parent))] + joint.origin.translation().norm();
    const Inertia& inertia = model.links[child].inertia;
    sum += 2.0 * model.gravity.norm() * inertia.mass * (reach[child] + inertia.center.norm());
  }
  return sum;
}

}  // namespace lockstep::stability
