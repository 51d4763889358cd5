// Closes the loops in the state of one environment. SPDX-License-Identifier: Apache-2.0
//
// (M134) for the positions, and for the velocities the least change that lets the loops stay closed. In double,
// whatever the state's precision is.
#pragma once

#include <vector>

#include "lockstep/batch.h"
#include "loop_state.h"

namespace lockstep {

class LoopCloser {
  static constexpr double nearly_the_same = 1e-5;  // the least singular value of rows, as a share of the largest

 public:
  explicit LoopCloser(const Model& model) : model_(model), trees_(model) {
    for (const Loop& loop : model.loops) loops_.push_back(placed(model, loop));
  }

  bool used() const { return !loops_.empty(); }
  const Trees& trees() const { return trees_; }

  /// Closes the loops that are `on`, beside the relations. `frames` are 7 numbers of Parameter::loop_frame for each
  /// loop, or none if the model's frames hold. Adds what does not close.
  template <class On>
  void close(int environment, double rounding, const std::vector<double>& frames, const On& on,
             const Relations& relations, LoopState& state, std::vector<UnmetCoupling>& unmet) const {
    std::vector<PlacedLoop> taken;
    std::vector<int> number;
    for (std::size_t l = 0; l < loops_.size(); ++l) {
      if (!on(static_cast<int>(l))) continue;
      taken.push_back(loops_[l]);
      number.push_back(static_cast<int>(l));
      if (!frames.empty()) taken.back().first_pose = frame(frames.data() + 7 * l, l);
    }
    if (taken.empty()) return;

    // Positions that are closed up to rounding stay.
    Eigen::VectorXd gaps = loop_gaps(model_, trees_, state.at, taken);
    if (!(gaps.cwiseAbs().maxCoeff() <= rounding)) gaps = close_loops(model_, trees_, taken, relations, state.at);

    // Velocities.
    const Eigen::Index joints = relations.rows.cols(), all = joints + 6 * trees_.count();
    Eigen::MatrixXd jacobian(gaps.size() + relations.rows.rows(), all);
    jacobian << loop_jacobian(model_, trees_, state.at, taken), relations.rows,
        Eigen::MatrixXd::Zero(relations.rows.rows(), all - joints);
    Eigen::VectorXd missing = jacobian * state.velocity;
    if (!(missing.cwiseAbs().maxCoeff() <= rounding)) {
      state.velocity -= least_norm(jacobian, missing, nearly_the_same);
      missing = jacobian * state.velocity;
    }

    // What is left. Bars that nearly say the same twice leave a motion that they nearly allow.
    const double conflict =
        nearly_the_same * jacobian.colwise().norm().maxCoeff() * state.velocity.cwiseAbs().maxCoeff();
    Eigen::Index row = 0;
    for (std::size_t l = 0; l < taken.size(); ++l) {
      const int rows = rows_of(taken[l].kind);
      const double error = gaps.segment(row, rows).norm(), speed = missing.segment(row, rows).norm();
      row += rows;
      if (!(error <= 10.0 * rounding) || !(speed <= std::max(10.0 * rounding, conflict)))
        unmet.push_back({environment, -1, error, speed, number[l]});
    }
  }

 private:
  Eigen::Isometry3d frame(const double* rows, std::size_t l) const {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    const Eigen::Quaterniond turn(rows[3], rows[4], rows[5], rows[6]);
    pose.translation() = Eigen::Vector3d(rows[0], rows[1], rows[2]);
    pose.linear() = turn.normalized().toRotationMatrix() * turn_to_axis(model_.loops[l]);
    return pose;
  }

  const Model& model_;
  Trees trees_;
  std::vector<PlacedLoop> loops_;
};

}  // namespace lockstep
