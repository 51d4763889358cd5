// Models of every kind of row, as bytes decide: for fuzzing and soaking. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "lockstep/model.h"
#include "lockstep/step.h"

namespace lockstep::scenes {

/// As many random bytes as a model takes.
std::vector<std::uint8_t> bytes_of(std::uint64_t seed);

/// Makes a model and settings of what the bytes say. Bytes beside each other decide on things beside each other, so a
/// fuzzer that changes one byte changes one thing. Missing bytes are 0. Most models are valid; one in sixteen is made
/// without care, and not every setting takes every model: compile() refuses those.
class AnyModel {
 public:
  /// Keeps no copy of the bytes.
  explicit AnyModel(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  /// One to six links, with joints, couplings, loops, tendons and colliders.
  Model model();
  /// To be called after model().
  StepSettings settings();

 private:
  int whole(int low, int high);  // both included, at most 256 numbers
  double real(double low, double high);
  bool one_in(int n) { return whole(1, n) == n; }
  bool chance() { return one_in(2); }
  template <class Value, std::size_t count>
  Value one_of(const Value (&values)[count]) {
    return values[static_cast<std::size_t>(whole(0, static_cast<int>(count) - 1))];
  }
  Eigen::Vector3d vector(double most);
  Pose pose(double distance);
  Softness softness();
  std::string link();         // any of l0, l1 ...
  std::string moving_link();  // one that moves, if there is one

  void add_joint(Model& model, int child);
  void add_coupling(Model& model);
  void add_loop(Model& model);
  void add_tendon(Model& model);
  void add_collider(Model& model);

  std::span<const std::uint8_t> bytes_;
  std::size_t used_ = 0;
  bool careless_ = false;
  int links_ = 1;
  std::vector<int> moving_;           // links
  std::vector<std::string> coupled_;  // joints that couplings take
};

}  // namespace lockstep::scenes
