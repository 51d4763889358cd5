// Rows of closed loops, and the closest pose that closes them. SPDX-License-Identifier: Apache-2.0
#include "loops.h"

#include <cmath>
#include <stdexcept>

#include "couplings.h"
#include "nearest.h"

namespace lockstep::reference {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr int most_closing_steps = 100;

Matrix3d cross_matrix(const Vector3d& a) {
  Matrix3d matrix;
  matrix << 0, -a[2], a[1], a[2], 0, -a[0], -a[1], a[0], 0;
  return matrix;
}

// The shortest turn that takes z to a direction.
Matrix3d z_to(const Vector3d& direction) {
  const Vector3d to = direction.normalized();
  if (to.z() < -1.0 + 1e-12) return Vector3d(1, -1, -1).asDiagonal();
  const Matrix3d k = cross_matrix(Vector3d::UnitZ().cross(to));
  return Matrix3d::Identity() + k + k * k / (1.0 + to.z());
}

// One side of a loop, in world axes.
struct End {
  Matrix3d axes;
  Vector3d place;
  MatrixXd jacobian;                // [6][velocities] of the frame
  Vector6d velocity, acceleration;  // the latter of constant v
};

End end_of(const Mechanism& mechanism, const State& state, const std::string& link, const Pose& pose,
           const Matrix3d& turn) {
  const Isometry3d frame(pose);
  End end{frame.linear() * turn, frame.translation(), MatrixXd::Zero(6, mechanism.velocities()), Vector6d::Zero(),
          Vector6d::Zero()};
  if (link.empty()) return end;
  const int l = mechanism.model().link_index(link);
  const Isometry3d at = mechanism.link_poses(state)[static_cast<std::size_t>(l)];
  end.axes = at.linear() * end.axes;
  end.jacobian = mechanism.jacobian(state, l, end.place);
  end.velocity = end.jacobian * state.v;
  end.acceleration = mechanism.acceleration(state, l, end.place);
  end.place = at * end.place;
  return end;
}

// 2 sin(angle / 2) along the axis of a turn. Half of R - R^T is sin(angle) along it, and 1 + trace R is
// 4 cos^2(angle / 2).
Vector3d turn_vector(const Matrix3d& turn) {
  return Vector3d(turn(2, 1) - turn(1, 2), turn(0, 2) - turn(2, 0), turn(1, 0) - turn(0, 1)) /
         std::sqrt(1.0 + turn.trace());
}

// All six rows of a loop: 0 to 2 origins, 3 to 5 directions.
struct SixRows {
  Vector6d error, bias;
  MatrixXd jacobian;
};

SixRows six_rows(const Loop& loop, const End& first, const End& second) {
  const Matrix3d in_first = first.axes.transpose();
  const Vector3d d = second.place - first.place;
  SixRows rows;
  const Matrix3d turn = in_first * second.axes;
  rows.error << in_first * d, turn_vector(loop.kind == LoopKind::hinge ? z_to(turn.col(2)) : turn);

  // d/dt (R^T x) = R^T (dx/dt - w x x), with the first frame's R and w.
  const auto turning = [&](const auto& all) { return all.template topRows<3>(); };
  const auto moving = [&](const auto& all) { return all.template bottomRows<3>(); };
  rows.jacobian.resize(6, first.jacobian.cols());
  rows.jacobian << in_first *
                       (moving(second.jacobian) - moving(first.jacobian) + cross_matrix(d) * turning(first.jacobian)),
      in_first * (turning(second.jacobian) - turning(first.jacobian));
  const Vector3d w = first.velocity.head<3>(), relative = second.velocity.head<3>() - w,
                 rate = second.velocity.tail<3>() - first.velocity.tail<3>(),
                 change = second.acceleration.tail<3>() - first.acceleration.tail<3>();
  const Vector3d turned = first.acceleration.head<3>();
  rows.bias << in_first * (change - turned.cross(d) - 2.0 * w.cross(rate) + w.cross(w.cross(d))),
      in_first * (second.acceleration.head<3>() - turned - w.cross(relative));
  return rows;
}

std::vector<int> rows_that_hold(LoopKind kind) {
  switch (kind) {
    case LoopKind::point: return {0, 1, 2};
    case LoopKind::hinge: return {0, 1, 2, 3, 4};
    case LoopKind::slider: return {0, 1, 3, 4, 5};
    case LoopKind::weld: return {0, 1, 2, 3, 4, 5};
  }
  throw std::logic_error("no kind of loop");
}

}  // namespace

LoopRows loop_rows(const Mechanism& mechanism, const State& state) {
  LoopRows all;
  const std::vector<Loop>& loops = mechanism.model().loops;
  std::vector<SixRows> six;
  std::vector<int> kept;  // by row: which of the six
  for (std::size_t i = 0; i < loops.size(); ++i) {
    const Loop& loop = loops[i];
    const bool has_axis = loop.kind == LoopKind::hinge || loop.kind == LoopKind::slider;
    const Matrix3d turn = has_axis ? z_to(loop.axis) : Matrix3d::Identity();
    six.push_back(six_rows(loop, end_of(mechanism, state, loop.first, loop.first_pose, turn),
                           end_of(mechanism, state, loop.second, loop.second_pose, turn)));
    for (const int row : rows_that_hold(loop.kind)) {
      all.loop.push_back(static_cast<int>(i));
      all.turns.push_back(row >= 3);
      kept.push_back(row);
    }
  }
  const auto count = static_cast<Eigen::Index>(kept.size());
  all.error.resize(count), all.bias.resize(count), all.jacobian.resize(count, mechanism.velocities());
  for (Eigen::Index row = 0; row < count; ++row) {
    const SixRows& of = six[all.loop[row]];
    all.error[row] = of.error[kept[row]], all.bias[row] = of.bias[kept[row]];
    all.jacobian.row(row) = of.jacobian.row(kept[row]);
  }
  return all;
}

State closed(const Mechanism& mechanism, const State& state) {
  const Couplings couplings(mechanism);
  std::vector<int> hard;
  for (int i = 0; i < couplings.count(); ++i)
    if (is_hard(couplings.softness[i])) hard.push_back(i);
  State at = state;
  double before = infinity;
  for (int step = 0; step < most_closing_steps; ++step) {
    const LoopRows loops = loop_rows(mechanism, at);
    VectorXd error(loops.error.size() + static_cast<Eigen::Index>(hard.size()));
    MatrixXd jacobian(error.size(), mechanism.velocities());
    error << loops.error, couplings.error(at.q)(hard);
    jacobian << loops.jacobian, couplings.velocity_jacobian()(hard, Eigen::all);
    // On, as long as steps help, to the rounding of the poses.
    const double now = error.norm();
    if (now == 0.0 || (now < 1e-12 && now >= 0.5 * before)) return at;
    before = now;
    at = mechanism.advanced(at, -least_norm(jacobian, error, 1e-9), 1.0);
  }
  throw std::logic_error("no pose near the start closes the loops");
}

}  // namespace lockstep::reference
