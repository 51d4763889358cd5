// The mass matrix of the drawn pose, in world axes. SPDX-License-Identifier: Apache-2.0
#include "start_inertia.h"

#include <Eigen/Dense>
#include <Eigen/Sparse>
#include <limits>

namespace lockstep::importer::mjcf {
namespace {

using Eigen::Vector3d;

// A direction of motion of a body and of all that it carries, about the world's origin.
struct Direction {
  Vector3d angular, linear;
  double armature;
};

struct Directions {
  std::vector<Direction> all;
  std::vector<std::vector<int>> of_body;  // those of the bodies that carry it, too
  std::vector<int> of_joint;              // by joint of the scene: its direction, -1 for free joints
};

Directions directions(const Scene& scene) {
  Directions result;
  const std::vector<Body>& bodies = scene.bodies.all;
  result.of_body.resize(bodies.size());
  for (std::size_t b = 1; b < bodies.size(); ++b) {
    const Eigen::Isometry3d& pose = bodies[b].in_world;
    result.of_body[b] = result.of_body[static_cast<std::size_t>(bodies[b].parent)];
    const auto add = [&](const Direction& direction) {
      result.of_body[b].push_back(static_cast<int>(result.all.size()));
      result.all.push_back(direction);
    };
    const auto turn = [&](const Vector3d& axis, const Vector3d& anchor, double armature) {
      add({axis, anchor.cross(axis), armature});
    };
    for (const JointPart& joint : bodies[b].joints) {
      const bool is_single = joint.type != JointType::free;
      result.of_joint.push_back(is_single ? static_cast<int>(result.all.size()) : -1);
      const Vector3d axis = pose.linear() * joint.axis, anchor = pose * joint.anchor;
      if (joint.type == JointType::hinge || joint.type == JointType::ball) turn(axis, anchor, joint.armature);
      if (joint.type == JointType::slide) add({Vector3d::Zero(), axis, joint.armature});
      for (int i = 0; i < 3 && joint.type == JointType::free; ++i)
        add({Vector3d::Zero(), Vector3d::Unit(i), joint.armature});
      for (int i = 0; i < 3 && !is_single; ++i) turn(pose.linear().col(i), anchor, joint.armature);
    }
  }
  return result;
}

// Calls use(i, j, share) for what each body adds to each element, below and on the diagonal.
template <class Use>
void each_share(const Scene& scene, const Directions& directions, bool is_diagonal, Use use) {
  for (std::size_t b = 1; b < scene.bodies.all.size(); ++b) {
    const Body& body = scene.bodies.all[b];
    const Vector3d center = body.in_world * body.inertia.center;
    const Eigen::Matrix3d tensor =
        body.in_world.linear() * body.inertia.about_center * body.in_world.linear().transpose();
    const auto share = [&](const Direction& x, const Direction& y) {
      return body.inertia.mass * (x.linear + x.angular.cross(center)).dot(y.linear + y.angular.cross(center)) +
             x.angular.dot(tensor * y.angular);
    };
    const std::vector<int>& own = directions.of_body[b];
    for (std::size_t i = 0; i < own.size(); ++i)
      for (std::size_t j = is_diagonal ? i : 0; j <= i; ++j)
        use(own[i], own[j],
            share(directions.all[static_cast<std::size_t>(own[i])], directions.all[static_cast<std::size_t>(own[j])]));
  }
}

Eigen::SparseMatrix<double> mass_matrix(const Scene& scene, const Directions& directions) {
  const auto size = static_cast<Eigen::Index>(directions.all.size());
  std::vector<Eigen::Triplet<double>> elements;
  for (int i = 0; i < size; ++i) elements.emplace_back(i, i, directions.all[static_cast<std::size_t>(i)].armature);
  each_share(scene, directions, false, [&](int i, int j, double share) {
    elements.emplace_back(i, j, share);
    if (i != j) elements.emplace_back(j, i, share);
  });
  Eigen::SparseMatrix<double> matrix(size, size);
  matrix.setFromTriplets(elements.begin(), elements.end());
  return matrix;
}

// MuJoCo's matrix has no places for directions of different branches.
void add_tendons(const Scene& scene, const Directions& directions, Eigen::MatrixXd& matrix) {
  const Bodies& bodies = scene.bodies;
  const auto body_of = [&](int joint) { return scene.joints[static_cast<std::size_t>(joint)].body; };
  for (const Tendon& tendon : scene.tendons)
    for (const auto& [one, factor] : tendon.length.terms)
      for (const auto& [other, another] : tendon.length.terms)
        if (tendon.armature > 0.0 &&
            (bodies.is_above(body_of(one), body_of(other)) || bodies.is_above(body_of(other), body_of(one))))
          matrix(directions.of_joint[static_cast<std::size_t>(one)],
                 directions.of_joint[static_cast<std::size_t>(other)]) += tendon.armature * factor * another;
}

std::vector<double> by_joint(const Directions& directions, const Eigen::VectorXd& values) {
  std::vector<double> result;
  for (const int direction : directions.of_joint)
    result.push_back(direction < 0 ? std::numeric_limits<double>::quiet_NaN() : values[direction]);
  return result;
}

}  // namespace

std::vector<double> locked_inertia(const Scene& scene) {
  const Directions motion = directions(scene);
  Eigen::VectorXd diagonal(static_cast<Eigen::Index>(motion.all.size()));
  for (std::size_t i = 0; i < motion.all.size(); ++i) diagonal[static_cast<Eigen::Index>(i)] = motion.all[i].armature;
  each_share(scene, motion, true, [&](int i, int, double share) { diagonal[i] += share; });
  return by_joint(motion, diagonal);
}

std::vector<double> free_inertia(const Scene& scene) {
  const Directions motion = directions(scene);
  Eigen::MatrixXd matrix(mass_matrix(scene, motion));
  add_tendons(scene, motion, matrix);
  const Eigen::MatrixXd inverse = matrix.ldlt().solve(Eigen::MatrixXd::Identity(matrix.rows(), matrix.cols()));
  return by_joint(motion, inverse.diagonal().cwiseInverse());
}

std::vector<double> body_responses(const Scene& scene) {
  const Directions motion = directions(scene);
  const Eigen::SparseMatrix<double> matrix = mass_matrix(scene, motion);
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factors(matrix);
  std::vector<double> responses;
  if (factors.info() != Eigen::Success)
    return std::vector<double>(scene.bodies.all.size(), std::numeric_limits<double>::quiet_NaN());
  for (std::size_t b = 0; b < scene.bodies.all.size(); ++b) {
    const Body& body = scene.bodies.all[b];
    const Vector3d center = body.in_world * body.inertia.center;
    Eigen::MatrixX3d speeds = Eigen::MatrixX3d::Zero(matrix.rows(), 3);
    for (const int i : motion.of_body[b]) {
      const Direction& direction = motion.all[static_cast<std::size_t>(i)];
      speeds.row(i) = direction.linear + direction.angular.cross(center);
    }
    const Eigen::MatrixX3d answers = factors.solve(speeds);
    responses.push_back(speeds.cwiseProduct(answers).sum() / 3.0);
  }
  return responses;
}

}  // namespace lockstep::importer::mjcf
