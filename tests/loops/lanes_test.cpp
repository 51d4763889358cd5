// Loops of environments that differ: switches, frames, masses; the same bits wherever an environment stands.
// SPDX-License-Identifier: Apache-2.0
#include <limits>

#include "loop_runs.h"

namespace lockstep {
namespace {

using namespace loop_models;
using namespace loop_runs;

// A box that floats and is welded to the world, or to a hand.
Model held_box(LoopKind kind = LoopKind::weld) {
  Model model = on_ground("held_box");
  model.links.push_back({"box", Inertia::box(2.0, {0.1, 0.2, 0.3}, {0.05, 0.0, 0.0})});
  model.roots.push_back({.link = "box", .floating = true, .pose = loop_models::at(Vector3d(0.3, -0.2, 1.0))});
  Loop loop;
  loop.name = "hold", loop.kind = kind, loop.second = "box";
  loop.first_pose = model.roots.back().pose;
  model.loops = {loop};
  return model;
}

StepSettings varied(Integrator integrator, std::initializer_list<Parameter> fields) {
  StepSettings s = settings(integrator);
  for (const Parameter field : fields) s.per_environment.insert(field);
  return s;
}

TEST(LoopSwitch, lets_a_held_body_fall_in_its_environment_alone) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    const Model model = held_box();
    Batch<double> batch(compile(model, varied(integrator, {Parameter::loop_switch})), 3, {.threads = 1});
    batch.parameter(Parameter::loop_switch)(0, 1) = 0.0;
    batch.step(240);
    const double fallen = batch.root_poses()(2, 1) - 1.0;
    EXPECT_NEAR(fallen, -0.5 * 9.81, integrator == Integrator::euler ? 0.03 : 1e-9);
    for (const int held : {0, 2}) {
      EXPECT_NEAR(batch.root_poses()(2, held), 1.0, 1e-12);
      EXPECT_LT(batch.root_velocities().col(held).abs().maxCoeff(), 1e-12);
    }
    // Held again where it is let go: it is pulled to its frame, no faster than loops close.
    batch.parameter(Parameter::loop_switch)(0, 1) = 1.0;
    batch.step(24);
    EXPECT_GT(batch.root_poses()(2, 1), 1.0 + fallen - 1e-9);
    batch.step(1200);
    EXPECT_NEAR(batch.root_poses()(2, 1), 1.0, 1e-9);
    EXPECT_EQ(batch.faulted(), 0);
  }
}

TEST(LoopSwitch, opens_its_own_loop_alone) {
  Model model = held_box();
  model.links.push_back({"other", Inertia::box(1.0, {0.1, 0.1, 0.1}, Vector3d::Zero())});
  model.roots.push_back({.link = "other", .floating = true, .pose = loop_models::at(Vector3d(-0.3, 0.4, 2.0))});
  Loop second = model.loops[0];
  second.name = "second", second.second = "other", second.first_pose = model.roots.back().pose;
  model.loops.push_back(second);
  Batch<double> batch(compile(model, varied(Integrator::euler, {Parameter::loop_switch})), 4, {.threads = 1});
  const auto is_on = [](int loop, int e) { return (e >> loop & 1) == 1; };
  for (int e = 0; e < 4; ++e)
    for (int loop = 0; loop < 2; ++loop) batch.parameter(Parameter::loop_switch)(loop, e) = is_on(loop, e) ? 1.0 : 0.0;
  constexpr int steps = 120;
  batch.step(steps);
  const double fall = 9.81 / (240.0 * 240.0) * steps * (steps + 1) / 2;  // of semi-implicit Euler
  for (int e = 0; e < 4; ++e)
    for (int loop = 0; loop < 2; ++loop)
      EXPECT_NEAR(batch.root_poses()(7 * loop + 2, e), 1.0 + loop - (is_on(loop, e) ? 0.0 : fall), 1e-9)
          << loop << " " << e;
}

// The frame of the world is an input: a body follows it, each environment its own.
TEST(LoopFrame, carries_a_welded_body_along) {
  Batch<double> batch(compile(held_box(), varied(Integrator::euler, {Parameter::loop_frame})), 5, {.threads = 1});
  auto frame = batch.parameter(Parameter::loop_frame);
  for (int i = 1; i <= 480; ++i) {
    for (int e = 0; e < 5; ++e) {
      const double angle = 0.1 * (e + 1) * i / 240.0;
      frame(0, e) = 0.3 + 0.05 * e * i / 240.0;
      frame(3, e) = 3.0 * std::cos(0.5 * angle), frame(6, e) = 3.0 * std::sin(0.5 * angle);  // any length
    }
    batch.step(1);
    for (int e = 0; e < 5; ++e) {
      ASSERT_NEAR(batch.root_poses()(0, e), frame(0, e), 1e-3) << i << " " << e;
      ASSERT_NEAR(batch.root_poses()(6, e) / batch.root_poses()(3, e), frame(6, e) / frame(3, e), 1e-3);
    }
  }
  EXPECT_EQ(batch.faulted(), 0);
  EXPECT_THROW(compile(held_box(), varied(Integrator::leapfrog, {Parameter::loop_frame})), SettingsError);
}

// It has the velocity of the frame, too, and flies on with it when it is let go.
TEST(LoopFrame, gives_its_velocity_to_the_body) {
  Batch<double> batch(compile(held_box(), varied(Integrator::euler, {Parameter::loop_frame, Parameter::loop_switch})),
                      5, {.threads = 1});
  auto frame = batch.parameter(Parameter::loop_frame);
  const Eigen::Array<double, 1, 5> start = frame.row(0);
  const auto speed = [](int e) { return 0.05 + 0.6 * e; };  // m/s and rad/s
  for (int i = 1; i <= 240; ++i) {
    for (int e = 0; e < 5; ++e) {
      const double half = 0.5 * speed(e) * i / 240.0;
      frame(0, e) = start[e] + 2.0 * half;
      frame(3, e) = std::cos(half), frame(6, e) = std::sin(half);
    }
    batch.step(1);
  }
  for (int e = 0; e < 5; ++e) {
    EXPECT_NEAR(batch.root_velocities()(2, e), speed(e), 0.01 * speed(e)) << e;
    EXPECT_NEAR(batch.root_velocities().col(e).tail(3).matrix().norm(), speed(e), 0.01 * speed(e)) << e;
  }
  batch.parameter(Parameter::loop_switch).setZero();
  batch.step(1);
  for (int e = 0; e < 5; ++e) EXPECT_NEAR(batch.root_velocities()(2, e), speed(e), 0.01 * speed(e)) << e;
}

// The axis of a hinge follows a frame that tilts, to another side in each environment.
TEST(LoopFrame, carries_the_axis_of_a_hinge_along) {
  constexpr int environments = 6;
  Batch<double> batch(compile(held_box(LoopKind::hinge), varied(Integrator::euler, {Parameter::loop_frame})),
                      environments, {.threads = 1});
  auto frame = batch.parameter(Parameter::loop_frame);
  const auto axis_of = [](const auto& rows, int e) {
    return Eigen::Quaterniond(rows(3, e), rows(4, e), rows(5, e), rows(6, e)).normalized() * Vector3d::UnitZ();
  };
  for (int i = 1; i <= 240; ++i) {
    for (int e = 0; e < environments; ++e) {
      const double half = 0.25 * i / 240.0;
      frame(3, e) = std::cos(half), frame(4, e) = std::sin(half) * std::cos(e),
               frame(5, e) = std::sin(half) * std::sin(e);
    }
    batch.step(1);
    for (int e = 0; e < environments; ++e) {
      const Vector3d body = axis_of(batch.root_poses(), e), given = axis_of(frame, e);
      ASSERT_LT((body - given).norm(), 2e-3) << i << " " << e;
    }
  }
  EXPECT_EQ(batch.faulted(), 0);
}

TEST(LoopFrame, without_a_turn_is_a_bad_value) {
  Batch<float> batch(compile(held_box(), varied(Integrator::euler, {Parameter::loop_frame})), 3, {.threads = 1});
  batch.parameter(Parameter::loop_frame).col(1).tail(4).setZero();
  ASSERT_FALSE(batch.check().empty());
  EXPECT_NE(batch.check()[0].element.find("hold"), std::string::npos);
  batch.step(1);
  EXPECT_EQ(batch.faults()[0], Fault::none);
  EXPECT_EQ(batch.faults()[1], Fault::bad_value);
  EXPECT_EQ(batch.faults()[2], Fault::none);
}

// Environments of a gripper with all that differs.
template <class S>
void differ(Batch<S>& batch, int first) {
  for (int e = 0; e < batch.environments(); ++e) {
    const double share = 0.07 * ((first + e) % 9);
    batch.parameter(Parameter::mass).col(e) *= static_cast<S>(1.0 + share);
    batch.parameter(Parameter::loop_switch)(0, e) = (first + e) % 4 == 3 ? S(0) : S(1);
    for (int dof = 0; dof < batch.plan().dofs(); ++dof)
      batch.efforts()(dof, e) = static_cast<S>(0.002 * std::sin(first + e + 3.0 * dof));
  }
}

template <class S>
void expect_same_environment(const Batch<S>& a, int in_a, const Batch<S>& b, int in_b) {
  EXPECT_TRUE((a.positions().col(in_a) == b.positions().col(in_b)).all()) << in_a << " " << in_b;
  EXPECT_TRUE((a.velocities().col(in_a) == b.velocities().col(in_b)).all()) << in_a << " " << in_b;
}

TEST(LoopBatch, has_the_same_bits_for_any_place_and_any_threads) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    const Plan plan = compile(gripper(), varied(integrator, {Parameter::mass, Parameter::loop_switch}));
    constexpr int count = 37;
    Batch<float> all(plan, count, {.threads = 3});
    differ(all, 0);
    all.step(300);
    for (const int first : {0, 5, 18}) {
      Batch<float> some(plan, 7, {.threads = 1});
      differ(some, first);
      for (int i = 0; i < 300; ++i) some.step(1);
      for (int e = 0; e < 7; ++e) expect_same_environment(some, e, all, first + e);
    }
    EXPECT_EQ(all.faulted(), 0);
  }
}

TEST(LoopBatch, keeps_neighbours_of_a_broken_environment_to_the_last_bit) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    const Plan plan = compile(gripper(), varied(integrator, {Parameter::mass, Parameter::loop_switch}));
    Batch<double> sound(plan, 9, {.threads = 1}), broken(plan, 9, {.threads = 1});
    differ(sound, 0), differ(broken, 0);
    sound.step(50), broken.step(50);
    broken.velocities()(2, 4) = std::numeric_limits<double>::quiet_NaN();
    broken.positions()(1, 6) = 1e300;
    sound.step(100), broken.step(100);
    for (int e = 0; e < 9; ++e)
      if (e != 4 && e != 6) expect_same_environment(sound, e, broken, e);
    EXPECT_NE(broken.faults()[4], Fault::none);
    EXPECT_NE(broken.faults()[6], Fault::none);
  }
}

TEST(LoopBatch, goes_on_from_a_save_with_the_same_bits) {
  const Plan plan = compile(gripper(), varied(Integrator::leapfrog, {Parameter::mass, Parameter::loop_switch}));
  Batch<float> one(plan, 6, {.threads = 1}), other(plan, 6, {.threads = 1});
  differ(one, 0);
  one.step(100);
  other.restore(one.save());
  one.step(100), other.step(100);
  for (int e = 0; e < 6; ++e) expect_same_environment(one, e, other, e);
}

// From anywhere near, each environment to its own frame.
TEST(LoopBatch, is_closed_by_project) {
  Batch<double> batch(compile(held_box(LoopKind::point), varied(Integrator::euler, {Parameter::loop_frame})), 4,
                      {.threads = 1});
  for (int e = 0; e < 4; ++e) {
    batch.parameter(Parameter::loop_frame)(1, e) = 0.1 * e;
    batch.root_velocities()(3, e) = 1.0, batch.root_velocities()(0, e) = 2.0;
  }
  EXPECT_TRUE(batch.project().empty());
  EXPECT_LT(batch.loop_errors().abs().maxCoeff(), 1e-12);
  for (int e = 0; e < 4; ++e) {
    EXPECT_NEAR(batch.root_poses()(1, e), 0.1 * e, 1e-12);
    EXPECT_NEAR(batch.root_velocities()(3, e), 0.0, 1e-12);  // of the point that is held
    EXPECT_NEAR(batch.root_velocities()(0, e), 2.0, 1e-12);  // it may turn about it
  }
}

// Velocities alone are wrong: the tendon follows what the loop makes of them.
TEST(LoopBatch, takes_tendons_along_when_velocities_are_projected) {
  Model model = four_bar();
  Joint& tendon = model.joints.emplace_back();
  tendon.name = "tendon", tendon.kind = JointKind::tendon;
  model.couplings.push_back({"tendon", {{"crank", -1.0}, {"rocker", -0.5}}, 0.0, Hard{}});
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    Batch<double> batch(compile(model, settings(integrator)), 3, {.threads = 1});
    batch.project();
    const Batch<double>::Array positions = batch.positions();
    for (int e = 0; e < 3; ++e) batch.velocities()(0, e) += 2.0 + e;
    EXPECT_TRUE(batch.project().empty());
    EXPECT_TRUE((batch.positions() == positions).all());
    const auto speed = batch.velocities();
    for (int e = 0; e < 3; ++e) {
      EXPECT_GT(std::abs(speed(0, e) - 15.0), 0.1);
      EXPECT_NEAR(speed(3, e), speed(0, e) + 0.5 * speed(2, e), 1e-12);
    }
  }
}

TEST(LoopBatch, of_a_linkage_is_closed_by_a_reset_and_tells_what_cannot_be) {
  Batch<double> batch(compile(gripper(), settings(Integrator::leapfrog)), 3, {.threads = 1});
  Batch<double>::Array q = batch.positions(), v = batch.velocities();
  q.row(1) += 0.15, q.row(2) -= 0.1, v.row(0) = 0.3;
  const int ids[] = {0, 1, 2};
  EXPECT_TRUE(batch.reset(ids, q, v).empty());
  EXPECT_LT(batch.loop_errors().abs().maxCoeff(), 1e-11);
  EXPECT_LT(batch.coupling_errors().abs().maxCoeff(), 1e-11);
  const double before = batch.loop_errors().maxCoeff();
  batch.step(1);
  EXPECT_LT(batch.loop_errors().maxCoeff(), before + 1e-6);  // velocities keep it closed, too

  Model apart = four_bar();
  Batch<double> far(compile(apart, varied(Integrator::euler, {Parameter::loop_frame})), 2, {.threads = 1});
  far.parameter(Parameter::loop_frame)(1, 1) = 2.0;  // out of the plane
  const std::vector<UnmetCoupling> unmet = far.project();
  ASSERT_EQ(unmet.size(), 1u);
  EXPECT_EQ(unmet[0].environment, 1);
  EXPECT_EQ(unmet[0].coupling, -1);
  EXPECT_EQ(unmet[0].loop, 0);
  EXPECT_NEAR(unmet[0].error, 2.0, 1e-6);
}

// A loop's second error is the angle, also where that is large.
TEST(LoopBatch, tells_the_angle_that_it_is_open_by) {
  const Plan plan = compile(held_box(), varied(Integrator::euler, {Parameter::loop_frame}));
  Batch<double> batch(plan, 4, {.threads = 1});
  Batch<float> single(plan, 4, {.threads = 1});
  const double angles[] = {0.0, 1.0, 2.0, 3.1};
  for (int e = 0; e < 4; ++e) {
    const Eigen::Vector4d pose = batch.root_poses().col(e).segment(3, 4).matrix();
    const Eigen::Quaterniond turned = Eigen::Quaterniond(pose[0], pose[1], pose[2], pose[3]) *
                                      Eigen::AngleAxisd(angles[e], Eigen::Vector3d(1, 2, 2) / 3.0);
    batch.root_poses().col(e).segment(3, 4) << turned.w(), turned.x(), turned.y(), turned.z();
    single.root_poses().col(e) = batch.root_poses().col(e).cast<float>();
  }
  const Query query{Quantity::loop_error, {0, 0}};  // once more
  Batch<double>::Array all(4, 4);
  batch.read(std::span(&query, 1), {all.data(), 4, 1});
  for (int e = 0; e < 4; ++e) {
    EXPECT_NEAR(batch.loop_errors()(1, e), angles[e], 1e-7);
    EXPECT_NEAR(single.loop_errors()(1, e), angles[e], 1e-3);
    for (const int row : {1, 3}) EXPECT_EQ(all(row, e), batch.loop_errors()(1, e));
  }
}

}  // namespace
}  // namespace lockstep
