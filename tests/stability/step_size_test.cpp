// Long steps, fast motion and large errors at the start. SPDX-License-Identifier: Apache-2.0
#include "mechanisms.h"
#include "scenes/scenes.h"
#include "watch.h"

namespace lockstep::stability {
namespace {

template <class S>
void follow(Watch<S>& watch, const scenes::Scene& scene, double seconds) {
  watch.run(seconds, [&](double t) {
    const Eigen::VectorXd targets = scene.targets(t);
    for (Eigen::Index dof = 0; dof < targets.size(); ++dof)
      watch.batch.position_targets().row(dof).setConstant(static_cast<S>(targets[dof]));
  });
}

TEST(StepSize, gripper13_and_stiff_drives_hold_at_a_thirtieth_of_a_second) {
  for (const char* name : {"gripper13", "drive1e6", "redundant"}) {
    SCOPED_TRACE(name);
    const scenes::Scene scene = scenes::scene(name);
    with_exact_methods([&](auto scalar, double dt, Method method) {
      using S = decltype(scalar);
      Watch<S> watch(scene.model, recorded(dt, method));
      follow(watch, scene, 3.0);
      expect_sound(watch, 0.1 * height_range(scene.model));
      EXPECT_LE(watch.speed(), 10.0);
    });
  }
}

// Stiff drives follow their targets closely, up to the sag under gravity.
TEST(StepSize, gripper13_is_near_its_targets_at_a_thirtieth_of_a_second) {
  scenes::Scene scene = scenes::scene("gripper13");
  for (Joint& joint : scene.model.joints)
    if (joint.drive.kp > 0.0) joint.drive.kp *= 1e4, joint.drive.kd *= 1e3;
  at_all_steps([&](auto scalar, double dt) {
    using S = decltype(scalar);
    Watch<S> watch(scene.model, recorded(dt));
    follow(watch, scene, 2.0);
    const Eigen::VectorXd targets = scene.targets(2.0);
    for (int dof = 0; dof < 8; ++dof) EXPECT_NEAR(watch.position(dof), targets[dof], 0.02) << dof;
    expect_sound(watch, 0.1 * height_range(scene.model));
  });
}

// With long steps, the whip of 906 J is too fast for an integrator of first order (docs/stability.md). At 1/240 s it
// gains at most half of its energy and at 1/1000 s a tenth. Doubles gain the same, so the integrator is the cause. With
// longer steps it is frozen with a fault at its last good state.
TEST(StepSize, chain32_is_either_bounded_or_frozen_with_a_fault) {
  with_exact_methods([](auto scalar, double dt, Method method) {
    using S = decltype(scalar);
    Watch<S> watch(scenes::chain32(), recorded(dt, method));
    const double start = watch.batch.kinetic_energies()(0, 0);
    watch.run(3.0);
    EXPECT_TRUE(watch.finite());
    if (dt < 1.0 / 200) {
      expect_sound(watch, (dt < 1.0 / 500 ? 0.1 : 0.5) * start);
      return;
    }
    EXPECT_EQ(watch.batch.faults()[0], Fault::diverged);
    const auto frozen = watch.batch.positions().eval();
    watch.run(1.0);
    EXPECT_TRUE(watch.finite());
    EXPECT_TRUE((watch.batch.positions() == frozen).all());
    if (method == Method::automatic) {
      EXPECT_LE(watch.error(), hard_tolerance<S>);
    }
  });
}

// At rest, correcting 0.5 rad moves the links but leaves no velocity, so there is no energy. The errors of the whip are
// corrected as well, unless long steps freeze it. Corrections that move turning masses outwards change their energy, by
// 6 % at the smallest step. At 1/120 s the integrator adds up to the energy at the start.
TEST(StepSize, chain32_returns_from_errors_of_half_a_radian) {
  Model model = scenes::chain32();
  for (const Coupling& coupling : model.couplings)
    model.joints[static_cast<std::size_t>(model.joint_index(coupling.joint))].position = 0.5;
  Model still = model;
  for (Joint& joint : still.joints) joint.velocity = 0.0;
  with_exact_methods([&](auto scalar, double dt, Method method) {
    using S = decltype(scalar);
    Watch<S> resting(still, recorded(dt, method));
    resting.run(2.0);
    expect_sound(resting, 1e-9);
    EXPECT_LE(resting.batch.kinetic_energies()(0, 0), 1e-9);

    Watch<S> whip(model, recorded(dt, method));
    const double start = whip.batch.kinetic_energies()(0, 0);
    whip.run(3.0);
    EXPECT_TRUE(whip.finite());
    if (dt < 1.0 / 100) {
      expect_sound(whip, (dt < 1.0 / 200 ? 0.1 : 1.0) * start);
    } else {
      EXPECT_EQ(whip.batch.faults()[0], Fault::diverged);
    }
  });
}

// With one row and one sweep, the error shrinks by erp per step and never changes its sign.
TEST(StepSize, one_sweep_removes_a_hard_error_without_changing_its_sign) {
  for (Arrangement arrangement : {Arrangement::side_by_side, Arrangement::second_on_first})
    for (Method method : {Method::tgs, Method::pgs}) {
      SCOPED_TRACE(to_string(method));
      Model model = pair(arrangement);
      model.joints[0].position = 0.1;
      at_all_steps([&](auto scalar, double dt) {
        using S = decltype(scalar);
        StepSettings settings = recorded(dt, method);
        settings.iterations = 1;
        Watch<S> watch(model, settings);
        double before = 0.1;
        watch.run(2.0, {}, [&] {
          const double error = watch.batch.coupling_errors()(0, 0);
          ASSERT_LE(error, 0.8 * before + 1e-6);
          ASSERT_GE(error, -1e-6);
          before = error;
        });
        expect_sound(watch, 0.1 * height_range(model));
      });
    }
}

// Four rows of one tree disturb each other, which one sweep does not correct, but the errors still become small.
TEST(StepSize, one_sweep_removes_the_errors_of_chain8) {
  Model model = scenes::chain8();
  model.gravity.setZero();
  for (const Coupling& coupling : model.couplings)
    model.joints[static_cast<std::size_t>(model.joint_index(coupling.joint))].position += 0.1;
  for (Method method : {Method::tgs, Method::pgs})
    at_all_steps([&](auto scalar, double dt) {
      using S = decltype(scalar);
      StepSettings settings = recorded(dt, method);
      settings.iterations = 1;
      Watch<S> watch(model, settings);
      watch.run(10.0);
      EXPECT_LE(watch.batch.coupling_errors().abs().maxCoeff(), 1e-3) << to_string(method);
      EXPECT_TRUE(watch.finite());
    });
}

}  // namespace
}  // namespace lockstep::stability
