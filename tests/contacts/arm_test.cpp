// Seven joints and a gripper of five mimics grasp, lift and shake boxes. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <optional>
#include <random>

#include "contact_scenes.h"

namespace lockstep {
namespace {

using namespace contact_scenes;

using Joints = Eigen::Vector<double, 7>;
constexpr const char* arm_joints[] = {"shoulder_yaw", "shoulder_pitch", "upper_roll", "elbow",
                                      "forearm_roll", "wrist_pitch",    "wrist_roll"};
const Joints above{0.0, 0.7066, 0.0, 1.5182, 0.0, 0.9218, 0.0}, around{0.0, 1.0458, 0.0, 1.4403, 0.0, 0.7379, 0.0},
    lifted{0.0, 0.5751, 0.0, 1.5287, 0.0, 0.9791, 0.0};
constexpr double pi = 3.14159265358979323846;

Joints arm_targets(double t) {
  const double shake = ramp(t, 3.5, 4.0);
  Joints arm = above + (around - above) * ramp(t, 0.2, 1.0) + (lifted - around) * ramp(t, 2.0, 3.0);
  arm[0] += 0.25 * shake * std::sin(2 * pi * (t - 3.5));
  arm[1] += 0.05 * shake * std::sin(4 * pi * (t - 3.5));
  arm[6] += 0.30 * shake * std::sin(2.6 * pi * (t - 3.5));
  return arm;
}

/// Half the distance between the pads is 0.014 m + 0.06 m sin(0.5 - knuckle).
double knuckle_at(double half_width) { return 0.5 - std::asin((half_width - 0.014) / 0.06); }

Model scene(const Vector3d& box) {
  Model model = import_urdf_file(LOCKSTEP_MODELS "/arm_gripper.urdf", ImportOptions{.colliders = true}).model;
  const double kp[] = {2000, 4000, 2000, 3000, 1000, 800, 400}, kd[] = {80, 160, 60, 100, 30, 20, 8};
  for (int k = 0; k < 7; ++k) {
    Joint& joint = model.joints[model.joint_index(arm_joints[k])];
    joint.drive = {.kp = kp[k], .kd = kd[k], .position_target = above[k]};
    joint.position = above[k];
  }
  model.joints[model.joint_index("knuckle")].drive = {.kp = 30.0, .kd = 1.0};
  for (Link& link : model.links)
    if (link.name == "box") link.inertia = Inertia::box(0.2, box, Vector3d::Zero());
  for (Collider& collider : model.colliders)
    if (collider.link == "box") collider.shape = Shape::box(box);
  model.roots.back().pose.translation().z() = box.z() / 2;
  model.colliders.push_back({.name = "ground", .shape = Shape::half_space()});
  model.contacts = {{"left_tip", "box"}, {"right_tip", "box"},   {"palm", "box"},
                    {"ground", "box"},   {"ground", "left_tip"}, {"ground", "right_tip"}};
  return model;
}

Eigen::Isometry3d pose_of(const Eigen::Ref<const Eigen::ArrayXd>& numbers) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = numbers.head<3>().matrix();
  pose.linear() = Eigen::Quaterniond(numbers[3], numbers[4], numbers[5], numbers[6]).normalized().toRotationMatrix();
  return pose;
}

template <class S>
void put_targets(double t, double closed, Batch<S>& batch) {
  const Joints arm = arm_targets(t);
  for (int k = 0; k < 7; ++k) batch.position_targets().row(batch.plan().dof(arm_joints[k])) = static_cast<S>(arm[k]);
  batch.position_targets().row(batch.plan().dof("knuckle")) = static_cast<S>(closed * ramp(t, 1.2, 1.6));
}

template <class S>
struct Arms : testing::Test {};
using Precisions = testing::Types<double, float>;
TYPED_TEST_SUITE(Arms, Precisions);

// Eight sizes of boxes, each with eight masses from half to five times that of the file, frictions and starts.
TYPED_TEST(Arms, hold_random_boxes_through_lift_and_shake_with_parallel_fingers) {
  constexpr int each = 8;
  std::mt19937 generator(7);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(generator);
  };
  for (int size = 0; size < 8; ++size) {
    const double z = uniform(0.04, 0.06), y = uniform(0.034, 0.06), x = uniform(0.03, 0.05);
    const Vector3d box(x, y, z);
    const double closed = knuckle_at(box.y() / 2) + 0.18;
    const Plan plan =
        compile(scene(box), {.dt = 1.0 / 240, .per_environment = {Parameter::mass, Parameter::contact_friction}});
    Batch<TypeParam> batch(plan, each, {.threads = 1});
    const auto link = static_cast<Eigen::Index>(plan.model().links.size()) - 1;
    ASSERT_EQ(plan.model().links.back().name, "box");
    for (int e = 0; e < each; ++e) {
      const auto number = [&](double low, double high) { return static_cast<TypeParam>(uniform(low, high)); };
      batch.parameter(Parameter::mass)(link, e) = number(0.1, 1.0);
      batch.parameter(Parameter::contact_friction).col(e) = number(0.5, 1.2);
      batch.root_poses()(0, e) += number(-0.005, 0.005), batch.root_poses()(1, e) += number(-0.005, 0.005);
      const double yaw = uniform(-0.2, 0.2);
      batch.root_poses()(3, e) = static_cast<TypeParam>(std::cos(yaw / 2));
      batch.root_poses()(6, e) = static_cast<TypeParam>(std::sin(yaw / 2));
    }
    const Query queries[] = {{Quantity::root_pose},
                             {Quantity::link_pose, {plan.link("palm")}},
                             {Quantity::link_pose, {plan.link("left_tip")}},
                             {Quantity::link_pose, {plan.link("right_tip")}},
                             {Quantity::contact_gap}};
    Eigen::Array<TypeParam, Eigen::Dynamic, each, Eigen::RowMajor> numbers(28 + plan.query_rows(queries[4]), each);
    std::vector<std::optional<Eigen::Isometry3d>> held(each);
    for (int i = 0; i < 1920; ++i) {
      const double t = (i + 1) / 240.0;
      put_targets(t, closed, batch);
      batch.step(1);
      if (t < 2.0 || i % 12 != 0) continue;
      batch.read(queries, {numbers.data(), each, 1});
      for (int e = 0; e < each; ++e) {
        const Eigen::ArrayXd own = numbers.col(e).template cast<double>();
        const Eigen::Isometry3d palm = pose_of(own.segment<7>(7)), left = palm.inverse() * pose_of(own.segment<7>(14)),
                                right = palm.inverse() * pose_of(own.segment<7>(21)),
                                seen = palm.inverse() * pose_of(own.head<7>());
        const std::string where = "size " + std::to_string(size) + ", box " + std::to_string(e) + ", " +
                                  std::to_string(t) + " s, mass " +
                                  std::to_string(batch.parameter(Parameter::mass)(link, e)) + ", friction " +
                                  std::to_string(batch.parameter(Parameter::contact_friction)(0, e));
        EXPECT_LT(Eigen::AngleAxisd(left.linear()).angle(), 1e-5) << where;
        const Eigen::Matrix3d half_turn = Eigen::AngleAxisd(pi, Vector3d::UnitZ()).toRotationMatrix();
        EXPECT_LT(Eigen::AngleAxisd(half_turn.transpose() * right.linear()).angle(), 1e-5) << where;
        // Both pads stay on their sides of the box, whose faces they touch.
        EXPECT_GT(left.translation().y() - 0.006, seen.translation().y() + box.y() / 2 - 5e-4) << where;
        EXPECT_LT(right.translation().y() + 0.006, seen.translation().y() - box.y() / 2 + 5e-4) << where;
        EXPECT_GT(own.tail(plan.query_rows(queries[4])).minCoeff(), -5e-4) << where;
        if (t < 3.0) continue;
        if (!held[e]) held[e] = seen;
        EXPECT_LT((seen.translation() - held[e]->translation()).norm(), 3e-4) << where;
        EXPECT_GT(own[2], 0.1) << where;
      }
    }
    EXPECT_LT(static_cast<double>(batch.coupling_errors().abs().maxCoeff()), sizeof(TypeParam) == 8 ? 1e-14 : 1e-6);
    for (const Fault fault : batch.faults()) EXPECT_EQ(fault, Fault::none);
  }
}

// Boxes that lie elsewhere are touched at other times, so lanes of a tile go different ways. Limits of efforts act,
// too.
TYPED_TEST(Arms, move_alone_as_beside_others) {
  constexpr int count = 12;
  Model model = scene({0.05, 0.05, 0.05});
  model.joints[model.joint_index("knuckle")].effort_limit = 4.0;
  const Plan plan = compile(model);
  Batch<TypeParam> all(plan, count, {.threads = 1});
  const auto put_box = [](int e, Batch<TypeParam>& batch, int column) {
    batch.root_poses()(1, column) = static_cast<TypeParam>(0.002 * (e % 7 - 3));
    batch.root_poses()(2, column) += static_cast<TypeParam>(0.001 * e);
  };
  for (int e = 0; e < count; ++e) put_box(e, all, e);
  std::vector<Batch<TypeParam>> alone;
  for (const int e : {0, 5, 11}) {
    alone.emplace_back(plan, 1, BatchOptions{.threads = 1});
    put_box(e, alone.back(), 0);
  }
  for (int i = 0; i < 900; ++i) {
    const double t = (i + 1) / 240.0;
    put_targets(t, 0.5, all);
    all.step(1);
    for (Batch<TypeParam>& one : alone) put_targets(t, 0.5, one), one.step(1);
  }
  int i = 0;
  for (const int e : {0, 5, 11}) {
    EXPECT_TRUE((alone[static_cast<std::size_t>(i)].root_poses().col(0) == all.root_poses().col(e)).all()) << e;
    EXPECT_TRUE((alone[static_cast<std::size_t>(i)].positions().col(0) == all.positions().col(e)).all()) << e;
    EXPECT_GT(all.root_poses()(2, e), TypeParam(0.1)) << e;
    ++i;
  }
}

}  // namespace
}  // namespace lockstep
