// Couplings as linear relations of a model's joints, beside its loops. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "model/loops.h"
#include "program.h"

namespace lockstep {

/// Of the couplings that takes(coupling), but for those that place a tendon. ratio(coupling, term) and
/// offset(coupling) are the numbers that hold.
template <class Takes, class Ratio, class Offset>
Relations relations_of(const Program& program, const Takes& takes, const Ratio& ratio, const Offset& offset) {
  const Tables<double>& t = program.f64;
  const auto joints = static_cast<Eigen::Index>(program.model.joints.size());
  std::vector<Eigen::Index> joint_of(static_cast<std::size_t>(t.joints));
  for (Eigen::Index j = 0; j < joints; ++j)
    if (const int i = program.solver_joint[static_cast<std::size_t>(j)]; i >= 0)
      joint_of[static_cast<std::size_t>(i)] = j;
  std::vector<int> taken;
  for (int c = 0; c < t.couplings; ++c)
    if (!places_tendon(t, c) && takes(c)) taken.push_back(c);
  const auto count = static_cast<Eigen::Index>(taken.size());
  Relations relations{Eigen::MatrixXd::Zero(count, joints), Eigen::VectorXd::Zero(count)};
  for (Eigen::Index r = 0; r < count; ++r) {
    const int c = taken[static_cast<std::size_t>(r)];
    for (int k = t.term_start[c]; k < t.term_start[c + 1]; ++k)
      relations.rows(r, joint_of[static_cast<std::size_t>(t.term_joint[k])]) += ratio(c, k);
    relations.offset[r] = offset(c);
  }
  return relations;
}

}  // namespace lockstep
