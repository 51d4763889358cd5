// Random mechanisms with every mixture of a Model's features. SPDX-License-Identifier: Apache-2.0
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <random>

#include "scenes.h"

namespace lockstep::scenes {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// The standard fixes the numbers of the engine, but not those of its distributions, nor the order in which the
// arguments of a call are evaluated. So no expression here draws two numbers outside of braces.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_() >> 11) * 0x1p-53);
  }
  int integer(int low, int high) {  // both included
    return low + static_cast<int>(engine_() % static_cast<std::uint64_t>(high - low + 1));
  }
  bool chance(double probability) { return uniform(0.0, 1.0) < probability; }
  double sign() { return chance(0.5) ? 1.0 : -1.0; }
  double either_sign(double low, double high) {
    const double size = uniform(low, high);
    return sign() * size;
  }
  Vector3d vector(double size) {
    Vector3d result;
    for (double& component : result) component = uniform(-size, size);
    return result;
  }
  Vector3d direction() {
    for (;;) {
      const Vector3d inside = vector(1.0);
      if (inside.norm() > 0.1 && inside.norm() <= 1.0) return inside.normalized();
    }
  }
  Eigen::Isometry3d pose(double distance, bool turned) {
    Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
    if (turned) result.rotate(Eigen::AngleAxisd{uniform(-std::numbers::pi, std::numbers::pi), direction()});
    result.translation() = vector(distance);
    return result;
  }
  template <class Element>
  void shuffle(std::vector<Element>& elements) {
    for (int i = static_cast<int>(elements.size()) - 1; i > 0; --i) std::swap(elements[i], elements[integer(0, i)]);
  }

 private:
  std::mt19937_64 engine_;
};

// A body has second moments a, b, c > 0 along its principal axes; its moments of inertia are b + c, c + a, a + b.
Inertia random_inertia(Random& random) {
  const double mass = random.uniform(0.1, 2.0);
  Vector3d second;
  for (double& moment : second) moment = mass * std::pow(random.uniform(0.01, 0.1), 2);
  const Vector3d principal = Vector3d::Constant(second.sum()) - second;
  const Eigen::Matrix3d axes = random.pose(0.0, true).linear();
  Eigen::Matrix3d tensor = axes * principal.asDiagonal() * axes.transpose();
  tensor = (0.5 * (tensor + tensor.transpose())).eval();
  return {mass, random.vector(0.1), tensor};
}

Vector3d random_axis(Random& random) {
  if (random.chance(0.5)) {
    const double length = random.uniform(0.5, 2.0);  // an axis may have any length
    return length * random.direction();
  }
  const Vector3d axis = Vector3d::Unit(random.integer(0, 2));
  return random.sign() * axis;
}

void fill_joint(Joint& joint, Random& random, const RandomOptions& options) {
  if (options.damping && random.chance(0.5)) joint.damping = random.uniform(0.0, 0.5);
  if (options.armature && random.chance(0.5)) joint.armature = random.uniform(0.0, 0.1);
  if (options.drives && random.chance(0.4))
    joint.drive = {random.uniform(0.0, 50.0), random.uniform(0.0, 5.0), random.uniform(-1.0, 1.0),
                   random.uniform(-1.0, 1.0)};
  if (options.efforts && random.chance(0.3)) joint.effort = random.uniform(-1.0, 1.0);
  if (options.springs && random.chance(0.3))
    joint.stiffness = random.uniform(0.0, 100.0), joint.rest = random.uniform(-1.0, 1.0);
  joint.position = random.uniform(-1.0, 1.0) * (joint.kind == JointKind::prismatic ? 0.2 : 1.0);
  joint.velocity = random.uniform(-1.0, 1.0);
}

Root random_root(Random& random, const RandomOptions& options) {
  Root root;
  root.floating = options.root == RandomOptions::Root::floating ||
                  (options.root == RandomOptions::Root::either && random.chance(0.5));
  root.pose = random.pose(1.0, true);
  if (root.floating)
    for (double& component : root.velocity) component = random.uniform(-1.0, 1.0);
  return root;
}

// Links and joints of one tree. The first one is the root.
void add_tree(Model& model, int dofs, Random& random, const RandomOptions& options) {
  const auto numbered = [](const char* word, int number) { return std::string(word).append(std::to_string(number)); };
  const double branching = random.uniform(0.0, 0.5);
  const int first = static_cast<int>(model.links.size());
  model.links.push_back({first == 0 ? "root" : numbered("root", first), random_inertia(random)});
  for (int moving = 0; moving < dofs;) {
    const int number = static_cast<int>(model.joints.size());
    const bool fixed = options.fixed_links && random.chance(0.2);
    const int last = static_cast<int>(model.links.size()) - 1;
    Joint joint;
    joint.name = numbered("joint", number);
    joint.parent = model.links[random.chance(branching) ? random.integer(first, last) : last].name;
    joint.child = numbered("link", number);
    joint.origin = random.pose(0.2, random.chance(0.6));
    if (!fixed) {
      const double kind = random.uniform(0.0, 1.0);
      joint.kind = options.prismatic && kind < 0.25 ? JointKind::prismatic
                   : kind < 0.5                     ? JointKind::continuous
                                                    : JointKind::revolute;
      joint.axis = random_axis(random);
      fill_joint(joint, random, options);
      ++moving;
    }
    const bool massless = fixed && random.chance(0.3);
    model.links.push_back({joint.child, massless ? Inertia{} : random_inertia(random)});
    model.joints.push_back(joint);
  }
}

Softness random_softness(Random& random, RandomOptions::Soft soft) {
  const bool hard =
      soft == RandomOptions::Soft::never || (soft == RandomOptions::Soft::sometimes && random.chance(0.5));
  if (hard) {
    const double erp = random.uniform(0.0, 0.5);
    return random.chance(0.2) ? Softness(ErpCfm{erp, 0.0}) : Softness(Hard{erp});
  }
  switch (random.integer(0, 2)) {
    case 0: return ErpCfm{random.uniform(0.0, 0.9), random.uniform(0.01, 1.0)};
    case 1: return Spring{random.uniform(0.0, 100.0), random.uniform(0.0, 2.0)};
    default: return Frequency{random.uniform(1.0, 40.0), random.uniform(0.0, 1.5)};
  }
}

// Rows of J, one column per dof; a dof is the index among the moving joints.
MatrixXd coupling_rows(const Model& model) {
  std::vector<std::string> moving;
  for (const Joint& joint : model.joints)
    if (joint.moves()) moving.push_back(joint.name);
  const auto dof = [&](const std::string& name) {
    return std::find(moving.begin(), moving.end(), name) - moving.begin();
  };
  MatrixXd rows = MatrixXd::Zero(model.couplings.size(), moving.size());
  for (std::size_t c = 0; c < model.couplings.size(); ++c) {
    rows(c, dof(model.couplings[c].joint)) = 1.0;
    for (const CouplingTerm& term : model.couplings[c].terms) rows(c, dof(term.joint)) = term.ratio;
  }
  return rows;
}

void add_couplings(Model& model, Random& random, const RandomOptions& options) {
  std::vector<std::string> moving;
  for (const Joint& joint : model.joints)
    if (joint.moves()) moving.push_back(joint.name);
  const int dofs = static_cast<int>(moving.size());
  if (dofs < 2) return;
  const int count = random.integer(1, std::max(1, dofs / 2));
  for (int c = 0; c < count; ++c) {
    random.shuffle(moving);
    Coupling coupling;
    coupling.joint = moving[0];
    const int joints = std::min(dofs, random.chance(0.6) ? 2 : random.integer(3, 5));
    for (int k = 1; k < joints; ++k)
      coupling.terms.push_back({moving[k], random.either_sign(options.min_ratio, options.max_ratio)});
    coupling.softness = random_softness(random, options.soft);
    model.couplings.push_back(coupling);
  }
  // a = -g b and b = -h c make a = g h c.
  if (options.redundant && dofs >= 4 && random.chance(0.3)) {
    random.shuffle(moving);
    const double g = random.either_sign(0.5, 2.0), h = random.either_sign(0.5, 2.0);
    const Softness softness = random_softness(random, options.soft);
    model.couplings.push_back(Coupling::mimic(moving[0], moving[1], g, 0.0, softness));
    model.couplings.push_back(Coupling::mimic(moving[1], moving[2], h, 0.0, softness));
    model.couplings.push_back(Coupling::mimic(moving[0], moving[2], -g * h, 0.0, softness));
  }
}

// Sets gamma such that C = 0 at the state or at a state near it. So no couplings contradict each other, even if one
// follows from others.
void fit_couplings_and_state(Model& model, Random& random, const RandomOptions& options) {
  std::vector<Joint*> moving;
  for (Joint& joint : model.joints)
    if (joint.moves()) moving.push_back(&joint);
  const int dofs = static_cast<int>(moving.size());
  VectorXd q(dofs), v(dofs);
  for (int i = 0; i < dofs; ++i) q[i] = moving[i]->position, v[i] = moving[i]->velocity;
  const MatrixXd rows = coupling_rows(model);
  VectorXd consistent = q;
  if (options.coupling_error)
    for (double& position : consistent) position += random.uniform(-0.05, 0.05);
  for (int c = 0; c < rows.rows(); ++c) model.couplings[c].offset = -rows.row(c).dot(consistent);

  if (options.coupling_error) return;
  MatrixXd hard(0, dofs);
  for (int c = 0; c < rows.rows(); ++c) {
    if (!is_hard(model.couplings[c].softness)) continue;
    hard.conservativeResize(hard.rows() + 1, Eigen::NoChange);
    hard.bottomRows(1) = rows.row(c);
  }
  if (hard.rows() == 0) return;
  v -= hard.completeOrthogonalDecomposition().solve(hard * v);  // the nearest v with J v = 0
  for (int i = 0; i < dofs; ++i) moving[i]->velocity = v[i];
}

void add_tendons(Model& model, Random& random, const RandomOptions& options) {
  std::vector<Joint> moving;
  for (const Joint& joint : model.joints)
    if (joint.moves()) moving.push_back(joint);
  const int count = random.integer(1, options.max_tendons);
  for (int t = 0; t < count; ++t) {
    random.shuffle(moving);
    Joint tendon;
    tendon.name = std::string("tendon").append(std::to_string(t));
    tendon.kind = JointKind::tendon;
    Coupling coupling{tendon.name, {}, random.uniform(-1.0, 1.0), Hard{}};
    tendon.position = -coupling.offset;
    for (int k = 0; k < std::min(static_cast<int>(moving.size()), random.integer(1, 4)); ++k) {
      coupling.terms.push_back({moving[k].name, random.either_sign(options.min_ratio, options.max_ratio)});
      tendon.position -= coupling.terms.back().ratio * moving[k].position;
    }
    if (options.springs && random.chance(0.5)) tendon.stiffness = random.uniform(0.0, 50.0);
    if (random.chance(0.5)) tendon.rest = tendon.position + random.uniform(-0.5, 0.5);
    if (options.damping && random.chance(0.5)) tendon.damping = random.uniform(0.0, 1.0);
    if (options.efforts && random.chance(0.5)) tendon.effort = random.uniform(-1.0, 1.0);
    if (options.drives && random.chance(0.5)) {
      tendon.drive.kp = random.uniform(0.0, 50.0), tendon.drive.kd = random.uniform(0.0, 2.0);
      tendon.drive.position_target = tendon.position + random.uniform(-0.5, 0.5);
      tendon.drive.velocity_target = random.uniform(-1.0, 1.0);
    }
    model.couplings.insert(model.couplings.begin() + random.integer(0, static_cast<int>(model.couplings.size())),
                           coupling);
    model.joints.insert(model.joints.begin() + random.integer(0, static_cast<int>(model.joints.size())), tendon);
  }
}

}  // namespace

Model random_model(std::uint64_t seed, const RandomOptions& options) {
  Random random(seed);
  Model model;
  model.name = std::string("random").append(std::to_string(seed));
  model.roots = {random_root(random, options)};
  model.roots[0].link = "root";
  model.gravity = random.chance(0.5) ? Vector3d(0, 0, -9.81) : random.vector(9.81);

  add_tree(model, random.integer(options.min_dofs, options.max_dofs), random, options);
  const int trees = options.max_trees > 1 ? random.integer(options.min_trees, options.max_trees) : 1;
  while (static_cast<int>(model.roots.size()) < trees) {
    const std::size_t first = model.links.size();
    model.roots.push_back(random_root(random, options));
    add_tree(model, random.integer(0, 6), random, options);
    model.roots.back().link = model.links[first].name;
  }
  for (int s = 0; s < 2; ++s)
    model.sites.push_back({s == 0 ? "site0" : "site1",
                           model.links[random.integer(0, static_cast<int>(model.links.size()) - 1)].name,
                           random.pose(0.2, true)});
  if (options.shuffled && random.chance(0.5)) {
    const Link root = model.links.front();
    model.links.erase(model.links.begin());
    random.shuffle(model.links);
    model.links.insert(model.links.begin(), root);
    random.shuffle(model.joints);
    if (trees > 1) random.shuffle(model.roots);
  }
  if (options.couplings) add_couplings(model, random, options);
  fit_couplings_and_state(model, random, options);
  if (options.gravity_shares && random.chance(0.4)) {
    const double common = random.uniform(-0.5, 1.0), others = random.chance(0.3) ? 0.0 : 0.4;
    for (Link& link : model.links) link.gravity = random.chance(others) ? random.uniform(-0.5, 1.5) : common;
    model.links.front().gravity = common;  // MuJoCo takes shares above 1 only beside one below
  }
  if (options.max_tendons > 0) add_tendons(model, random, options);
  return model;
}

}  // namespace lockstep::scenes
