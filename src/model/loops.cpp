// Closing loops by least norm. SPDX-License-Identifier: Apache-2.0
#include "loops.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "joint_motion.h"
#include "rules.h"

namespace lockstep {
namespace {

constexpr int most_steps = 200;
constexpr double closed = 1e-13;  // m and rad
constexpr double noise = 1e-6;    // what a step must gain at least, as a share of what its motion could

struct Frames {
  Eigen::Isometry3d first, second;  // in the world
};

Frames frames_of(const PlacedLoop& loop, const std::vector<Eigen::Isometry3d>& poses) {
  const auto in_world = [&](int link, const Eigen::Isometry3d& pose) -> Eigen::Isometry3d {
    return link < 0 ? pose : Eigen::Isometry3d(poses[static_cast<std::size_t>(link)] * pose);
  };
  return {in_world(loop.first, loop.first_pose), in_world(loop.second, loop.second_pose)};
}

// The shortest turn from one z to the other for a hinge, the whole turn for others: 2 sin(angle / 2) along its axis, in
// the axes of the first frame.
Eigen::Vector3d turn_between(LoopKind kind, const Frames& frames) {
  const Eigen::Matrix3d turn = frames.first.linear().transpose() * frames.second.linear();
  Eigen::Quaterniond q(turn);
  if (kind == LoopKind::hinge) q = shortest_turn(Eigen::Vector3d::UnitZ(), turn.col(2));
  return (q.w() < 0.0 ? -2.0 : 2.0) * q.vec();
}

// Adds a motion of the loop's bodies against each other to the rows of a column.
void add_motion(LoopKind kind, const Frames& frames, const Eigen::Vector3d& turning, const Eigen::Vector3d& moving,
                Eigen::Ref<Eigen::VectorXd> rows) {
  const Eigen::Matrix3d axes = frames.first.linear().transpose();
  rows.head(translations_of(kind)) += (axes * moving).head(translations_of(kind));
  rows.tail(rotations_of(kind)) += (axes * turning).head(rotations_of(kind));
}

int count_rows(const std::vector<PlacedLoop>& loops) {
  int rows = 0;
  for (const PlacedLoop& loop : loops) rows += rows_of(loop.kind);
  return rows;
}

void move(const Model& model, const Trees& trees, const Eigen::VectorXd& step, Configuration& at) {
  const auto joints = static_cast<Eigen::Index>(at.position.size());
  for (Eigen::Index j = 0; j < joints; ++j) {
    double* const position = &at.position[static_cast<std::size_t>(j)];
    if (model.joints[static_cast<std::size_t>(j)].kind != JointKind::ball) {
      *position += step[j];
      continue;
    }
    Eigen::Map<Eigen::Vector3d> turn(position);  // the step is along the child's axes
    turn = rotation_vector(turned_by(turn) * turned_by(step.segment<3>(j)));
    j += 2;
  }
  for (int tree = 0; tree < trees.count(); ++tree) {
    if (!trees.roots[tree].floating) continue;
    Eigen::Isometry3d& pose = at.root[tree];
    const Eigen::Vector3d turn = step.segment<3>(joints + 6 * tree);
    pose.linear() = (turned_by(turn) * Eigen::Quaterniond(pose.linear())).normalized().toRotationMatrix();
    pose.translation() += step.segment<3>(joints + 6 * tree + 3);
  }
}

// The link that carries this one by fixed joints; -1 for the world.
int carrier_of(const Model& model, const Trees& trees, const std::string& link) {
  return link.empty() ? -1 : trees.carrier[model.link_index(link)];
}

}  // namespace

int translations_of(LoopKind kind) { return kind == LoopKind::slider ? 2 : 3; }

int rotations_of(LoopKind kind) {
  switch (kind) {
    case LoopKind::point: return 0;
    case LoopKind::hinge: return 2;
    default: return 3;
  }
}

Eigen::Matrix3d turn_to_axis(const Loop& loop) {
  if (loop.kind != LoopKind::hinge && loop.kind != LoopKind::slider) return Eigen::Matrix3d::Identity();
  return shortest_turn(Eigen::Vector3d::UnitZ(), loop.axis).toRotationMatrix();
}

void proper_loop(const Model& model, const Trees& trees, const Loop& loop) {
  const std::string element = quoted("loop", loop.name);
  require(loop.kind >= LoopKind::point && loop.kind <= LoopKind::weld, element, "is of none of the kinds",
          "give one of LoopKind");
  for (const std::string& link : {loop.first, loop.second})
    require(link.empty() ||
                std::any_of(model.links.begin(), model.links.end(), [&](const Link& l) { return l.name == link; }),
            element, "holds link '" + link + "', which does not exist", "correct the name");
  require(!loop.first.empty() || !loop.second.empty(), element, "holds the world to itself",
          "name a link; the world is for one of the two");
  rigid(loop.first_pose, element, "first pose");
  rigid(loop.second_pose, element, "second pose");
  if (loop.kind == LoopKind::hinge || loop.kind == LoopKind::slider) {
    finite(loop.axis, element, "axis");
    require(loop.axis.norm() > 1e-9, element, "axis has no length", "give a direction such as 0 0 1");
  }
  proper_softness(loop.softness, element, "loop");
  require(!is_absent(loop.softness), element,
          "has a softness with neither stiffness nor damping: it would hold nothing",
          "give it stiffness or damping, or remove it, or switch it off by Parameter::loop_switch");
  require(!is_hard(loop.softness) || (erp_of(loop.softness) > 0.0 && erp_of(loop.softness) <= 1.0), element,
          "erp of the hard loop is outside (0, 1]", "give 1 to close it in each step, less to approach that");
  require(loop.force_limit > 0.0, element, "force limit is not above 0", "give more than 0, infinity for no limit");
  require(loop.torque_limit > 0.0, element, "torque limit is not above 0", "give more than 0, infinity for no limit");

  // Two bodies that can move against each other.
  require(carrier_of(model, trees, loop.first) != carrier_of(model, trees, loop.second), element,
          "holds two links of one rigid body, '" + loop.first + "' and '" + loop.second + "'",
          "name links that a moving joint parts");
  require(can_move(model, trees, loop.first, loop.second), element,
          "holds two links that both stand still in the world", "name a link that moves");
}

bool can_move(const Model& model, const Trees& trees, const std::string& first, const std::string& second) {
  const auto body = [&](const std::string& link) {
    const int own = carrier_of(model, trees, link);
    return own < 0 || trees.is_bolted(own) ? -1 : own;
  };
  return body(first) != body(second);
}

PlacedLoop placed(const Model& model, const Loop& loop) {
  const auto index = [&](const std::string& link) { return link.empty() ? -1 : model.link_index(link); };
  PlacedLoop result{loop.kind, index(loop.first), index(loop.second), Eigen::Isometry3d(loop.first_pose),
                    Eigen::Isometry3d(loop.second_pose)};
  const Eigen::Matrix3d turn = turn_to_axis(loop);
  result.first_pose.rotate(turn), result.second_pose.rotate(turn);
  return result;
}

Eigen::VectorXd loop_gaps(const Model& model, const Trees& trees, const Configuration& at,
                          const std::vector<PlacedLoop>& loops) {
  const std::vector<Eigen::Isometry3d> poses = link_poses(model, trees, at);
  Eigen::VectorXd gaps = Eigen::VectorXd::Zero(count_rows(loops));
  Eigen::Index row = 0;
  for (const PlacedLoop& loop : loops) {
    const Frames frames = frames_of(loop, poses);
    const Eigen::Vector3d between = frames.first.linear() * turn_between(loop.kind, frames);
    add_motion(loop.kind, frames, between, frames.second.translation() - frames.first.translation(),
               gaps.segment(row, rows_of(loop.kind)));
    row += rows_of(loop.kind);
  }
  return gaps;
}

Eigen::MatrixXd loop_jacobian(const Model& model, const Trees& trees, const Configuration& at,
                              const std::vector<PlacedLoop>& loops) {
  const std::vector<Eigen::Isometry3d> poses = link_poses(model, trees, at);
  const auto joints = static_cast<Eigen::Index>(model.joints.size());
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(count_rows(loops), joints + 6 * trees.count());
  Eigen::Index row = 0;
  for (const PlacedLoop& loop : loops) {
    const Frames frames = frames_of(loop, poses);
    const int rows = rows_of(loop.kind);
    const Eigen::Vector3d point = frames.second.translation();
    for (const bool second : {true, false}) {
      const int end = second ? loop.second : loop.first;
      const double sign = second ? 1.0 : -1.0;
      if (end < 0) continue;
      each_motion(model, trees, poses, end, point,
                  [&](Eigen::Index column, const Eigen::Vector3d& turning, const Eigen::Vector3d& moving) {
                    add_motion(loop.kind, frames, sign * turning, sign * moving,
                               jacobian.col(column).segment(row, rows));
                  });
    }
    row += rows;
  }
  return jacobian;
}

Eigen::VectorXd least_norm(const Eigen::MatrixXd& jacobian, const Eigen::VectorXd& missing, double threshold) {
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> factored;
  factored.setThreshold(threshold);
  return factored.compute(jacobian).solve(missing);
}

Eigen::VectorXd close_loops(const Model& model, const Trees& trees, const std::vector<PlacedLoop>& loops,
                            const Relations& relations, Configuration& at) {
  const auto joints = static_cast<Eigen::Index>(model.joints.size()), rows = Eigen::Index{count_rows(loops)};
  const auto misses = [&](const Configuration& here) {
    Eigen::VectorXd all(rows + relations.rows.rows());
    all.head(rows) = loop_gaps(model, trees, here, loops);
    all.tail(relations.rows.rows()) =
        relations.rows * Eigen::Map<const Eigen::VectorXd>(here.position.data(), joints) + relations.offset;
    return all;
  };
  Eigen::VectorXd error = misses(at);
  double damping = 0.0;  // of the least-norm step, where a step along it does not help
  for (int step = 0; step < most_steps && error.cwiseAbs().maxCoeff() > closed; ++step) {
    Eigen::MatrixXd jacobian(error.size(), joints + 6 * trees.count());
    jacobian << loop_jacobian(model, trees, at, loops), relations.rows,
        Eigen::MatrixXd::Zero(relations.rows.rows(), 6 * trees.count());
    Eigen::VectorXd change;
    if (damping == 0.0) {
      change = -least_norm(jacobian, error, 1e-9);
    } else {
      const Eigen::MatrixXd damped =
          jacobian * jacobian.transpose() + damping * Eigen::MatrixXd::Identity(error.size(), error.size());
      change = -jacobian.transpose() * damped.ldlt().solve(error);
    }
    Configuration next = at;
    move(model, trees, change, next);
    const Eigen::VectorXd reached = misses(next);
    // Bars that nearly say the same twice miss each other by what files round off: a step along that is noise.
    const double least_gain = noise * jacobian.colwise().norm().maxCoeff() * change.norm();
    if (error.norm() - reached.norm() > least_gain) {
      at = std::move(next), error = reached;
      damping = damping < 1e-12 ? 0.0 : 0.1 * damping;
    } else {
      if (damping > 1e6) break;
      damping = damping == 0.0 ? 1e-6 : 10.0 * damping;
    }
  }
  return error.head(rows);
}

}  // namespace lockstep
