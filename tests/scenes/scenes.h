// The mechanisms that everything is tested and measured on. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "lockstep/model.h"

namespace lockstep::scenes {

// Links are solid boxes of 0.1 x 0.04 x 0.04 m and 0.2 kg unless said otherwise, long side along +x, their
// frame at the joint in the centre of the left end face. Joints are j0, j1, ... and links l0, l1, ... in
// order; l0 hangs on "base". Couplings are hard with the default erp.

/// Fixed base, gravity, axes y, z, y, z ..., damping 0.05, q = 0.3 at rest; mimics (0,2), (1,3), (4,6), (5,7), G = -1.
Model chain8();

/// Arm of seven driven links, axes z, y, z ...; on its last link two fingers of three joints, all about y:
/// j7 is driven, j8 to j12 mimic it with multipliers -1, 1, 1, -1, 1. q = v = 0.
Model gripper13();

/// Floating box with 32 links, axes y, z, y, z ..., no gravity, damping 0.05, v_i = (-1)^i;
/// mimics (4k, 4k+2), (4k+1, 4k+3), G = -1. The start is a whip of 908 J.
Model chain32();

Model gear100();    ///< chain8 with q_A = 100 q_B, q_A(0) = 0.3
Model drive1e6();   ///< chain8, joint 0 driven with kp 1e6, kd 1e3 to 0.3 cos 2t
Model redundant();  ///< chain8 with mimics (0,2), (2,4), (0,4), G = -1: the third follows from the others
Model mass1000();   ///< chain8 with a last link of 200 kg

/// One of these by name, with the position targets of its drives as a function of time: one value per dof,
/// 0 where there is no drive.
struct Scene {
  std::string name;
  Model model;
  std::function<Eigen::VectorXd(double t)> targets;
};
const std::vector<std::string>& names();
Scene scene(const std::string& name);  ///< throws std::invalid_argument for others

/// What a random model may have. Each of the switched features appears on some of the joints or couplings.
struct RandomOptions {
  enum class Root { fixed, floating, either };
  enum class Soft { never, sometimes, always };

  Root root = Root::either;
  int min_dofs = 1, max_dofs = 24;
  bool prismatic = true;
  bool fixed_links = true;  ///< fixed joints in between and at the ends, some of their links without mass
  bool shuffled = true;     ///< links and joints may come in an order other than down the tree
  bool armature = true, damping = true, drives = true, efforts = true;
  bool couplings = true;                    ///< of 2 to 5 joints, from 2 dofs on; their rank is less than the dofs
  double min_ratio = 0.3, max_ratio = 3.0;  ///< of couplings, either sign
  Soft soft = Soft::sometimes;
  bool redundant = true;       ///< a coupling may follow from two others; it never contradicts them
  bool coupling_error = true;  ///< the state violates the couplings, in position by about 0.05; otherwise they hold
                               ///< in position, and the hard ones in velocity
};

/// A valid model that depends on nothing but its arguments.
Model random_model(std::uint64_t seed, const RandomOptions& options = {});

/// A file of exact motion: per row the time and all joint positions.
struct Truth {
  Eigen::VectorXd times;
  Eigen::MatrixXd positions;  ///< [row][dof]
};
Truth read_truth(const std::string& path);  ///< throws std::runtime_error where there is none

}  // namespace lockstep::scenes
