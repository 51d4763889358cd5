// Bodies in frames whose joint axis is a coordinate axis (M3). SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "model/joint_motion.h"
#include "plan/layout.h"
#include "plan/limits.h"

namespace lockstep {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix;
using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::Vector3d;
using Eigen::Vector4d;

// An axis this close to a coordinate axis is taken as one. No step can tell them apart.
constexpr double axis_tolerance = 1e-12;

void copy(const Matrix3d& from, double (&to)[9]) {
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) to[3 * r + c] = from(r, c);
}

void copy(const Vector3d& from, double (&to)[3]) {
  for (int r = 0; r < 3; ++r) to[r] = from[r];
}

// xx, yy, zz, yz, xz, xy
void copy_symmetric(const Matrix3d& from, double (&to)[6]) {
  for (int k = 0; k < 3; ++k) {
    to[k] = from(k, k);
    to[3 + k] = from((k + 1) % 3, (k + 2) % 3);
  }
}

// (M4): the integral of p p^T dm about the frame's origin, from the rotational inertia about the centre of mass.
Matrix3d second_moment(const Inertia& inertia) {
  return 0.5 * inertia.about_center.trace() * Matrix3d::Identity() - inertia.about_center +
         inertia.mass * inertia.center * inertia.center.transpose();
}

// Chooses the frame of a body. Returns its axes as columns in parent coordinates. The axis must have length 1 to
// rounding: the transpose is used as the inverse, so an error would double from joint to joint.
Matrix3d choose_frame(const Vector3d& axis, Body<double>& body) {
  for (int k = 0; k < 3; ++k) {
    const double along = axis[k];
    if (std::abs(std::abs(along) - 1.0) > axis_tolerance || (axis - along * Vector3d::Unit(k)).norm() > axis_tolerance)
      continue;
    body.axis = k;
    body.sign = along > 0.0 ? 1.0 : -1.0;
    body.rotated = false;
    return Matrix3d::Identity();
  }
  body.axis = 2;
  body.sign = 1.0;
  body.rotated = true;
  Matrix3d axes;
  axes.col(2) = axis;
  axes.col(0) = axis.unitOrthogonal();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return axes;
}

// Chooses the body's origin so that its offset has the fewest components. The origin may be anywhere on the axis of a
// revolute joint. Components that are only rounding become zero. Returns by how much the origin moved along the axis.
double choose_origin(const Vector3d& placed, Body<double>& body) {
  Vector3d offset = placed;
  double along = 0.0;
  if (!body.prismatic && !body.rotated) {
    along = offset[body.axis];
    offset[body.axis] = 0.0;
  }
  for (double& component : offset)
    if (std::abs(component) < axis_tolerance * placed.stableNorm()) component = 0.0;
  copy(offset, body.offset);
  return along;
}

int kind_of(const Body<double>& body) {
  if (body.prismatic) return body.rotated ? turned_sliding_joint : sliding_joint + body.axis;
  if (body.rotated) return turned_joint;
  const bool next = body.offset[(body.axis + 1) % 3] != 0.0, last = body.offset[(body.axis + 2) % 3] != 0.0;
  return 3 * body.axis + (next && last ? both_axes : last ? last_axis : next_axis);
}

// A part of a ball joint. The rotation of the first is constant and comes before its turn.
void place_ball(int part, const Isometry3d& placement, Body<double>& body) {
  body.axis = part;
  body.sign = 1.0;
  body.kind = ball_joint + part;
  body.ball = part == 0 ? 0 : -1;
  body.rotated = part == 0;
  copy(placement.linear().transpose(), body.rotation);
  copy(placement.translation(), body.offset);
}

// Base inertia, (M10): mass on a revolute joint's axis moves with the parent, so it is added to the parent. For a body
// that rotates about a coordinate axis, this removes the mass, one first and one second moment from every step.
void move_masses_inwards(std::vector<Body<double>>& bodies, bool masses_differ) {
  std::vector<Matrix4d> inertia;  // second moment, first moment; first moment, mass
  for (const Body<double>& b : bodies) {
    const double(&s)[6] = b.second, (&h)[3] = b.moment;
    inertia.emplace_back() << s[0], s[5], s[4], h[0], s[5], s[1], s[3], h[1], s[4], s[3], s[2], h[2], h[0], h[1], h[2],
        b.mass;
  }
  for (int b = static_cast<int>(bodies.size()) - 1; b >= 0; --b) {
    Body<double>& body = bodies[b];
    Matrix4d& own = inertia[b];
    if (body.ball >= 0) {  // turns about a point alone
      if (body.parent >= 0) {
        Vector4d place;
        place << Vector3d(body.offset), 1.0;
        inertia[body.parent] += own(3, 3) * place * place.transpose();
      }
      own(3, 3) = 0.0;
    } else if (!body.root && !body.prismatic) {
      const std::array<int, 2> on_axis = {body.axis, 3};
      Matrix<double, 4, 2> line = Matrix<double, 4, 2>::Zero();  // axis and origin in the parent's frame
      line.col(0).head<3>() = Vector3d(body.rotation + 3 * body.axis);
      line.col(1) << Vector3d(body.offset), 1.0;
      if (body.parent >= 0) inertia[body.parent] += line * own(on_axis, on_axis) * line.transpose();
      own(on_axis, on_axis).setZero();
    }
    body.base_mass = own(3, 3);
    copy(Vector3d(own.topRightCorner<3, 1>()), body.base_moment);
    copy_symmetric(own.topLeftCorner<3, 3>(), body.base_second);
    const double* off_diagonal = body.base_second + 3;
    body.diagonal = !masses_differ && off_diagonal[0] == 0.0 && off_diagonal[1] == 0.0 && off_diagonal[2] == 0.0;
    body.leaf = true;
    body.heavy = body.root || body.prismatic;
  }
  for (int b = static_cast<int>(bodies.size()) - 1; b >= 0; --b) {
    if (bodies[b].parent < 0) continue;
    Body<double>& parent = bodies[bodies[b].parent];
    bodies[b].first = parent.leaf;
    parent.leaf = false;
    parent.heavy = parent.heavy || bodies[b].heavy;
  }
}

// A tree moves in the share of gravity that most of its moving links have. Returns the links that have another one.
std::vector<int> share_gravity(const Program& program, std::vector<LinkPlace<double>>& links,
                               std::vector<TreePlace<double>>& trees) {
  std::vector<std::map<double, int>> counts(trees.size());
  std::vector<int> own_weights;
  for (std::size_t i = 0; i < links.size(); ++i) {
    const Link& link = program.model.links[i];
    links[i].gravity_share = link.gravity;
    if (links[i].body < 0 || (link.inertia.mass == 0.0 && !declared(program, Parameter::mass))) continue;
    ++counts[links[i].tree][link.gravity];
    own_weights.push_back(static_cast<int>(i));
  }
  for (std::size_t tree = 0; tree < trees.size(); ++tree) {
    const auto most = std::max_element(counts[tree].begin(), counts[tree].end(),
                                       [](const auto& a, const auto& b) { return a.second < b.second; });
    trees[tree].gravity_share = most == counts[tree].end() ? 1.0 : most->first;
    for (double& component : trees[tree].gravity) component *= trees[tree].gravity_share;
  }
  std::erase_if(own_weights, [&](int l) { return links[l].gravity_share == trees[links[l].tree].gravity_share; });
  return own_weights;
}

struct Frames {
  std::vector<int> body_of_link;         // by carrier link
  std::vector<Isometry3d> link_in_body;  // by carrier link: its frame in the body's
};

}  // namespace

void lay_out_bodies(Program& program, const Trees& trees) {
  const Model& model = program.model;
  Tables<double>& t = program.f64;
  const int links = static_cast<int>(model.links.size());

  // Dofs: the moving joints in the model's order.
  program.dof_of_joint.assign(model.joints.size(), -1);
  program.solver_joint.assign(model.joints.size(), -1);
  for (std::size_t j = 0; j < model.joints.size(); ++j)
    if (model.joints[j].moves()) {
      program.dof_of_joint[j] = static_cast<int>(program.dof_names.size());
      program.dof_names.push_back(model.joints[j].name);
    }

  Frames frames{std::vector<int>(links, -1), std::vector<Isometry3d>(links, Isometry3d::Identity())};
  std::vector<Body<double>> bodies;
  std::vector<TreePlace<double>> places_of_trees;
  std::vector<FloatingRoot> roots;
  std::vector<BallJoint> balls;
  std::vector<int> parents;  // by velocity: the parent's in the mass matrix
  std::vector<int> joint_row, joint_velocity, joint_body;
  auto next_joint = trees.joints_depth_first.begin();
  for (int tree = 0; tree < trees.count(); ++tree) {
    const Root& root = trees.roots[tree];

    // The root's frame in the world. A fixed root has gravity along its own axes, a floating one along the world's.
    TreePlace<double> place{};
    place.root = -1;
    place.first_body = static_cast<int>(bodies.size());
    place.first_joint = static_cast<int>(joint_row.size());
    const Matrix3d rotation = root.pose.linear();
    copy(rotation, place.rotation);
    copy(root.pose.translation(), place.offset);
    copy(root.floating ? model.gravity : (rotation.transpose() * model.gravity).eval(), place.gravity);

    // A floating root is a body with six velocities. In the matrix each is the parent of the next.
    if (root.floating) {
      Body<double> body{};
      body.parent = -1;
      body.tree = tree;
      body.velocity = static_cast<int>(parents.size());
      body.joint = place.root = static_cast<int>(roots.size());
      body.root = true;
      body.ball = -1;
      body.sign = 1.0;
      copy(Matrix3d::Identity(), body.rotation);
      roots.push_back({static_cast<int>(bodies.size()), body.velocity, body.velocity});
      program.root_names.push_back(root.link);
      for (int k = 0; k < 6; ++k) parents.push_back(k == 0 ? -1 : body.velocity + k - 1);
      frames.body_of_link[trees.root_link[tree]] = static_cast<int>(bodies.size());
      bodies.push_back(body);
    }

    // Each moving joint carries a body, whose frame (M3) says where the child link is.
    for (; next_joint != trees.joints_depth_first.end() && trees.tree_of[trees.joint_child[*next_joint]] == tree;
         ++next_joint) {
      const int j = *next_joint;
      const Joint& joint = model.joints[j];
      if (!joint.moves()) continue;
      const int parent_link = trees.joint_parent[j], child = trees.joint_child[j];
      const int carrier = trees.carrier[parent_link];
      const Isometry3d placement = frames.link_in_body[carrier] * trees.in_carrier[parent_link] * joint.origin;
      Body<double> body{};
      body.parent = frames.body_of_link[carrier];
      body.tree = tree;
      body.velocity = static_cast<int>(parents.size());
      body.joint = static_cast<int>(joint_row.size());
      body.prismatic = joint.kind == JointKind::prismatic;
      body.ball = -1;
      if (joint.kind == JointKind::ball) {
        if (is_inner_part(joint)) body.parent = static_cast<int>(bodies.size()) - 1;
        place_ball(part_of_ball(joint), placement, body);
        if (body.ball == 0) {
          body.ball = static_cast<int>(balls.size());
          balls.push_back({static_cast<int>(bodies.size()), body.joint, body.velocity, -1, {}});
        }
        // All of its links move as the last one does.
        frames.body_of_link[child] = static_cast<int>(bodies.size()) + 2 - part_of_ball(joint);
      } else {
        const Matrix3d axes = choose_frame((placement.linear() * joint.axis).normalized(), body);
        copy(axes.transpose(), body.rotation);
        const double along = choose_origin(placement.translation(), body);
        body.kind = kind_of(body);
        frames.link_in_body[child].linear() = axes.transpose() * placement.linear();
        frames.link_in_body[child].translation()[body.axis] = along;
        frames.body_of_link[child] = static_cast<int>(bodies.size());
      }

      // Joints and velocities in the solver's order.
      program.solver_joint[j] = body.joint;
      const Body<double>* const parent = body.parent < 0 ? nullptr : &bodies[body.parent];
      parents.push_back(!parent ? -1 : parent->velocity + (parent->root ? 5 : 0));
      joint_row.push_back(program.dof_of_joint[j]);
      joint_velocity.push_back(body.velocity);
      joint_body.push_back(static_cast<int>(bodies.size()));
      bodies.push_back(body);
    }

    // What users see of the tree, and where it ends.
    std::vector<int> dofs(joint_row.begin() + place.first_joint, joint_row.end());
    std::sort(dofs.begin(), dofs.end());
    program.trees.push_back({root.link, place.root, std::move(dofs)});
    place.last_body = static_cast<int>(bodies.size());
    place.last_joint = static_cast<int>(joint_row.size());
    places_of_trees.push_back(place);
  }

  // A tendon is a sliding body without mass, in a tree of its own.
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    if (model.joints[j].kind != JointKind::tendon) continue;
    TreePlace<double> place{};
    place.root = -1;
    place.first_body = static_cast<int>(bodies.size());
    place.first_joint = static_cast<int>(joint_row.size());
    place.last_body = place.first_body + 1, place.last_joint = place.first_joint + 1;
    copy(Matrix3d::Identity(), place.rotation);
    Body<double> body{};
    body.parent = -1;
    body.tree = static_cast<int>(places_of_trees.size());
    body.velocity = static_cast<int>(parents.size());
    body.joint = place.first_joint;
    body.prismatic = true;
    body.ball = -1;
    body.sign = 1.0;
    copy(Matrix3d::Identity(), body.rotation);
    body.kind = kind_of(body);
    program.solver_joint[j] = body.joint;
    parents.push_back(-1);
    joint_row.push_back(program.dof_of_joint[j]);
    joint_velocity.push_back(body.velocity);
    joint_body.push_back(place.first_body);
    bodies.push_back(body);
    places_of_trees.push_back(place);
  }

  // Links: where they are in their bodies, and their inertia there.
  std::vector<LinkPlace<double>> places(links);
  std::vector<double> masses(links);
  std::vector<Inertia> sums(bodies.size());
  for (int i = 0; i < links; ++i) {
    const int carrier = trees.carrier[i];
    const Isometry3d pose = frames.link_in_body[carrier] * trees.in_carrier[i];
    LinkPlace<double>& place = places[i];
    place.body = frames.body_of_link[carrier];
    place.tree = trees.tree_of[i];
    copy(pose.linear(), place.rotation);
    copy(pose.translation(), place.offset);
    masses[i] = model.links[i].inertia.mass;
    if (carrier != i) ++program.merged_links;

    // Its share of the body's moments (M4), and the same for a mass of 1, for masses per environment.
    const Inertia inertia = transformed(model.links[i].inertia, pose);
    if (place.body >= 0) sums[place.body] = sums[place.body] + inertia;
    Inertia unit = inertia;
    unit.about_center /= inertia.mass > 0.0 ? inertia.mass : 1.0;
    unit.mass = 1.0;
    copy(unit.center, place.unit_moment);
    copy_symmetric(second_moment(unit), place.unit_second);

    // What does not depend on the centre of mass, in the link's own axes (M82).
    Inertia spread = model.links[i].inertia;
    if (declared(program, Parameter::mass)) spread.about_center /= spread.mass > 0.0 ? spread.mass : 1.0;
    spread.mass = 0.0;
    copy_symmetric(second_moment(spread), place.spread);
  }

  // The bodies' moments, their base inertias (M10), and shares of gravity (section 25).
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    bodies[b].mass = sums[b].mass;
    copy(sums[b].mass * sums[b].center, bodies[b].moment);
    copy_symmetric(second_moment(sums[b]), bodies[b].second);
  }
  move_masses_inwards(bodies, has_own_inertias(program));
  t.own_weights = program.storage.keep(share_gravity(program, places, places_of_trees));

  // The tables. Until later stages choose otherwise, the solver factors A over all velocities.
  t.bodies = static_cast<int>(bodies.size());
  t.joints = static_cast<int>(joint_row.size());
  t.velocities = static_cast<int>(parents.size());
  t.links = links;
  t.body = program.storage.keep(std::move(bodies));
  t.tree = program.storage.keep(std::move(places_of_trees));
  t.roots = program.storage.keep(std::move(roots));
  t.balls = program.storage.keep(std::move(balls));
  t.link = program.storage.keep(std::move(places));
  t.link_mass = program.storage.keep(std::move(masses));
  t.dof = program.storage.keep(std::move(joint_row));
  t.joint_velocity = program.storage.keep(std::move(joint_velocity));
  t.joint_body = program.storage.keep(std::move(joint_body));
  if (const long entries = entries_of(parents); entries > std::numeric_limits<int>::max())
    require_room(program, entries, the_mass_matrix);
  t.matrix = t.solver = make_columns(parents, program.storage);
  t.factored = program.storage.keep(std::vector<SupportRun>{{0, t.velocities}});
  copy(model.gravity, t.gravity);
}

}  // namespace lockstep
