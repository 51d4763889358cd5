// Poses and velocities of links and sites in one pass, written straight into the array that a policy reads.
// SPDX-License-Identifier: Apache-2.0
#include <lockstep/lockstep.h>

#include <cstdio>

using namespace lockstep;

int main() {
  constexpr int environments = 1024;
  Model model = import_urdf_file(LOCKSTEP_MODELS "/gripper.urdf").model;
  model.joints[model.joint_index("knuckle")].drive = {.kp = 20.0, .kd = 1.0, .position_target = 0.4};
  Pose fingertip = Pose::Identity();
  fingertip.translation() = Eigen::Vector3d(0.0, 0.0, 0.045);  // in the frame of the link, m
  model.add_site("left_fingertip", "left_tip", fingertip);
  model.add_site("right_fingertip", "right_tip", fingertip);
  const Plan plan = compile(model, {.dt = 1.0 / 240});
  Batch<float> batch(plan, environments);
  batch.step(60);

  // One row for each environment: poses of links, velocities of links, positions of sites.
  const int links = static_cast<int>(model.links.size()), sites = static_cast<int>(model.sites.size());
  const Query queries[] = {{Quantity::link_pose}, {Quantity::link_velocity}, {Quantity::site_position}};
  int width = 0;
  for (const Query& query : queries) width += plan.query_rows(query);
  using Observations = Eigen::Array<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Observations observations(environments, width);
  batch.read(queries, {.data = observations.data(), .row_stride = 1, .environment_stride = width});
  std::printf("%d environments, %d numbers each\n", environments, width);
  for (int s = 0; s < sites; ++s) {
    const auto place = observations.row(0).segment(13 * links + 3 * s, 3);
    std::printf("%s at %.3f, %.3f, %.3f m\n", model.sites[s].name.c_str(), place[0], place[1], place[2]);
  }

  // The simple way gives the same numbers, one link at a time, in an array of its own.
  const int palm = plan.link("palm");
  const auto poses = batch.link_poses(palm);  // [7][environments]
  const auto velocities = batch.link_velocities(palm);
  const float pose_difference = (observations.middleCols(7 * palm, 7).transpose() - poses).abs().maxCoeff();
  const float velocity_difference =
      (observations.middleCols(7 * links + 6 * palm, 6).transpose() - velocities).abs().maxCoeff();
  std::printf("the same as link_poses(): %s\n", pose_difference < 1e-6f ? "yes" : "no");
  std::printf("the same as link_velocities(): %s\n", velocity_difference < 1e-6f ? "yes" : "no");
}
