// SPDX-License-Identifier: Apache-2.0
#include "tendons.h"

#include <algorithm>

#include "by_name.h"
#include "loops.h"
#include "rules.h"

namespace lockstep {
namespace {

constexpr double least_length = 1e-12;  // m, of a segment with a direction

// A segment in the world.
struct Line {
  int first, second;  // links, -1: the world
  Eigen::Vector3d from, to;
};

Line line_of(const Model& model, const std::vector<Eigen::Isometry3d>& poses, const TendonSegment& segment) {
  const auto link = [&](const std::string& name) { return name.empty() ? -1 : model.link_index(name); };
  const auto in_world = [&](int of, const Eigen::Vector3d& point) -> Eigen::Vector3d {
    return of < 0 ? point : poses[static_cast<std::size_t>(of)] * point;
  };
  const int first = link(segment.first), second = link(segment.second);
  return {first, second, in_world(first, segment.first_point), in_world(second, segment.second_point)};
}

void place_spatial(Model& model) {
  if (std::none_of(model.joints.begin(), model.joints.end(), is_spatial)) return;
  const Trees trees(model);
  const Configuration at = start_of(model, trees);
  const auto joints = static_cast<Eigen::Index>(model.joints.size());
  Eigen::VectorXd velocity = Eigen::VectorXd::Zero(joints + 6 * trees.count());
  for (Eigen::Index j = 0; j < joints; ++j) velocity[j] = model.joints[static_cast<std::size_t>(j)].velocity;
  for (int tree = 0; tree < trees.count(); ++tree)
    for (int half = 0; half < 2; ++half)
      velocity.segment<3>(joints + 6 * tree + 3 * half) =
          trees.roots[tree].pose.linear() * trees.roots[tree].velocity.segment<3>(3 * half);
  for (Joint& joint : model.joints) {
    if (!is_spatial(joint)) continue;
    joint.position = length_of(model, trees, at, joint);
    joint.velocity = length_jacobian(model, trees, at, joint).dot(velocity);
  }
}

}  // namespace

bool has_slack_spring(const Joint& joint) {
  return joint.kind == JointKind::tendon && !is_hard(joint.limit_softness) &&
         (joint.lower > -infinity || joint.upper < infinity);
}

const Joint* tendon_of(const Coupling& coupling, const Model& model) {
  const Joint& follower = model.joints[static_cast<std::size_t>(model.joint_index(coupling.joint))];
  return follower.kind == JointKind::tendon ? &follower : nullptr;
}

void proper_path(const Model& model, const Trees& trees, const Joint& tendon) {
  const std::string element = quoted("joint", tendon.name);
  require(tendon.kind == JointKind::tendon, element, "has a path, and yet is no tendon",
          "make it a tendon, or leave the path empty");
  require(tendon.armature == 0.0, element, "is a tendon with a path, and yet has an armature",
          "leave it 0, or give an armature to the joints that its motor turns");
  bool moves = false;
  for (const TendonSegment& segment : tendon.path) {
    for (const std::string& link : {segment.first, segment.second})
      require(link.empty() ||
                  std::any_of(model.links.begin(), model.links.end(), [&](const Link& l) { return l.name == link; }),
              element, "has a path over link '" + link + "', which does not exist", "correct the name");
    finite(segment.first_point, element, "first point of a segment");
    finite(segment.second_point, element, "second point of a segment");
    finite(segment.share, element, "share of a segment");
    require(segment.share > 0.0, element, "share of a segment is not above 0", "give 1, or 1 / n for n strands");
    moves |= can_move(model, trees, segment.first, segment.second);
  }
  require(moves, element, "has a path whose length nothing changes: no segment joins bodies that move apart",
          "correct the links of its segments, or remove the tendon");
}

double length_of(const Model& model, const Trees& trees, const Configuration& at, const Joint& tendon) {
  const std::vector<Eigen::Isometry3d> poses = link_poses(model, trees, at);
  double length = 0.0;
  for (const TendonSegment& segment : tendon.path) {
    const Line line = line_of(model, poses, segment);
    length += segment.share * (line.to - line.from).norm();
  }
  return length;
}

Eigen::RowVectorXd length_jacobian(const Model& model, const Trees& trees, const Configuration& at,
                                   const Joint& tendon) {
  const std::vector<Eigen::Isometry3d> poses = link_poses(model, trees, at);
  Eigen::RowVectorXd jacobian =
      Eigen::RowVectorXd::Zero(static_cast<Eigen::Index>(model.joints.size()) + 6 * trees.count());
  for (const TendonSegment& segment : tendon.path) {
    const Line line = line_of(model, poses, segment);
    const Eigen::Vector3d between = line.to - line.from;
    if (between.norm() < least_length) continue;
    const Eigen::Vector3d along = segment.share * between.normalized();
    const auto add = [&](int link, const Eigen::Vector3d& point, double sign) {
      if (link >= 0)
        each_motion(model, trees, poses, link, point,
                    [&](Eigen::Index column, const Eigen::Vector3d&, const Eigen::Vector3d& moving) {
                      jacobian[column] += sign * along.dot(moving);
                    });
    };
    add(line.first, line.from, -1.0), add(line.second, line.to, 1.0);
  }
  return jacobian;
}

void place_tendons(Model& model) {
  const ByName joints(model.joints);
  const auto joint_of = [&](const std::string& name) -> Joint& {
    return model.joints[static_cast<std::size_t>(joints.find(name))];
  };
  for (const Coupling& coupling : model.couplings) {
    Joint& tendon = joint_of(coupling.joint);
    if (tendon.kind != JointKind::tendon) continue;
    tendon.position = -coupling.offset;
    tendon.velocity = 0.0;
    for (const CouplingTerm& term : coupling.terms) {
      const Joint& joint = joint_of(term.joint);
      tendon.position -= term.ratio * joint.position;
      tendon.velocity -= term.ratio * joint.velocity;
    }
  }
  place_spatial(model);
}

}  // namespace lockstep
