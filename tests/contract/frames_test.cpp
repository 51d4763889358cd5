// read_frames() writes all links and sites into the caller's memory. SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "contract.h"

namespace lockstep {
namespace {

using contract::scattered;

Model with_sites() {
  scenes::RandomOptions options;
  options.root = scenes::RandomOptions::Root::floating;
  options.min_dofs = 6;
  Model model = scenes::random_model(11, options);
  Site turned{"turned", model.links.back().name, Pose::Identity()};
  turned.pose.linear() = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  turned.pose.translation() = Eigen::Vector3d(0.1, -0.2, 0.3);
  model.sites.push_back(turned);
  return model;
}

// Memory of the caller, filled with a number that no readback computes.
template <class S>
struct Memory {
  static constexpr S unwritten = S(-12345);
  Memory(int rows, int environments, std::ptrdiff_t row_stride, std::ptrdiff_t environment_stride)
      : numbers(static_cast<std::size_t>((rows - 1) * row_stride + (environments - 1) * environment_stride + 1),
                unwritten),
        view{numbers.data(), row_stride, environment_stride} {}
  S at(int row, int e) const {
    return numbers[static_cast<std::size_t>(row * view.row_stride + e * view.environment_stride)];
  }
  std::vector<S> numbers;
  StridedRows<S> view;
};

template <class S>
class Frames : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(Frames, Scalars);

TYPED_TEST(Frames, agree_with_the_simple_readbacks_to_the_last_bit) {
  using S = TypeParam;
  const Plan plan = compile(with_sites());
  const int links = static_cast<int>(plan.model().links.size()), sites = static_cast<int>(plan.model().sites.size());
  constexpr int environments = 37;
  for (int threads : {1, 2}) {
    Batch<S> batch = scattered<S>(plan, environments, {.threads = threads});
    batch.step(3);
    // Strides environment by environment, row by row with gaps, and both.
    Memory<S> poses(7 * links, environments, 1, 7 * links), velocities(6 * links, environments, environments + 5, 1),
        site_poses(7 * sites, environments, 3, 7 * 3 * sites + 1),
        site_velocities(6 * sites, environments, environments, 1);
    batch.read_frames({poses.view, velocities.view, site_poses.view, site_velocities.view});
    for (int l = 0; l < links; ++l) {
      const auto pose = batch.link_poses(l), velocity = batch.link_velocities(l);
      for (int e = 0; e < environments; ++e) {
        for (int k = 0; k < 7; ++k) ASSERT_EQ(poses.at(7 * l + k, e), pose(k, e)) << l << " " << e << " " << k;
        for (int k = 0; k < 6; ++k) ASSERT_EQ(velocities.at(6 * l + k, e), velocity(k, e)) << l << " " << e << " " << k;
      }
    }
    for (int s = 0; s < sites; ++s) {
      const auto position = batch.site_positions(s);
      for (int e = 0; e < environments; ++e)
        for (int k = 0; k < 3; ++k) ASSERT_EQ(site_poses.at(7 * s + k, e), position(k, e)) << s << " " << e << " " << k;
    }
  }
}

TEST(FramesOfSites, turn_with_their_links_and_move_by_their_jacobians) {
  const Plan plan = compile(with_sites());
  const int sites = static_cast<int>(plan.model().sites.size());
  constexpr int environments = 5;
  Batch<double> batch = scattered<double>(plan, environments);
  batch.step(2);
  Memory<double> poses(7 * sites, environments, environments, 1), velocities(6 * sites, environments, environments, 1);
  batch.read_frames({.site_poses = poses.view, .site_velocities = velocities.view});
  for (int s = 0; s < sites; ++s) {
    const Site& site = plan.model().sites[static_cast<std::size_t>(s)];
    const auto link = batch.link_poses(plan.link(site.link)), jacobian = batch.site_jacobians(s);
    for (int e = 0; e < environments; ++e) {
      const Eigen::Quaterniond of_link(link(3, e), link(4, e), link(5, e), link(6, e));
      const Eigen::Quaterniond turn(poses.at(7 * s + 3, e), poses.at(7 * s + 4, e), poses.at(7 * s + 5, e),
                                    poses.at(7 * s + 6, e));
      const Eigen::Matrix3d expected = of_link.toRotationMatrix() * site.pose.linear();
      EXPECT_LE((turn.toRotationMatrix() - expected).norm(), 1e-14);
      Eigen::VectorXd v(plan.dofs() + 6);
      v << batch.root_velocities().col(e).matrix(), batch.velocities().col(e).matrix();
      for (int k = 0; k < 6; ++k) {
        double speed = 0.0;
        for (int c = 0; c < v.size(); ++c) speed += jacobian(6 * c + k, e) * v[c];
        EXPECT_NEAR(velocities.at(6 * s + k, e), speed, 1e-12 * (1.0 + std::abs(speed)));
      }
    }
  }
}

TEST(FramesOfOneKind, leave_the_gaps_between_them_unwritten) {
  const Plan plan = compile(with_sites());
  const int links = static_cast<int>(plan.model().links.size());
  constexpr int environments = 19;
  Batch<float> batch = scattered<float>(plan, environments);
  Memory<float> velocities(6 * links, environments, 2 * environments, 2);  // every other number
  batch.read_frames({.link_velocities = velocities.view});
  for (std::size_t i = 1; i < velocities.numbers.size(); i += 2)
    ASSERT_EQ(velocities.numbers[i], Memory<float>::unwritten) << i;
  for (int e = 0; e < environments; ++e) ASSERT_NE(velocities.at(6 * links - 1, e), Memory<float>::unwritten);
  batch.read_frames({});
}

}  // namespace
}  // namespace lockstep
