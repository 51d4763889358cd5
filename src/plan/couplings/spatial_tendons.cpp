// Spatial tendons as followers of all velocities that change their length. SPDX-License-Identifier: Apache-2.0
//
// Their rows of S differ from step to step: only the pattern is constant, section 43.
#include <algorithm>
#include <set>

#include "model/tendons.h"
#include "plan/layout.h"

namespace lockstep {
namespace {

// Stands for a share in what a plan estimates, where all are 0 at the model's start.
constexpr double some_share = 1.0;

const Joint& joint_at(const Program& program, int joint) {
  const auto found = std::find(program.solver_joint.begin(), program.solver_joint.end(), joint);
  return program.model.joints[static_cast<std::size_t>(found - program.solver_joint.begin())];
}

// How fast the length changes with each velocity at the model's start, followers included.
Eigen::VectorXd by_velocity_at_start(const Program& program, const Trees& trees, const Joint& tendon) {
  const Tables<double>& t = program.f64;
  const Configuration at = start_of(program.model, trees);
  const Eigen::RowVectorXd jacobian = length_jacobian(program.model, trees, at, tendon);
  Eigen::VectorXd by_velocity = Eigen::VectorXd::Zero(t.velocities);
  const auto joints = static_cast<Eigen::Index>(program.model.joints.size());
  for (Eigen::Index j = 0; j < joints; ++j)
    if (const int joint = program.solver_joint[static_cast<std::size_t>(j)]; joint >= 0)
      by_velocity[t.velocity_of(joint)] = jacobian[j];
  int root = 0;
  for (int tree = 0; tree < trees.count(); ++tree) {
    if (!trees.roots[static_cast<std::size_t>(tree)].floating) continue;
    for (int half = 0; half < 2; ++half)
      by_velocity.segment<3>(t.roots[root].velocity + 3 * half) =
          at.root[static_cast<std::size_t>(tree)].linear().transpose() *
          jacobian.segment<3>(joints + 6 * tree + 3 * half).transpose();
    ++root;
  }
  return by_velocity;
}

}  // namespace

bool is_spatial(const Tables<double>& t, int joint) {
  return std::any_of(t.spatial.tendons.data, t.spatial.tendons.data + t.spatial.tendons.count,
                     [&](const SpatialTendon& tendon) { return tendon.joint == joint; });
}

void lay_out_spatial_tendons(Program& program) {
  Tables<double>& t = program.f64;
  std::vector<SpatialTendon> tendons;
  std::vector<Segment<double>> segments;
  for (std::size_t j = 0; j < program.model.joints.size(); ++j) {
    const Joint& joint = program.model.joints[j];
    if (!is_spatial(joint)) continue;
    SpatialTendon tendon{program.solver_joint[j], -1, static_cast<int>(segments.size()), 0};
    for (const TendonSegment& from : joint.path) {
      const auto place = [&](const std::string& link, const Eigen::Vector3d& point) {
        return place_of(program, link, Eigen::Isometry3d(Eigen::Translation3d(point)));
      };
      const BodyPlace first = place(from.first, from.first_point), second = place(from.second, from.second_point);
      Segment<double> segment{};
      segment.first_body = first.body, segment.second_body = second.body;
      for (int k = 0; k < 3; ++k)
        segment.first_point[k] = first.pose.translation()[k], segment.second_point[k] = second.pose.translation()[k];
      segment.share = from.share;
      segments.push_back(segment);
    }
    tendon.last = static_cast<int>(segments.size());
    tendons.push_back(tendon);
  }
  t.spatial.tendons = program.storage.keep(std::move(tendons));
  t.spatial.segments = program.storage.keep(std::move(segments));
}

std::vector<Follower> spatial_followers(const Program& program, const std::vector<Follower>& of_couplings) {
  const Tables<double>& t = program.f64;
  std::vector<Follower> followers;
  if (!t.spatial.used()) return followers;
  const Trees trees(program.model);
  for (int i = 0; i < t.spatial.tendons.count; ++i) {
    const SpatialTendon& tendon = t.spatial.tendons[i];
    const Eigen::VectorXd at_start = by_velocity_at_start(program, trees, joint_at(program, tendon.joint));
    std::map<int, double> shares;  // by independent velocity
    const auto add = [&](int velocity) {
      for (const Follower& follower : of_couplings)
        if (t.velocity_of(follower.joint) == velocity) {
          for (const auto& [leader, share] : follower.shares) shares[leader] += share * at_start[velocity];
          return;
        }
      shares[velocity] += at_start[velocity];
    };
    std::set<int> moving;
    for (int s = tendon.first; s < tendon.last; ++s)
      for (const int velocity :
           velocities_between(t, t.spatial.segments[s].first_body, t.spatial.segments[s].second_body))
        moving.insert(velocity);
    for (const int velocity : moving) add(velocity);
    const bool stands =
        std::all_of(shares.begin(), shares.end(), [](const auto& share) { return share.second == 0.0; });
    for (auto& [velocity, share] : shares)
      if (stands) share = some_share;
    followers.push_back({tendon.joint, {shares.begin(), shares.end()}});
  }
  return followers;
}

void lay_out_spatial_columns(Program& program) {
  Tables<double>& t = program.f64;
  const Reduction<double>& r = t.reduction;
  std::vector<SpatialTendon> tendons(t.spatial.tendons.data, t.spatial.tendons.data + t.spatial.tendons.count);
  std::vector<Segment<double>> segments(t.spatial.segments.data, t.spatial.segments.data + t.spatial.segments.count);
  std::vector<SegmentColumn> columns;
  std::vector<ColumnPart> parts;
  const Forms forms(program, r);
  for (SpatialTendon& tendon : tendons) {
    tendon.follower = r.follower_of[tendon.joint];
    const int *const first = r.column.data + r.start[tendon.follower], *const last =
                                                                           r.column.data + r.start[tendon.follower + 1];
    for (int s = tendon.first; s < tendon.last; ++s) {
      Segment<double>& segment = segments[static_cast<std::size_t>(s)];
      segment.first_column = static_cast<int>(columns.size());
      for (const auto& [z, list] : columns_between(program, forms, segment.first_body, segment.second_body)) {
        const int share = static_cast<int>(std::find(first, last, z) - r.column.data);
        const int part = static_cast<int>(parts.size());
        parts.insert(parts.end(), list.begin(), list.end());
        columns.push_back({share, part, static_cast<int>(parts.size())});
      }
      segment.last_column = static_cast<int>(columns.size());
    }
  }
  t.spatial.tendons = program.storage.keep(std::move(tendons));
  t.spatial.segments = program.storage.keep(std::move(segments));
  t.spatial.columns = program.storage.keep(std::move(columns));
  t.spatial.parts = program.storage.keep(std::move(parts));
}

void take_spatial_tangents(Program& program) {
  const Tables<double>& t = program.f64;
  if (!t.spatial.used()) return;
  const Trees trees(program.model);
  for (int i = 0; i < t.spatial.tendons.count; ++i) {
    const int joint = t.spatial.tendons[i].joint;
    const Joint& tendon = joint_at(program, joint);
    const Eigen::VectorXd at_start = by_velocity_at_start(program, trees, tendon);
    Following& following = program.following[t.dof[joint]];
    following = {{}, length_of(program.model, trees, start_of(program.model, trees), tendon), true};
    std::map<int, double> ratios;
    for (std::size_t j = 0; j < program.model.joints.size(); ++j) {
      const int moved = program.solver_joint[j];
      if (moved < 0 || at_start[t.velocity_of(moved)] == 0.0) continue;
      const int dof = t.dof[moved];
      const double ratio = at_start[t.velocity_of(moved)];
      if (program.following[dof].leaders.empty()) ratios[dof] += ratio;
      for (const Following::Leader& leads : program.following[dof].leaders) ratios[leads.dof] += ratio * leads.ratio;
    }
    for (const auto& [dof, ratio] : ratios) {
      following.leaders.push_back({dof, ratio});
      for (std::size_t j = 0; j < program.model.joints.size(); ++j)
        if (program.dof_of_joint[j] == dof) following.offset -= ratio * program.model.joints[j].position;
    }
    program.follower_dofs.push_back(t.dof[joint]);
  }
}

}  // namespace lockstep
