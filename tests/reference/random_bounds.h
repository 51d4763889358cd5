// Random mechanisms with random bounds that do not contradict each other. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <stdexcept>
#include <string>

#include "reference/step.h"
#include "scenes/scenes.h"

namespace lockstep::physics {

/// Uniform random numbers that are the same everywhere, unlike those of the standard distributions.
struct Uniform {
  double operator()(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine() >> 11) * 0x1p-53);
  }
  std::mt19937_64 engine;
};

/// Draws bounds for a small random model.
class RandomBounds {
 public:
  static constexpr int most = 8;  ///< bounds of one model

  explicit RandomBounds(std::uint64_t seed) : uniform_{std::mt19937_64(seed)} {}

  Model draw(std::uint64_t scene, const scenes::RandomOptions& options) {
    Model model = scenes::random_model(scene, options);
    left_ = most;
    for (int round = 0; round < 5; ++round)
      for (Joint& joint : model.joints)
        if (joint.moves() && chance(0.5)) bound(joint);
    for (Coupling& coupling : model.couplings)
      if (!is_tendon(model.joints[static_cast<std::size_t>(model.joint_index(coupling.joint))]) && chance(0.3) &&
          take(1))
        coupling.force_limit = size(0.05, 100.0);
    return model;
  }

 private:
  double uniform(double low, double high) { return uniform_(low, high); }
  bool chance(double probability) { return uniform(0.0, 1.0) < probability; }
  double size(double low, double high) { return low * std::pow(high / low, uniform(0.0, 1.0)); }
  bool take(int count) {
    if (left_ < count) return false;
    left_ -= count;
    return true;
  }

  static bool is_tendon(const Joint& joint) { return joint.kind == JointKind::tendon; }

  Softness soft(const Joint& joint) {
    const int kind = static_cast<int>(uniform_.engine() % 3);
    const double first = uniform(0.0, 1.0), second = uniform(0.0, 1.0);
    if (kind == 0) return ErpCfm{0.8 * first, 0.01 + second};
    if (kind == 1 || is_tendon(joint)) return Spring{200.0 * first, 0.1 + 2.0 * second};
    return Frequency{5.0 + 60.0 * first, 1.5 * second};
  }

  // Speeds are about 1 and steps 1/240, so a limit at the near distance is active in about half of the models. A far
  // limit is inactive.
  void range(Joint& joint) {
    const double near = uniform(-0.002, 0.005);
    const bool below = chance(0.5), closed = chance(0.6);
    const double far = chance(0.2) ? uniform(0.005, 0.02) : uniform(0.5, 2.0);
    if (joint.kind == JointKind::continuous) joint.kind = JointKind::revolute;
    if (below || closed) joint.lower = joint.position - (below ? near : far);
    if (!below || closed) joint.upper = joint.position + (below ? far : near);
    if (chance(0.35)) {
      joint.limit_softness = soft(joint);
    } else {
      joint.limit_softness = Hard{uniform(0.0, 1.0)};
      if (chance(0.4)) joint.restitution = uniform(0.0, 1.0);
    }
  }

  void prescribe(Joint& joint) {
    joint.drive = {};
    joint.drive.kinematic = true;
    joint.drive.position_target = joint.position + uniform(-0.02, 0.02);
    joint.drive.velocity_target = uniform(-1.0, 1.0);
    joint.drive.softness = chance(0.4) ? soft(joint) : Hard{chance(0.5) ? 1.0 : uniform(0.1, 1.0)};
  }

  void bound(Joint& joint) {
    switch (uniform_.engine() % 5) {
      case 0:
        if (joint.lower == -infinity && joint.upper == infinity && take(1)) range(joint);
        break;
      case 1:
        if (joint.friction == 0.0 && take(1)) joint.friction = size(0.05, 200.0);
        break;
      case 2:
        if (joint.velocity_limit == infinity && take(1)) joint.velocity_limit = uniform(0.2, 1.5);
        break;
      case 3:
        if (joint.effort_limit < infinity || joint.drive.kinematic || !take(1)) break;
        if (chance(0.7)) {
          joint.drive.kp = uniform(0.0, 50.0), joint.drive.kd = uniform(0.0, 5.0);
          joint.drive.position_target = joint.position + uniform(-0.5, 0.5);
          joint.drive.velocity_target = uniform(-1.0, 1.0);
        }
        joint.effort_limit = size(0.2, 50.0);
        break;
      default:
        if (!joint.drive.kinematic && chance(0.4) && take(1)) prescribe(joint);
    }
  }

  Uniform uniform_;
  int left_ = most;
};

/// A model whose bounds can all be met in one step, with and without a velocity phase. Models are drawn until the
/// reference finds a solution.
inline Model random_bounds(std::uint64_t seed, double dt = 1.0 / 240,
                           const scenes::RandomOptions& options = {.max_dofs = 9}) {
  RandomBounds random(seed);
  for (int attempt = 0; attempt < 100; ++attempt) {
    const Model model = random.draw(seed, options);
    const reference::Mechanism mechanism(model);
    StepSettings settings;
    settings.dt = dt;
    settings.method = Method::direct;
    try {
      for (settings.velocity_iterations = 0; settings.velocity_iterations < 2; ++settings.velocity_iterations)
        reference::step(mechanism, settings, mechanism.initial_state(), mechanism.initial_inputs());
      return model;
    } catch (const std::logic_error&) {
    }
  }
  throw std::runtime_error("no bounds without contradiction found for seed " + std::to_string(seed));
}

}  // namespace lockstep::physics
