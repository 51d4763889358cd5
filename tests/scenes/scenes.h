// The mechanisms of the tests and benchmarks. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "lockstep/model.h"

namespace lockstep::scenes {

// Links are solid boxes of 0.1 x 0.04 x 0.04 m and 0.2 kg unless said otherwise. Their long side lies along +x; their
// frame is at the joint, in the centre of the left end face. Joints are named j0, j1, ... and links l0, l1, ... in
// order; l0 hangs on "base". Couplings are hard with the default erp.

/// Fixed base, gravity, axes y, z, y, z ..., damping 0.05, q = 0.3 at rest; mimics (0,2), (1,3), (4,6), (5,7), G = -1.
Model chain8();

/// Arm of seven driven links with axes z, y, z ... Its last link carries two fingers of three joints, all about y.
/// j7 is driven; j8 to j12 mimic it with multipliers -1, 1, 1, -1, 1. q = v = 0.
Model gripper13();

/// Floating box with 32 links, axes y, z, y, z ..., no gravity, damping 0.05, v_i = (-1)^i;
/// mimics (4k, 4k+2), (4k+1, 4k+3), G = -1. It starts as a whip with 908 J.
Model chain32();

Model gear100();    ///< chain8 with q_A = 100 q_B, q_A(0) = 0.3
Model drive1e6();   ///< chain8, joint 0 driven with kp 1e6, kd 1e3 to 0.3 cos 2t
Model redundant();  ///< chain8 with mimics (0,2), (2,4), (0,4), G = -1: the third follows from the others
Model mass1000();   ///< chain8 with a last link of 200 kg

/// One of these scenes, with the position targets of its drives as a function of time: one value per dof, zero for
/// dofs without a drive.
struct Scene {
  std::string name;
  Model model;
  std::function<Eigen::VectorXd(double t)> targets;
};
const std::vector<std::string>& names();
Scene scene(const std::string& name);  ///< throws std::invalid_argument for unknown names

/// Features of a random model. A feature that is switched on appears on some of the joints or couplings.
struct RandomOptions {
  enum class Root { fixed, floating, either };
  enum class Soft { never, sometimes, always };

  Root root = Root::either;
  int min_trees = 1, max_trees = 1;
  int min_dofs = 1, max_dofs = 24;  ///< of the first tree; others have up to 6
  bool prismatic = true;
  bool fixed_links = true;  ///< fixed joints anywhere in the tree, some of their links without mass
  bool shuffled = true;     ///< links and joints may be listed in any order
  bool armature = true, damping = true, drives = true, efforts = true;
  bool springs = false;
  bool gravity_shares = true;               ///< in two of five models: of most links the same, in some of all
  bool couplings = true;                    ///< of 2 to 5 joints, if there are 2 dofs; their rank is below the dofs
  double min_ratio = 0.3, max_ratio = 3.0;  ///< of couplings, either sign
  Soft soft = Soft::sometimes;
  bool redundant = true;       ///< a coupling may follow from two others; it never contradicts them
  bool coupling_error = true;  ///< the state violates the couplings, in position by about 0.05; if false, it satisfies
                               ///< all in position and the hard ones in velocity
  int max_tendons = 0;         ///< each over 1 to 4 joints, with springs and servos
};

/// One to five trees, with couplings between them, and springs.
inline RandomOptions forests() {
  RandomOptions options;
  options.max_trees = 5, options.max_dofs = 10, options.springs = true;
  return options;
}

/// A valid model that depends on its arguments only.
Model random_model(std::uint64_t seed, const RandomOptions& options = {});

/// The contents of a file of exact motion; each of its rows holds the time and all joint positions.
struct Truth {
  Eigen::VectorXd times;
  Eigen::MatrixXd positions;  ///< [row][dof]
};
Truth read_truth(const std::string& path);  ///< throws std::runtime_error if the file cannot be read

}  // namespace lockstep::scenes
