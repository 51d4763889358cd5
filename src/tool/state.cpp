// SPDX-License-Identifier: Apache-2.0
#include "state.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <random>

#include "ranges.h"
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
  const auto write = [&] {
    for (std::size_t c = 0; c < columns.size(); ++c) {
      auto row = state_view(batch, columns[c].kind).row(columns[c].row);
      for (int e = 0; e < environments; ++e) {
        const std::size_t line = one_for_all ? 0 : e;
        row[e] = static_cast<S>(table.rows[line][c]);
        if (!std::isfinite(row[e]))
          throw InputError(
              fmt::format("{}: {} is too large for this precision", table.at(line, c), table.rows[line][c]));
      }
    }
  };
  write();
  batch.project(Couplings::all);
  write();  // what the file gives stays, even if it breaks a coupling
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

namespace {

// A draw of the noise that leaves `start` within the range, or as far outside as it is.
double drawn(double start, const Range& range, const std::function<double()>& noise) {
  constexpr int most_draws = 16;
  const double lower = std::min(start, range.lower), upper = std::max(start, range.upper);
  double drawn = start;
  for (int draw = 0; draw < most_draws; ++draw) {
    drawn = start + noise();
    if (drawn >= lower && drawn <= upper) break;
  }
  return std::clamp(drawn, lower, upper);
}

}  // namespace

template <class S>
void perturb(double sigma, std::uint64_t seed, Batch<S>& batch) {
  const Plan& plan = batch.plan();
  const std::vector<Range> held = held_ranges(plan), usable = usable_ranges(plan);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0.0, sigma);
  auto positions = batch.positions();
  batch.project(Couplings::all);
  const typename Batch<S>::Array start = positions;
  for (int e = 0; e < batch.environments(); ++e) {
    for (const int dof : plan.independent_dofs())
      positions(dof, e) = static_cast<S>(drawn(start(dof, e), usable[dof], [&] { return noise(random); }));
    // A follower of several leaders may be beyond its range yet: then all noise of the environment shrinks.
    const auto beyond = [&](int dof) {
      const double q = positions(dof, e), q0 = start(dof, e), slack = 1e-6 * (1.0 + std::abs(q));
      return q < std::min(q0, held[dof].lower) - slack || q > std::max(q0, held[dof].upper) + slack;
    };
    const std::vector<int> this_one = {e};
    const typename Batch<S>::Array change = positions.col(e) - start.col(e);
    for (S share = S(1); share > S(1e-3); share /= S(2)) {
      for (const int dof : plan.independent_dofs()) positions(dof, e) = start(dof, e) + share * change(dof, 0);
      batch.project(this_one, Couplings::all);
      if (std::none_of(plan.follower_dofs().begin(), plan.follower_dofs().end(), beyond)) break;
    }
  }
}

template Batch<float>::View state_view(Batch<float>&, Kind);
template Batch<double>::View state_view(Batch<double>&, Kind);
template void apply_state(const Table&, Batch<float>&);
template void apply_state(const Table&, Batch<double>&);
template void perturb(double, std::uint64_t, Batch<float>&);
template void perturb(double, std::uint64_t, Batch<double>&);

}  // namespace lockstep::tool
