// SPDX-License-Identifier: Apache-2.0
#include "state.h"

#include <fmt/format.h>

#include <Eigen/QR>
#include <cmath>
#include <map>
#include <random>

#include "tool.h"

namespace lockstep::tool {
namespace {

using Kind = StateColumn::Kind;

// How far the length of a quaternion in a file may be from 1. Files round their numbers.
constexpr double quaternion_slack = 1e-3;
// A quaternion this close to length 1 is not normalised, so that a recorded state reads back to the same bits.
constexpr double quaternion_rounding = 1e-6;

std::map<std::string, StateColumn> known_columns(const Plan& plan) {
  std::map<std::string, StateColumn> known;
  for (const StateColumn& column : joint_columns(plan.dof_names())) known.emplace(column.name, column);
  if (plan.floating())
    for (const StateColumn& column : root_columns()) known.emplace(column.name, column);
  return known;
}

std::vector<StateColumn> columns_of(const Table& table, const Plan& plan) {
  const std::map<std::string, StateColumn> known = known_columns(plan);
  std::vector<StateColumn> columns;
  for (std::size_t i = 0; i < table.columns.size(); ++i) {
    const auto found = known.find(table.columns[i]);
    if (found == known.end())
      throw InputError(fmt::format("{}:1:{}: unknown column '{}': {}-base model '{}' has no such moving joint or state",
                                   table.file, i + 1, table.columns[i], plan.floating() ? "floating" : "fixed",
                                   plan.model().name));
    columns.push_back(found->second);
  }
  int quaternion = 0;
  for (const StateColumn& column : columns) quaternion += column.kind == Kind::root_pose && column.row >= 3;
  if (quaternion != 0 && quaternion != 4)
    throw InputError(table.file + ":1: give all four of root.qw, root.qx, root.qy, root.qz or none");
  return columns;
}

bool has_quaternion(const std::vector<StateColumn>& columns) {
  for (const StateColumn& column : columns)
    if (column.kind == Kind::root_pose && column.row >= 3) return true;
  return false;
}

template <class S>
void normalize_quaternion(const Table& table, std::size_t row, int environment, Batch<S>& batch) {
  auto poses = batch.root_poses();
  auto stored = poses.col(environment).template segment<4>(3);
  const Eigen::Array4d quaternion = stored.template cast<double>();
  const double length = quaternion.matrix().norm();
  if (!(std::abs(length - 1.0) <= quaternion_slack))
    throw InputError(fmt::format("{}:{}: the quaternion root.qw ... root.qz has length {:.4g}; give a unit one",
                                 table.file, table.lines[row], length));
  if (std::abs(length - 1.0) > quaternion_rounding) stored = (quaternion / length).template cast<S>();
}

}  // namespace

std::vector<StateColumn> joint_columns(const std::vector<std::string>& joints) {
  std::vector<StateColumn> columns;
  std::map<std::string, std::string> owner;
  for (std::size_t i = 0; i < joints.size(); ++i)
    for (const Kind kind : {Kind::position, Kind::velocity}) {
      const std::string name = joints[i] + (kind == Kind::velocity ? ".v" : "");
      const auto [other, is_new] = owner.emplace(name, joints[i]);
      if (!is_new)
        throw InputError(fmt::format("joints '{}' and '{}' both claim the column '{}'; rename one of them",
                                     other->second, joints[i], name));
      columns.push_back({name, kind, static_cast<int>(i)});
    }
  return columns;
}

std::vector<StateColumn> root_columns() {
  const char* pose[] = {"x", "y", "z", "qw", "qx", "qy", "qz"};
  const char* velocity[] = {"wx", "wy", "wz", "vx", "vy", "vz"};
  std::vector<StateColumn> columns;
  for (int i = 0; i < 7; ++i) columns.push_back({std::string("root.") + pose[i], Kind::root_pose, i});
  for (int i = 0; i < 6; ++i) columns.push_back({std::string("root.") + velocity[i], Kind::root_velocity, i});
  return columns;
}

template <class S>
typename Batch<S>::View state_view(Batch<S>& batch, Kind kind) {
  switch (kind) {
    case Kind::position: return batch.positions();
    case Kind::velocity: return batch.velocities();
    case Kind::root_pose: return batch.root_poses();
    case Kind::root_velocity: break;
  }
  return batch.root_velocities();
}

template <class S>
void apply_state(const Table& table, Batch<S>& batch) {
  const std::vector<StateColumn> columns = columns_of(table, batch.plan());
  const int environments = batch.environments();
  const bool one_for_all = table.rows.size() == 1;
  if (!one_for_all && table.rows.size() != static_cast<std::size_t>(environments))
    throw InputError(fmt::format("{}: has {} rows for {} environments; give one row for all or one for each",
                                 table.file, table.rows.size(), environments));
  for (std::size_t c = 0; c < columns.size(); ++c) {
    auto row = state_view(batch, columns[c].kind).row(columns[c].row);
    for (int e = 0; e < environments; ++e) {
      const std::size_t line = one_for_all ? 0 : e;
      row[e] = static_cast<S>(table.rows[line][c]);
      if (!std::isfinite(row[e]))
        throw InputError(fmt::format("{}: {} is too large for this precision", table.at(line, c), table.rows[line][c]));
    }
  }
  if (!has_quaternion(columns)) return;
  for (int e = 0; e < environments; ++e) normalize_quaternion(table, one_for_all ? 0 : e, e, batch);
}

Model with_state(Model model, const Table& table) {
  Batch<double> batch(compile(model), 1, {.threads = 1});
  apply_state(table, batch);
  int dof = 0;
  for (Joint& joint : model.joints)
    if (joint.moves()) {
      joint.position = batch.positions()(dof, 0);
      joint.velocity = batch.velocities()(dof++, 0);
    }
  if (model.root.floating) {
    const Eigen::ArrayXd pose = batch.root_poses().col(0);
    model.root.pose.translation() = pose.head<3>();
    model.root.pose.linear() = Eigen::Quaterniond(pose[3], pose[4], pose[5], pose[6]).normalized().toRotationMatrix();
    model.root.velocity = batch.root_velocities().col(0).matrix();
  }
  return model;
}

CouplingSolver::CouplingSolver(const Model& model) {
  std::map<std::string, int> dof;
  for (const Joint& joint : model.joints)
    if (joint.moves()) dof.emplace(joint.name, static_cast<int>(dof.size()));
  const int dofs = static_cast<int>(dof.size()), couplings = static_cast<int>(model.couplings.size());
  independent_.assign(dofs, true);
  jacobian_.setZero(couplings, dofs);
  offsets_.setZero(couplings);
  for (int c = 0; c < couplings; ++c) {
    const Coupling& coupling = model.couplings[c];
    independent_[dof.at(coupling.joint)] = false;
    jacobian_(c, dof.at(coupling.joint)) = 1.0;
    for (const CouplingTerm& term : coupling.terms) jacobian_(c, dof.at(term.joint)) = term.ratio;
    offsets_[c] = coupling.offset;
  }
  if (couplings == 0) return;
  Eigen::MatrixXd first_joints_only = jacobian_;
  for (int i = 0; i < dofs; ++i)
    if (independent_[i]) first_joints_only.col(i).setZero();
  first_joints_ = first_joints_only.completeOrthogonalDecomposition().pseudoInverse();
  all_joints_ = jacobian_.completeOrthogonalDecomposition().pseudoInverse();
}

void CouplingSolver::settle_positions(Eigen::VectorXd& positions) const { settle(positions, offsets_); }

void CouplingSolver::settle_velocities(Eigen::VectorXd& velocities) const {
  settle(velocities, Eigen::VectorXd::Zero(offsets_.size()));
}

void CouplingSolver::settle(Eigen::VectorXd& values, const Eigen::VectorXd& offsets) const {
  if (offsets.size() == 0) return;
  for (const Eigen::MatrixXd* motion : {&first_joints_, &all_joints_})
    values -= *motion * (jacobian_ * values + offsets);
}

template <class S>
void perturb(double sigma, std::uint64_t seed, Batch<S>& batch) {
  const CouplingSolver solver(batch.plan().model());
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0.0, sigma);
  auto positions = batch.positions();
  for (int e = 0; e < batch.environments(); ++e) {
    Eigen::VectorXd q = positions.col(e).template cast<double>();
    for (Eigen::Index i = 0; i < q.size(); ++i)
      if (solver.independent()[i]) q[i] += noise(random);
    solver.settle_positions(q);
    positions.col(e) = q.cast<S>().array();
  }
}

template Batch<float>::View state_view(Batch<float>&, Kind);
template Batch<double>::View state_view(Batch<double>&, Kind);
template void apply_state(const Table&, Batch<float>&);
template void apply_state(const Table&, Batch<double>&);
template void perturb(double, std::uint64_t, Batch<float>&);
template void perturb(double, std::uint64_t, Batch<double>&);

}  // namespace lockstep::tool
