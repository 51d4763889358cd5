// The fixed scenes and the files of their exact motion. SPDX-License-Identifier: Apache-2.0
#include "scenes.h"

#include <cmath>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace lockstep::scenes {
namespace {

using Eigen::Vector3d;

constexpr double chain_damping = 0.05;  // N m s/rad

Inertia arm_box() { return Inertia::box(0.2, {0.1, 0.04, 0.04}, {0.05, 0, 0}); }
Inertia finger_box() { return Inertia::box(0.05, {0.04, 0.02, 0.02}, {0.02, 0, 0}); }

std::string numbered(char letter, int number) { return std::string(1, letter).append(std::to_string(number)); }
std::string j(int i) { return numbered('j', i); }
std::string l(int i) { return numbered('l', i); }

// Appends link l<i> with joint j<i> to the link `parent`, at `offset` in its frame.
Joint& append(Model& model, const std::string& parent, const Vector3d& offset, const Vector3d& axis,
              const Inertia& inertia) {
  const int number = static_cast<int>(model.joints.size());
  model.links.push_back({l(number), inertia});
  Joint joint;
  joint.name = j(number);
  joint.kind = JointKind::revolute;
  joint.parent = parent;
  joint.child = l(number);
  joint.origin.translation() = offset;
  joint.axis = axis;
  model.joints.push_back(joint);
  return model.joints.back();
}

// Appends `count` links in series to "base", the first at `start`. Even joints turn about y, odd ones about z.
void append_chain(Model& model, int count, const Vector3d& start) {
  for (int i = 0; i < count; ++i) {
    const std::string parent = i == 0 ? "base" : l(i - 1);
    Joint& joint = append(model, parent, i == 0 ? start : Vector3d(0.1, 0, 0),
                          i % 2 == 0 ? Vector3d::UnitY() : Vector3d::UnitZ(), arm_box());
    joint.damping = chain_damping;
  }
}

// chain8 without its couplings.
Model eight_links(const std::string& name) {
  Model model;
  model.name = name;
  model.links = {{"base", {}}};
  append_chain(model, 8, Vector3d::Zero());
  for (Joint& joint : model.joints) joint.position = 0.3;
  return model;
}

void couple_in_fours(Model& model, double ratio) {
  for (int k = 0; k + 3 < static_cast<int>(model.joints.size()); k += 4) {
    model.couplings.push_back(Coupling::mimic(j(k), j(k + 2), ratio));
    model.couplings.push_back(Coupling::mimic(j(k + 1), j(k + 3), ratio));
  }
}

Eigen::VectorXd gripper13_targets(double t) {
  Eigen::VectorXd targets = Eigen::VectorXd::Zero(13);
  for (int i = 0; i < 7; ++i) targets[i] = 0.3 * std::sin(t + i);
  targets[7] = 0.4 * std::sin(2.0 * t);
  return targets;
}

Eigen::VectorXd drive1e6_targets(double t) {
  Eigen::VectorXd targets = Eigen::VectorXd::Zero(8);
  targets[0] = 0.3 * std::cos(2.0 * t);
  return targets;
}

}  // namespace

Model chain8() {
  Model model = eight_links("chain8");
  couple_in_fours(model, -1.0);
  return model;
}

Model gripper13() {
  Model model;
  model.name = "gripper13";
  model.links = {{"base", {}}};
  for (int i = 0; i < 7; ++i) {
    const std::string parent = i == 0 ? "base" : l(i - 1);
    Joint& joint = append(model, parent, {i == 0 ? 0.0 : 0.1, 0, 0}, i % 2 == 0 ? Vector3d::UnitZ() : Vector3d::UnitY(),
                          arm_box());
    joint.drive.kp = 100.0;
    joint.drive.kd = 10.0;
  }
  for (const double side : {1.0, -1.0})
    for (int i = 0; i < 3; ++i) {
      const std::string parent = i == 0 ? "l6" : model.links.back().name;
      append(model, parent, i == 0 ? Vector3d(0.1, 0, side * 0.02) : Vector3d(0.04, 0, 0), Vector3d::UnitY(),
             finger_box());
    }
  model.joints[7].drive.kp = 20.0;
  model.joints[7].drive.kd = 1.0;
  const double multipliers[] = {-1, 1, 1, -1, 1};
  for (int i = 0; i < 5; ++i) model.couplings.push_back(Coupling::mimic(j(8 + i), j(7), -multipliers[i]));
  const Eigen::VectorXd targets = gripper13_targets(0.0);
  for (int i = 0; i < 13; ++i) model.joints[i].drive.position_target = targets[i];
  return model;
}

Model chain32() {
  Model model;
  model.name = "chain32";
  model.links = {{"base", arm_box()}};
  model.roots = {{model.links[0].name, true}};
  model.gravity.setZero();
  append_chain(model, 32, {0.1, 0, 0});
  for (int i = 0; i < 32; ++i) model.joints[i].velocity = i % 2 == 0 ? 1.0 : -1.0;
  couple_in_fours(model, -1.0);
  return model;
}

Model gear100() {
  Model model = eight_links("gear100");
  couple_in_fours(model, -100.0);
  for (const int follower : {2, 3, 6, 7}) model.joints[follower].position = 0.003;
  return model;
}

Model drive1e6() {
  Model model = chain8();
  model.name = "drive1e6";
  model.joints[0].drive = {1e6, 1e3, drive1e6_targets(0.0)[0], 0.0};
  return model;
}

Model redundant() {
  Model model = eight_links("redundant");
  model.couplings = {Coupling::mimic(j(0), j(2), -1.0), Coupling::mimic(j(2), j(4), -1.0),
                     Coupling::mimic(j(0), j(4), -1.0)};
  return model;
}

Model mass1000() {
  Model model = chain8();
  model.name = "mass1000";
  model.links.back().inertia = Inertia::box(200.0, {0.1, 0.04, 0.04}, {0.05, 0, 0});
  return model;
}

const std::vector<std::string>& names() {
  static const std::vector<std::string> all = {"chain8",   "gripper13", "chain32", "gear100",
                                               "drive1e6", "redundant", "mass1000"};
  return all;
}

Scene scene(const std::string& name) {
  const auto still = [](int dofs) { return [dofs](double) -> Eigen::VectorXd { return Eigen::VectorXd::Zero(dofs); }; };
  if (name == "chain8") return {name, chain8(), still(8)};
  if (name == "gripper13") return {name, gripper13(), gripper13_targets};
  if (name == "chain32") return {name, chain32(), still(32)};
  if (name == "gear100") return {name, gear100(), still(8)};
  if (name == "drive1e6") return {name, drive1e6(), drive1e6_targets};
  if (name == "redundant") return {name, redundant(), still(8)};
  if (name == "mass1000") return {name, mass1000(), still(8)};
  throw std::invalid_argument("no scene '" + name + "'");
}

Truth read_truth(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error("cannot read '" + path + "'");
  std::vector<std::vector<double>> rows;
  for (std::string line; std::getline(file, line);) {
    std::istringstream numbers(line);
    std::vector<double> row;
    for (double number; numbers >> number;) row.push_back(number);
    if (row.empty()) continue;
    if (row.size() < 2 || (!rows.empty() && row.size() != rows.front().size()))
      throw std::runtime_error("'" + path + "': rows of different length");
    rows.push_back(row);
  }
  if (rows.empty()) throw std::runtime_error("'" + path + "' is empty");
  Truth truth;
  truth.times.resize(rows.size());
  truth.positions.resize(rows.size(), rows.front().size() - 1);
  for (std::size_t r = 0; r < rows.size(); ++r) {
    truth.times[r] = rows[r][0];
    for (std::size_t c = 1; c < rows[r].size(); ++c) truth.positions(r, c - 1) = rows[r][c];
  }
  return truth;
}

}  // namespace lockstep::scenes
