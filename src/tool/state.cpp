// SPDX-License-Identifier: Apache-2.0
#include "state.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <random>

#include "output.h"
#include "ranges.h"
#include "tool.h"

namespace lockstep::tool {
namespace {

using Kind = StateColumn::Kind;

// How far the length of a quaternion in a file may be from 1. Files round their numbers.
constexpr double quaternion_slack = 1e-3;
// A quaternion this close to length 1 is not normalised, so that a recorded state reads back to the same bits.
constexpr double quaternion_rounding = 1e-6;

std::string root_prefix(const Plan& plan, int root) {
  return plan.root_names().size() == 1 ? "root" : plan.root_names()[static_cast<std::size_t>(root)];
}

// By floating root that has any: how many columns of its quaternion there are.
std::map<int, int> quaternion_columns(const std::vector<StateColumn>& columns) {
  std::map<int, int> count;
  for (const StateColumn& column : columns)
    if (column.kind == Kind::root_pose && column.row % 7 >= 3) ++count[column.row / 7];
  return count;
}

std::vector<StateColumn> columns_of(const Table& table, const Plan& plan) {
  std::map<std::string, StateColumn> known;
  for (const StateColumn& column : state_columns(plan)) known.emplace(column.name, column);
  std::vector<StateColumn> columns;
  for (std::size_t i = 0; i < table.columns.size(); ++i) {
    const auto found = known.find(table.columns[i]);
    if (found == known.end())
      throw InputError(
          fmt::format("{}:1:{}: unknown column '{}': model '{}' ({} base) has no such moving joint or state",
                      table.file, i + 1, table.columns[i], plan.model().name, base_of(plan.model())));
    columns.push_back(found->second);
  }
  for (const auto& [root, count] : quaternion_columns(columns))
    if (count != 4) {
      const std::string name = root_prefix(plan, root);
      throw InputError(fmt::format("{0}:1: give all four of {1}.qw, {1}.qx, {1}.qy, {1}.qz or none", table.file, name));
    }
  return columns;
}

template <class S>
void normalize_quaternion(const Table& table, std::size_t row, int environment, int root, Batch<S>& batch) {
  auto poses = batch.root_poses();
  auto stored = poses.col(environment).template segment<4>(7 * root + 3);
  const Eigen::Array4d quaternion = stored.template cast<double>();
  const double length = quaternion.matrix().norm();
  if (!(std::abs(length - 1.0) <= quaternion_slack))
    throw InputError(fmt::format("{0}:{1}: the quaternion {2}.qw ... {2}.qz has length {3:.4g}; give a unit one",
                                 table.file, table.lines[row], root_prefix(batch.plan(), root), length));
  if (std::abs(length - 1.0) > quaternion_rounding) stored = (quaternion / length).template cast<S>();
}

}  // namespace

std::vector<StateColumn> state_columns(const Plan& plan, bool of_recording) {
  std::vector<StateColumn> columns;
  std::map<std::string, std::string> owner;
  if (of_recording) {
    owner = {{"time", "the clock"}, {"fault", "the fault"}};
    for (const std::string& coupling : coupling_names(plan.model()))
      owner.emplace("C." + coupling, "coupling '" + coupling + "'");
    for (const Site& site : plan.model().sites)
      for (const char* axis : {".x", ".y", ".z"}) owner.emplace("site." + site.name + axis, "site '" + site.name + "'");
  }
  const auto add = [&](const std::string& name, Kind kind, std::size_t row, const std::string& whose) {
    const auto [other, is_new] = owner.emplace(name, whose);
    if (!is_new)
      throw InputError(
          fmt::format("{} and {} both claim the column '{}'; rename one of them", other->second, whose, name));
    columns.push_back({name, kind, static_cast<int>(row)});
  };
  for (std::size_t i = 0; i < plan.dof_names().size(); ++i) {
    const std::string& joint = plan.dof_names()[i];
    add(joint, Kind::position, i, "joint '" + joint + "'");
    add(joint + ".v", Kind::velocity, i, "joint '" + joint + "'");
  }
  const std::vector<std::string> pose = {"x", "y", "z", "qw", "qx", "qy", "qz"},
                                 velocity = {"wx", "wy", "wz", "vx", "vy", "vz"};
  for (const auto& [kind, names] : {std::pair(Kind::root_pose, pose), std::pair(Kind::root_velocity, velocity)})
    for (std::size_t root = 0; root < plan.root_names().size(); ++root)
      for (std::size_t i = 0; i < names.size(); ++i)
        add(root_prefix(plan, static_cast<int>(root)) + "." + names[i], kind, root * names.size() + i,
            "root '" + plan.root_names()[root] + "'");
  return columns;
}

std::string base_of(const Model& model) {
  const auto floating = std::count_if(model.roots.begin(), model.roots.end(), [](const Root& r) { return r.floating; });
  if (model.roots.size() > 1) return fmt::format("{} of {} floating", floating, model.roots.size());
  return floating == 1 ? "floating" : "fixed";
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

void require_rows(const Table& table, int environments) {
  if (table.rows.size() != 1 && table.rows.size() != static_cast<std::size_t>(environments))
    throw InputError(fmt::format("{}: has {} rows for {} environments; give one row for all or one for each",
                                 table.file, table.rows.size(), environments));
}

template <class S>
void apply_state(const Table& table, Batch<S>& batch) {
  const std::vector<StateColumn> columns = columns_of(table, batch.plan());
  const int environments = batch.environments();
  const bool one_for_all = table.rows.size() == 1;
  require_rows(table, environments);
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
  batch.project(EnvironmentSet::all(), Couplings::all);
  write();  // what the file gives stays, even if it breaks a coupling
  for (const auto& [root, count] : quaternion_columns(columns))
    for (int e = 0; e < environments; ++e) normalize_quaternion(table, one_for_all ? 0 : e, e, root, batch);
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
  int floating = 0;
  for (Root& root : model.roots) {
    if (!root.floating) continue;
    const Eigen::Array<double, 7, 1> pose = batch.root_poses().col(0).segment<7>(7 * floating);
    root.pose.translation() = pose.head<3>();
    root.pose.linear() = Eigen::Quaterniond(pose[3], pose[4], pose[5], pose[6]).normalized().toRotationMatrix();
    root.velocity = batch.root_velocities().col(0).segment<6>(6 * floating++).matrix();
  }
  return model;
}

template <class S>
void write_states(const std::string& path, bool with_names, Batch<S>& batch) {
  OutputFile file(path);
  const std::vector<StateColumn> columns = state_columns(batch.plan());
  std::vector<std::string> cells;
  const auto write_line = [&] { file.write(fmt::format("{}\n", fmt::join(cells, ","))); };
  for (const StateColumn& column : columns) cells.push_back(csv_field(column.name));
  if (with_names) write_line();
  for (int e = 0; e < batch.environments(); ++e) {
    cells.clear();
    for (const StateColumn& column : columns)
      cells.push_back(fmt::to_string(state_view(batch, column.kind)(column.row, e)));
    write_line();
  }
  file.close();
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
  auto positions = batch.positions();
  batch.project(EnvironmentSet::all(), Couplings::all);
  const typename Batch<S>::Array start = positions;
  for (int e = 0; e < batch.environments(); ++e) {
    std::seed_seq words{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32), batch.ids()[e]};
    std::mt19937_64 random(words);
    std::normal_distribution<double> noise(0.0, sigma);
    for (const int dof : plan.independent_dofs())
      positions(dof, e) = static_cast<S>(drawn(start(dof, e), usable[dof], [&] { return noise(random); }));
    // A follower of several leaders may be beyond its range yet: then all noise of the environment shrinks.
    const auto beyond = [&](int dof) {
      const double q = positions(dof, e), q0 = start(dof, e), slack = 1e-6 * (1.0 + std::abs(q));
      return q < std::min(q0, held[dof].lower) - slack || q > std::max(q0, held[dof].upper) + slack;
    };
    const typename Batch<S>::Array change = positions.col(e) - start.col(e);
    for (S share = S(1); share > S(1e-3); share /= S(2)) {
      for (const int dof : plan.independent_dofs()) positions(dof, e) = start(dof, e) + share * change(dof, 0);
      batch.project({e}, Couplings::all);
      if (std::none_of(plan.follower_dofs().begin(), plan.follower_dofs().end(), beyond)) break;
    }
  }
}

template Batch<float>::View state_view(Batch<float>&, Kind);
template Batch<double>::View state_view(Batch<double>&, Kind);
template void apply_state(const Table&, Batch<float>&);
template void apply_state(const Table&, Batch<double>&);
template void write_states(const std::string&, bool, Batch<float>&);
template void write_states(const std::string&, bool, Batch<double>&);
template void perturb(double, std::uint64_t, Batch<float>&);
template void perturb(double, std::uint64_t, Batch<double>&);

}  // namespace lockstep::tool
