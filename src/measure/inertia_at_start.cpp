// SPDX-License-Identifier: Apache-2.0
#include "inertia_at_start.h"

#include <Eigen/Eigenvalues>
#include <cstddef>

#include "plan/layout.h"
#include "targets/reduced_matrix.h"

namespace lockstep {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// S over all velocities (M39).
MatrixXd all_shares(const Tables<double>& t) {
  const Reduction<double>& r = t.reduction;
  if (!r.used()) return MatrixXd::Identity(t.velocities, t.velocities);
  MatrixXd s = MatrixXd::Zero(t.velocities, t.solver.n);
  for (int z = 0; z < t.solver.n; ++z) s(r.independent[z], z) = 1.0;
  for (int f = 0; f < r.followers; ++f)
    for (int k = r.start[f]; k < r.start[f + 1]; ++k) s(t.velocity_of(r.follower[f]), r.column[k]) = r.value[k];
  return s;
}

// A_r of the tables at the model's start. `added` is added to the diagonal of A, by joint.
MatrixXd matrix_at_start(const Program& program, Tables<float> t, Span<float> added) {
  t.articulated = {};
  std::vector<TreePlace<float>> trees(t.tree.data, t.tree.data + t.tree.count);  // A of all of them
  for (TreePlace<float>& tree : trees)
    if (tree.inertia == InertiaKind::articulated_bodies) tree.inertia = InertiaKind::matrix;
  t.tree.data = trees.data();
  t.makes_matrix = true;
  std::vector<float> q(static_cast<std::size_t>(t.joints)), packed(static_cast<std::size_t>(t.solver.entries));
  for (std::size_t j = 0; j < program.model.joints.size(); ++j)
    if (const int i = program.solver_joint[j]; i >= 0) q[i] = static_cast<float>(program.model.joints[j].position);
  std::vector<std::max_align_t> scratch(reduced_matrix_bytes(t) / sizeof(std::max_align_t) + 1);
  reduced_matrix(t, q.data(), added.data, packed.data(), scratch.data());
  MatrixXd a = MatrixXd::Zero(t.solver.n, t.solver.n);
  for (int i = 0; i < t.solver.n; ++i)
    for (int j = 0; j <= i; ++j)
      if (const int entry = entry_of(t.solver, i, j); entry >= 0) a(i, j) = a(j, i) = packed[entry];
  return a;
}

// A itself, over all velocities.
MatrixXd unreduced_at_start(const Program& program, Span<float> added) {
  Tables<float> t = program.f32;
  t.reduction = {};
  t.solver = t.matrix;
  std::vector<TreePlace<float>> trees(t.tree.data, t.tree.data + t.tree.count);
  for (TreePlace<float>& tree : trees) tree.inertia = InertiaKind::matrix;
  t.tree.data = trees.data();
  return matrix_at_start(program, t, added);
}

// A coupling as a row over all velocities.
VectorXd row_of(const Tables<double>& t, int coupling) {
  VectorXd row = VectorXd::Zero(t.velocities);
  for (int k = t.term_start[coupling]; k < t.term_start[coupling + 1]; ++k)
    row[t.velocity_of(t.term_joint[k])] = t.term_value[k];
  return row;
}

}  // namespace

double largest_rate(const Program& program) {
  const Tables<double>& t = program.f64;
  const int n = t.solver.n;
  Eigen::VectorXd damping = Eigen::VectorXd::Zero(t.velocities), stiffness = damping;
  for (int j = 0; j < t.joints; ++j) {
    damping[t.velocity_of(j)] = t.damping[j] + t.kd[j];
    stiffness[t.velocity_of(j)] = t.kp[j] + t.stiffness[j];
  }
  const MatrixXd s = all_shares(t);
  const Eigen::LDLT<MatrixXd> a(matrix_at_start(program, program.f32, program.f32.armature));
  MatrixXd motion = MatrixXd::Zero(2 * n, 2 * n);  // d/dt of (z, dz/dt)
  motion.topRightCorner(n, n).setIdentity();
  motion.bottomLeftCorner(n, n) = -a.solve(s.transpose() * stiffness.asDiagonal() * s);
  motion.bottomRightCorner(n, n) = -a.solve(s.transpose() * damping.asDiagonal() * s);
  return n == 0 ? 0.0 : motion.eigenvalues().cwiseAbs().maxCoeff();
}

std::vector<double> first_joints_shares(const Program& program) {
  const Tables<double>& t = program.f64;
  const MatrixXd a = unreduced_at_start(program, program.f32.implicit);
  const Eigen::LDLT<MatrixXd> factored(a);
  std::vector<double> shares;
  for (int c = 0; c < t.couplings; ++c) {
    const VectorXd row = row_of(t, c);
    const int first = t.velocity_of(t.term_joint[t.term_start[c]]);
    shares.push_back(1.0 / (row.dot(factored.solve(row)) * a(first, first)));
  }
  return shares;
}

std::vector<double> largest_folded_shares(const Program& program) {
  const Tables<double>& t = program.f64;
  const MatrixXd inertia = unreduced_at_start(program, program.f32.armature);
  const Eigen::LDLT<MatrixXd> factored(inertia);
  std::vector<double> shares(static_cast<std::size_t>(t.couplings), 0.0);
  for (int r = 0; r < t.rows.count; ++r) {
    const VectorXd row = row_of(t, t.rows.coupling[r]);
    const RowSoftness<double>& softness = t.rows.softness[r];
    const double cfm = softness.cfm + softness.cfm_per_response * row.dot(factored.solve(row));
    // Tendons have no inertia, but no row over joints has them.
    const auto squares = row.array().square();
    shares[t.rows.coupling[r]] = (squares > 0.0).select(squares / inertia.diagonal().array(), 0.0).maxCoeff() / cfm;
  }
  return shares;
}

}  // namespace lockstep
