// Bodies, links and trees. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "spans.h"

namespace lockstep {

/// One rigid body and the joint that carries it. The joint's axis is a coordinate axis of the body's frame.
struct BodyStructure {
  int parent;  ///< body, -1 for the fixed world
  int tree;
  int velocity;  ///< of its joint, or the first of a floating root's six
  int joint;     ///< for a floating root: its number among these
  int axis;      ///< 0, 1, 2
  bool prismatic;
  bool rotated;   ///< a constant rotation comes before the joint's own
  bool root;      ///< a floating root, which has no joint
  int ball;       ///< of the first body of a ball joint: its number among these; -1 for others
  int kind;       ///< BodyKind: what kernels::with_joint() switches over
  bool first;     ///< the first of its parent's children in the order from the leaves to the root
  bool leaf;      ///< it carries no other body
  bool heavy;     ///< base_mass is not zero, for it or for a body that it carries
  bool diagonal;  ///< base_second is diagonal in every environment
};
template <class S>
struct Body : BodyStructure {
  S sign;                                       ///< the joint's axis is sign times the coordinate axis
  S rotation[9];                                ///< parent coordinates to joint coordinates at q = 0, row-major
  S offset[3];                                  ///< origin in the parent frame at q = 0
  S mass, moment[3], second[6];                 ///< pseudo-inertia about the origin, see simd/vec3.h
  S base_mass, base_moment[3], base_second[6];  ///< base inertia: mass on joint axes is moved inwards (M10)

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.sign, to.sign), visit(from.rotation, to.rotation), visit(from.offset, to.offset);
    visit(from.mass, to.mass), visit(from.moment, to.moment), visit(from.second, to.second);
    visit(from.base_mass, to.base_mass), visit(from.base_moment, to.base_moment),
        visit(from.base_second, to.base_second);
  }
};

/// A joint and the direction of its body's offset. A revolute joint without a constant rotation has 3 * axis plus one
/// of the first three: its offset lies along the next axis, the last one, or both. A prismatic joint without a constant
/// rotation has sliding_joint + axis. The bodies of a ball joint have ball_joint + axis: the first makes all of its
/// turn, the other two stay in its frame.
enum BodyKind : int {
  next_axis,
  last_axis,
  both_axes,
  turned_joint = 9,
  sliding_joint = 10,
  turned_sliding_joint = 13,
  ball_joint = 14
};

/// A link of the model in its body: where it is, and the inertia of one kilogram of it.
struct LinkStructure {
  int body;  ///< -1: bolted to the world
  int tree;
};
template <class S>
struct LinkPlace : LinkStructure {
  S rotation[9];  ///< link coordinates to body coordinates, row-major
  S offset[3];
  S unit_moment[3], unit_second[6];  ///< per kg, about the body's origin, or a bolted root's
  S gravity_share;                   ///< of the model's gravity
  S spread[6];  ///< the second moment about the centre of mass, in the link's axes; per kg if masses differ

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.rotation, to.rotation), visit(from.offset, to.offset);
    visit(from.unit_moment, to.unit_moment), visit(from.unit_second, to.unit_second);
    visit(from.gravity_share, to.gravity_share), visit(from.spread, to.spread);
  }
};

/// A floating root: its body, the first of its six velocities, and its number among the solver's velocities.
struct FloatingRoot {
  int body, velocity, solver;
};

/// A ball joint: the first of its three bodies, joints and velocities, which follow each other.
struct BallJoint {
  int body, joint, velocity;
  int row;       ///< of Bounds::rows, for its range; -1 without one
  int value[3];  ///< by axis: the place of the row's term
};

/// How the inertia of a tree enters a step: as its part of A, from which A_r follows (M40); as A_r at once, by
/// composite columns (M41); or by articulated bodies, which factor A without computing it (M22). Trees that couplings
/// join have the same. No other tree changes the choice, so a tree steps with the bits that it has alone.
enum class InertiaKind : int { matrix, composite_columns, articulated_bodies };

/// A tree of links. Its bodies and its joints are consecutive.
struct TreeStructure {
  InertiaKind inertia;
  bool has_undamped_rows;
  int root;                     ///< number among the floating roots, -1 if bolted
  int first_body, last_body;    ///< the last is one past the end
  int first_joint, last_joint;  ///< the same
};
template <class S>
struct TreePlace : TreeStructure {
  S rotation[9];    ///< of a bolted root: its coordinates to world coordinates, row-major
  S offset[3];      ///< the same
  S gravity_share;  ///< of the model's gravity: what most of its moving links have
  S gravity[3];     ///< that share, along the axes of a bolted root; of a floating one, along the world's

  template <class From, class To, class Visit>
  static constexpr void numbers(From& from, To& to, Visit&& visit) {
    visit(from.rotation, to.rotation), visit(from.offset, to.offset);
    visit(from.gravity_share, to.gravity_share), visit(from.gravity, to.gravity);
  }
};

}  // namespace lockstep
