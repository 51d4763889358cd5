// The state of one environment as the closing of loops sees it. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "environment.h"
#include "model/loops.h"

namespace lockstep {

/// Positions and velocities, by joint of the model and by tree.
struct LoopState {
  Configuration at;
  Eigen::VectorXd velocity;  ///< of the joints, then an angular velocity and a velocity in the world by tree
};

/// act(joint of the model, its place in LoopState::velocity, its number in the tables): joints that a loop can move.
template <class Act>
void each_loop_joint(const Program& program, const Act& act) {
  for (std::size_t j = 0; j < program.model.joints.size(); ++j)
    if (program.solver_joint[j] >= 0 && program.model.joints[j].kind != JointKind::tendon)
      act(j, static_cast<Eigen::Index>(j), program.solver_joint[j]);
}

/// act(tree, the place of its root's six in LoopState::velocity, its row of root poses): trees that float.
template <class Act>
void each_loop_root(const Program& program, const Trees& trees, const Act& act) {
  int row = 0;
  for (int tree = 0; tree < trees.count(); ++tree)
    if (trees.roots[tree].floating) act(tree, static_cast<Eigen::Index>(program.model.joints.size()) + 6 * tree, row++);
}

template <class S>
LoopState loop_state(const Program& program, const Trees& trees, const StatePointers<S>& rows, int e) {
  const Model& model = program.model;
  const Environment<S> positions{program.f64, rows, e, true, model}, velocities{program.f64, rows, e, false, model};
  LoopState state{start_of(model, trees),
                  Eigen::VectorXd::Zero(static_cast<Eigen::Index>(model.joints.size()) + 6 * trees.count())};
  each_loop_joint(program, [&](std::size_t j, Eigen::Index column, int joint) {
    state.at.position[j] = positions.number(joint);
    state.velocity[column] = velocities.number(joint);
  });
  each_loop_root(program, trees, [&](int tree, Eigen::Index column, int row) {
    const auto number = [&](const S* of, int k) { return static_cast<double>(of[k * rows.stride + e]); };
    const S* const place = rows.root_pose + 7 * row * rows.stride;
    Eigen::Isometry3d& pose = state.at.root[tree];
    for (int k = 0; k < 3; ++k) pose.translation()[k] = number(place, k);
    pose.linear() = Eigen::Quaterniond(number(place, 3), number(place, 4), number(place, 5), number(place, 6))
                        .normalized()
                        .toRotationMatrix();
    for (int half = 0; half < 2; ++half) {
      Eigen::Vector3d own;
      for (int k = 0; k < 3; ++k) own[k] = number(rows.root_velocity + (6 * row + 3 * half) * rows.stride, k);
      state.velocity.segment<3>(column + 3 * half) = pose.linear() * own;
    }
  });
  return state;
}

/// Writes what differs from `before`. Returns whether anything does.
template <class S>
bool put_loop_state(const Program& program, const Trees& trees, const LoopState& before, const LoopState& state,
                    const StatePointers<S>& rows, int e) {
  const Environment<S> positions{program.f64, rows, e, true, program.model},
      velocities{program.f64, rows, e, false, program.model};
  bool moved = false;
  each_loop_joint(program, [&](std::size_t j, Eigen::Index column, int joint) {
    if (state.at.position[j] != before.at.position[j]) positions.put(joint, state.at.position[j]), moved = true;
    if (state.velocity[column] != before.velocity[column]) velocities.put(joint, state.velocity[column]), moved = true;
  });
  each_loop_root(program, trees, [&](int tree, Eigen::Index column, int row) {
    const auto put = [&](S* to, int k, double number) { to[k * rows.stride + e] = static_cast<S>(number); };
    S* const place = rows.root_pose + 7 * row * rows.stride;
    const Eigen::Isometry3d& pose = state.at.root[tree];
    if (!pose.isApprox(before.at.root[tree], 0.0)) {
      moved = true;
      const Eigen::Quaterniond turn(pose.linear());
      for (int k = 0; k < 3; ++k) put(place, k, pose.translation()[k]);
      put(place, 3, turn.w());
      for (int k = 0; k < 3; ++k) put(place, 4 + k, turn.vec()[k]);
    }
    if (state.velocity.segment<6>(column) == before.velocity.segment<6>(column)) return;
    moved = true;
    for (int half = 0; half < 2; ++half) {
      const Eigen::Vector3d own = pose.linear().transpose() * state.velocity.segment<3>(column + 3 * half);
      for (int k = 0; k < 3; ++k) put(rows.root_velocity + (6 * row + 3 * half) * rows.stride, k, own[k]);
    }
  });
  return moved;
}

}  // namespace lockstep
