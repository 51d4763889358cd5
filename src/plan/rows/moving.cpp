// What moves two bodies against each other. SPDX-License-Identifier: Apache-2.0
#include "plan/layout.h"

namespace lockstep {
namespace {

// A joint's velocity, or one of a floating root's six, that moves one of two bodies and not the other.
struct MovingVelocity {
  int velocity, body, component;  // component: -1 for a joint
  int sign;
};

std::vector<MovingVelocity> chain_of(const Tables<double>& t, int body, int sign) {
  std::vector<MovingVelocity> chain;
  for (; body >= 0; body = t.body[body].parent) {
    const int first = t.body[body].velocity;
    for (int c = 0; t.body[body].root && c < 6; ++c) chain.push_back({first + c, body, c, sign});
    if (!t.body[body].root) chain.push_back({first, body, -1, sign});
  }
  return chain;
}

std::vector<MovingVelocity> moving(const Tables<double>& t, int first, int second) {
  std::map<int, MovingVelocity> all;
  for (const MovingVelocity& m : chain_of(t, second, 1)) all.emplace(m.velocity, m);
  for (const MovingVelocity& m : chain_of(t, first, -1))
    if (!all.emplace(m.velocity, m).second) all.erase(m.velocity);
  std::vector<MovingVelocity> list;
  for (const auto& [velocity, m] : all) list.push_back(m);
  return list;
}

Eigen::Isometry3d pose_of(const double (&rotation)[9], const double (&offset)[3]) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (int k = 0; k < 9; ++k) pose.matrix()(k / 3, k % 3) = rotation[k];
  for (int k = 0; k < 3; ++k) pose.matrix()(k, 3) = offset[k];
  return pose;
}

}  // namespace

BodyPlace place_of(const Program& program, const std::string& link, const Eigen::Isometry3d& own) {
  return place_of(program, link.empty() ? -1 : program.model.link_index(link), own);
}

BodyPlace place_of(const Program& program, int link_index, const Eigen::Isometry3d& own) {
  const Tables<double>& t = program.f64;
  if (link_index < 0) return {-1, own};
  const LinkPlace<double>& link = t.link[link_index];
  const Eigen::Isometry3d in_body = pose_of(link.rotation, link.offset) * own;
  if (link.body >= 0) return {link.body, in_body};
  const TreePlace<double>& tree = t.tree[link.tree];
  return {-1, pose_of(tree.rotation, tree.offset) * in_body};
}

void put_pose(const Eigen::Isometry3d& pose, double (&rotation)[9], double (&offset)[3]) {
  for (int k = 0; k < 9; ++k) rotation[k] = pose.linear()(k / 3, k % 3);
  for (int k = 0; k < 3; ++k) offset[k] = pose.translation()[k];
}

std::vector<int> velocities_between(const Tables<double>& t, int first, int second) {
  std::vector<int> velocities;
  for (const MovingVelocity& m : moving(t, first, second)) velocities.push_back(m.velocity);
  return velocities;
}

MovingColumns columns_between(const Program& program, const Forms& forms, int first, int second) {
  const Tables<double>& t = program.f64;
  MovingColumns columns;
  for (const MovingVelocity& m : moving(t, first, second)) {
    if (m.component >= 0) {
      if (const int z = forms.solver_of(m.velocity); z >= 0) columns[z].push_back({m.body, m.component, -1, m.sign});
      continue;
    }
    const RowForm form = forms.of_joint(t.body[m.body].joint);
    for (const auto& [z, contributions] : form.terms)
      for (const Contribution& c : contributions) columns[z].push_back({m.body, -1, c.value, m.sign});
  }
  return columns;
}

}  // namespace lockstep
