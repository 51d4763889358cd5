// Which colliders may touch. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "trees.h"

namespace lockstep {

constexpr long most_heights = 2'700'000;  ///< of a height field: six numbers a cell are exact in single precision
constexpr double most_height = 1e4;       ///< m
constexpr double most_friction = 100.0;   ///< beyond it, what lands may fall through

struct ColliderPair {
  int first, second;  ///< colliders of the model, the kinds in the order of ShapeKind
  bool swapped;       ///< the model names the second one first
  double friction, restitution;
  Softness softness;
  double torsional_friction, rolling_friction;  ///< m
};

struct ContactPairs {
  std::vector<ColliderPair> pairs;
  std::vector<std::string> left_out;  ///< pairs of groups that may not touch, and why, in words
};

/// Throws ModelError for a collider or a contact that breaks a rule. Groups become pairs.
ContactPairs contact_pairs(const Model& model, const Trees& trees);

/// Two equal pairs have one name: "first-second", as the model's contacts have them.
std::string pair_name(const Model& model, const ColliderPair& pair);

}  // namespace lockstep
