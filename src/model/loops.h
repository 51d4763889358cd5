// Loops of a Model: where their frames are, by how much they miss each other, and the closest pose that closes them.
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "configuration.h"
#include "lockstep/model.h"

namespace lockstep {

/// Rows that hold the origins, and rows that hold the directions, along the axes of the first frame. A slider has none
/// along its axis, the last one; a hinge has none about it.
int translations_of(LoopKind kind);
int rotations_of(LoopKind kind);
inline int rows_of(LoopKind kind) { return translations_of(kind) + rotations_of(kind); }

/// A turn that brings z along the axis of a hinge or a slider; none for the others.
Eigen::Matrix3d turn_to_axis(const Loop& loop);

/// Throws ModelError for the first rule that the loop breaks.
void proper_loop(const Model& model, const Trees& trees, const Loop& loop);

/// Whether the bodies of two links, or of a link and the world, can move against each other. An empty name is the
/// world.
bool can_move(const Model& model, const Trees& trees, const std::string& first, const std::string& second);

/// A loop in one environment.
struct PlacedLoop {
  LoopKind kind;
  int first, second;                          ///< links, -1 for the world
  Eigen::Isometry3d first_pose, second_pose;  ///< with z along the axis
};
PlacedLoop placed(const Model& model, const Loop& loop);

/// (M130): what the rows miss, m and rad. Length: the rows of all loops.
Eigen::VectorXd loop_gaps(const Model& model, const Trees& trees, const Configuration& at,
                          const std::vector<PlacedLoop>& loops);

/// How fast the gaps change with the joints of the model, and then, by tree, with an angular velocity and a velocity
/// of its root in the world; zero for fixed joints, tendons and bolted roots.
Eigen::MatrixXd loop_jacobian(const Model& model, const Trees& trees, const Configuration& at,
                              const std::vector<PlacedLoop>& loops);

/// Linear relations of the joints' positions that hold beside the loops: rows * position + offset = 0.
struct Relations {
  Eigen::MatrixXd rows;  ///< [relations][joints of the model]
  Eigen::VectorXd offset;
};

/// The least x of those that come as near to jacobian x = missing as any can. Singular values below `threshold`, as
/// shares of the largest, count as zero. A function of its own because the decomposition takes long to compile.
Eigen::VectorXd least_norm(const Eigen::MatrixXd& jacobian, const Eigen::VectorXd& missing, double threshold);

/// (M134): moves to the closest pose that closes the loops and keeps the relations, by damped least-norm steps.
/// Returns what the rows miss there, in the order of loop_gaps().
Eigen::VectorXd close_loops(const Model& model, const Trees& trees, const std::vector<PlacedLoop>& loops,
                            const Relations& relations, Configuration& at);

}  // namespace lockstep
