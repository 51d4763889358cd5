// Views, inputs, resets and moves of a Batch. SPDX-License-Identifier: Apache-2.0
#include "lockstep/batch.h"

#include <optional>

#include "contract.h"

namespace lockstep {
namespace {

using contract::same_bits;
using contract::scattered;
using contract::serial;

// ---------------------------------------------------------------- views

TEST(Views, have_a_row_per_dof_in_the_order_of_the_models_joints) {
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    SCOPED_TRACE(seed);
    const Model model = scenes::random_model(seed);  // half of the models list their joints in random order
    const Plan plan = compile(model, {.per_environment = contract::all_parameters(Method::direct)});
    Batch<double> batch(plan, 5, serial);
    int row = 0;
    for (const Joint& joint : model.joints) {
      if (!joint.moves()) continue;
      EXPECT_EQ(plan.dof(joint.name), row);
      EXPECT_TRUE((batch.positions().row(row) == joint.position).all());
      EXPECT_TRUE((batch.velocities().row(row) == joint.velocity).all());
      EXPECT_TRUE((batch.position_targets().row(row) == joint.drive.position_target).all());
      EXPECT_TRUE((batch.velocity_targets().row(row) == joint.drive.velocity_target).all());
      EXPECT_TRUE((batch.efforts().row(row) == joint.effort).all());
      EXPECT_TRUE((batch.parameter(Parameter::drive_gains).row(2 * row) == joint.drive.kp).all());
      EXPECT_TRUE((batch.parameter(Parameter::drive_gains).row(2 * row + 1) == joint.drive.kd).all());
      EXPECT_TRUE((batch.parameter(Parameter::damping).row(row) == joint.damping).all());
      ++row;
    }
    EXPECT_EQ(plan.dofs(), row);
    for (auto view :
         {batch.positions(), batch.velocities(), batch.position_targets(), batch.velocity_targets(), batch.efforts()}) {
      EXPECT_EQ(view.rows(), row);
      EXPECT_EQ(view.cols(), 5);
    }
    const int root = model.roots[0].floating;
    EXPECT_EQ(batch.root_poses().rows(), 7 * root);
    EXPECT_EQ(batch.root_velocities().rows(), 6 * root);
    int gear = 0;
    for (int c = 0; c < plan.couplings(); ++c) {
      const Coupling& coupling = model.couplings[static_cast<std::size_t>(c)];
      for (const CouplingTerm& term : coupling.terms)
        EXPECT_TRUE((batch.parameter(Parameter::gear_ratio).row(gear++) == term.ratio).all());
      EXPECT_TRUE((batch.parameter(Parameter::offset).row(c) == coupling.offset).all());
      EXPECT_TRUE((batch.parameter(Parameter::softness).row(2 * c) == numbers_of(coupling.softness).first).all());
      EXPECT_TRUE((batch.parameter(Parameter::softness).row(2 * c + 1) == numbers_of(coupling.softness).second).all());
    }
    for (std::size_t l = 0; l < model.links.size(); ++l)
      EXPECT_TRUE((batch.parameter(Parameter::mass).row(static_cast<int>(l)) == model.links[l].inertia.mass).all());
    for (int k = 0; k < 3; ++k) EXPECT_TRUE((batch.parameter(Parameter::gravity).row(k) == model.gravity[k]).all());
    for (std::size_t l = 0; l < model.links.size(); ++l) {
      const Inertia& inertia = model.links[l].inertia;
      const auto tensor = batch.parameter(Parameter::inertia).col(0).segment(6 * static_cast<Eigen::Index>(l), 6);
      const auto center =
          batch.parameter(Parameter::center_of_mass).col(0).segment(3 * static_cast<Eigen::Index>(l), 3);
      for (int k = 0; k < 3; ++k) EXPECT_EQ(center[k], inertia.center[k]);
      const Eigen::Matrix3d& about = inertia.about_center;
      const double all[] = {about(0, 0), about(1, 1), about(2, 2), about(0, 1), about(0, 2), about(1, 2)};
      for (int k = 0; k < 6; ++k) EXPECT_EQ(tensor[k], all[k]);
    }
    EXPECT_TRUE((batch.parameter(Parameter::link_wrench) == 0.0).all());
    for (unsigned p = 0; p < parameter_count; ++p) {
      const Parameter parameter = static_cast<Parameter>(p);
      if (parameter == Parameter::friction) continue;  // not declared
      EXPECT_EQ(batch.parameter(parameter).rows(), plan.parameter_rows(parameter)) << to_string(parameter);
      EXPECT_EQ(batch.parameter(parameter).cols(), 5);
    }
  }
}

TEST(Views, are_all_the_memory_of_an_environment) {
  StepSettings settings;
  settings.per_environment = {Parameter::mass, Parameter::gravity};
  settings.record_impulses = settings.record_diagnostics = true;
  const Plan plan = compile(scenes::chain32(), settings);
  Batch<double> batch(plan, 2, serial);
  Eigen::Index rows = batch.coupling_impulses().rows() + batch.row_residuals().rows() + batch.row_states().rows() +
                      batch.energy_balances().rows() + batch.angles().rows() + 2;  // what the audit of energy keeps
  for (auto view : {batch.positions(), batch.velocities(), batch.root_poses(), batch.root_velocities(),
                    batch.position_targets(), batch.velocity_targets(), batch.efforts(),
                    batch.parameter(Parameter::mass), batch.parameter(Parameter::gravity)})
    rows += view.rows();
  constexpr long counts = 4 + 8 + 3 * 4 + 8;  // fault, its place; steps, resets, id; seed
  EXPECT_EQ(plan.bytes_per_environment(8), 8 * rows + counts);
  EXPECT_EQ(plan.bytes_per_environment(4), 4 * rows + counts);
}

TEST(Views, stay_where_they_are_and_have_contiguous_rows) {
  Batch<float> batch(compile(scenes::chain8()), 37, serial);
  auto positions = batch.positions();
  EXPECT_EQ(positions.innerStride(), 1);
  EXPECT_GE(positions.outerStride(), 37);
  positions.row(3).setLinSpaced(0.0f, 0.36f);
  EXPECT_EQ(&batch.positions()(3, 5), &positions(3, 5));
  EXPECT_NEAR(batch.positions()(3, 36), 0.36f, 1e-7f);
  batch.step();
  batch.reset();
  EXPECT_EQ(batch.positions().data(), positions.data());
  EXPECT_EQ(positions(3, 36), 0.3f);
  const Batch<float>& constant = batch;
  EXPECT_EQ(constant.positions().data(), positions.data());
}

// A floating box starts turned by 90 degrees about z. One environment slides along its own x axis, the other turns
// about its own z axis.
TEST(Views, follow_the_conventions_of_a_floating_root) {
  Model model = scenes::chain32();
  model.couplings.clear(), model.joints.clear(), model.links.resize(1);
  model.roots[0].pose.rotate(Eigen::AngleAxisd(std::acos(0.0), Eigen::Vector3d::UnitZ()));
  model.roots[0].pose.translation() = Eigen::Vector3d(1, 2, 3);
  model.roots[0].velocity << 0, 0, 0, 0.5, 0, 0;
  StepSettings settings;
  settings.dt = 0.01;
  Batch<double> batch(compile(model, settings), 2, serial);
  const double half = std::sqrt(0.5), expected[7] = {1, 2, 3, half, 0, 0, half};
  for (int i = 0; i < 7; ++i) EXPECT_NEAR(batch.root_poses()(i, 0), expected[i], 1e-15);
  EXPECT_EQ(batch.root_velocities()(3, 1), 0.5);

  batch.root_velocities().col(1) << 0.0, 0.0, 1.0, 0.0, 0.0, 0.0;
  batch.step(100);
  EXPECT_NEAR(batch.root_poses()(0, 0), 1.0, 1e-12);  // its x axis is the world's y
  EXPECT_NEAR(batch.root_poses()(1, 0), 2.5, 1e-12);
  EXPECT_NEAR(batch.root_velocities()(3, 0), 0.5, 1e-12);
  const double angle = std::acos(0.0) + 1.0;  // after 1 s at 1 rad/s
  const Eigen::Vector4d turned = batch.root_poses().col(1).tail(4).matrix();
  EXPECT_NEAR(std::abs(turned.dot(Eigen::Vector4d(std::cos(angle / 2), 0, 0, std::sin(angle / 2)))), 1.0, 1e-12);
}

// ---------------------------------------------------------------- inputs

TEST(Inputs, are_held_and_read_in_every_step) {
  Model model = scenes::chain8();
  model.couplings.clear();
  model.gravity.setZero();
  for (Joint& joint : model.joints) joint.position = 0.0, joint.drive = {200.0, 30.0, 0.0, 0.0};
  Batch<double> batch(compile(model), 3, serial);
  batch.position_targets().row(4) << 0.1, -0.2, 0.3;
  batch.efforts()(6, 1) = 4.0;
  batch.step(240 * 20);
  for (int e = 0; e < 3; ++e) EXPECT_NEAR(batch.positions()(4, e), batch.position_targets()(4, e), 1e-9);
  EXPECT_NEAR(batch.positions()(6, 1), 4.0 / 200.0, 1e-9);
  EXPECT_EQ(batch.position_targets()(4, 2), 0.3);
  EXPECT_EQ(batch.efforts()(6, 1), 4.0);
}

TEST(Inputs, become_the_models_in_a_reset_unless_they_are_kept) {
  const Plan plan = compile(scenes::gripper13(), {.per_environment = {Parameter::mass}});
  Batch<double> batch = scattered<double>(plan, 4);
  const auto targets = batch.position_targets().eval(), efforts = batch.efforts().eval();
  const auto masses = batch.parameter(Parameter::mass).eval();
  batch.step(3);
  batch.reset(EnvironmentSet::all(), {.keep_inputs = true});
  EXPECT_TRUE((batch.position_targets() == targets).all());
  EXPECT_TRUE((batch.efforts() == efforts).all());
  EXPECT_TRUE((batch.parameter(Parameter::mass) == masses).all());
  const std::vector<int> ids = {2};
  batch.reset(ids);
  Batch<double> initial(plan, 1, serial);
  for (int e = 0; e < 4; ++e) {
    EXPECT_EQ((batch.position_targets().col(e) == initial.position_targets().col(0)).all(), e == 2);
    EXPECT_EQ((batch.efforts().col(e) == initial.efforts().col(0)).all(), e == 2);
  }
  EXPECT_TRUE((batch.parameter(Parameter::mass) == masses).all());
}

TEST(Decimation, gives_the_bits_of_single_steps_with_the_same_inputs) {
  const Plan plan = compile(scenes::gripper13());
  Batch<float> decimated = scattered<float>(plan, 5), every = scattered<float>(plan, 5);
  for (int control = 0; control < 4; ++control) {
    const float target = 0.1f * static_cast<float>(control);
    for (Batch<float>* batch : {&decimated, &every}) batch->position_targets().row(7).setConstant(target);
    decimated.step(3);
    for (int i = 0; i < 3; ++i) every.step();
  }
  EXPECT_TRUE(same_bits(decimated, every));
}

// ---------------------------------------------------------------- reset

TEST(Reset, brings_back_the_models_state) {
  for (const Model& model : {scenes::chain8(), scenes::chain32()}) {
    const Plan plan = compile(model);
    const Batch<double> initial(plan, 1, serial);
    Batch<double> batch = scattered<double>(plan, 6);
    batch.step(2);
    const Batch<double>& before = batch;
    const std::vector<double> third = contract::outcome(before, 3);
    const int ids[] = {5, 0};
    batch.reset(ids);
    for (int e : ids) EXPECT_TRUE(same_bits(batch, e, initial, 0));
    EXPECT_TRUE(same_bits(contract::outcome(batch, 3), third)) << "the others must keep their state";
    const bool mask[] = {false, true, false, false, false, false};
    batch.reset(mask);
    EXPECT_TRUE(same_bits(batch, 1, initial, 0));
    EXPECT_TRUE(same_bits(contract::outcome(batch, 3), third));
    batch.reset();
    for (int e = 0; e < 6; ++e) EXPECT_TRUE(same_bits(batch, e, initial, 0));
  }
}

TEST(Reset, takes_one_column_of_given_states_per_environment) {
  Batch<float> batch(compile(scenes::chain8()), 6, serial);
  Batch<float>::Array positions(8, 2), velocities(8, 2);
  positions.setRandom(), velocities.setRandom();
  const int ids[] = {4, 1};
  batch.step(2);
  batch.reset(ids, positions, velocities, {.project = Couplings::none});
  for (int i = 0; i < 2; ++i) {
    EXPECT_TRUE((batch.positions().col(ids[i]) == positions.col(i)).all());
    EXPECT_TRUE((batch.velocities().col(ids[i]) == velocities.col(i)).all());
  }
}

// ---------------------------------------------------------------- moves and size

TEST(Batch, keeps_its_state_views_and_plan_when_moved) {
  Batch<double> first = scattered<double>(compile(scenes::gripper13()), 9);
  const Batch<double> twin = scattered<double>(compile(scenes::gripper13()), 9);
  const double* positions = first.positions().data();
  Batch<double> second = std::move(first);
  EXPECT_EQ(second.positions().data(), positions);
  EXPECT_TRUE(same_bits(second, twin));
  EXPECT_EQ(second.plan().dofs(), 13);
  first = Batch<double>(compile(scenes::chain8()), 2, serial);  // a moved-from batch may be assigned to
  first.step();
  EXPECT_EQ(first.environments(), 2);
  second = std::move(first);
  second.step();
  EXPECT_EQ(second.plan().dofs(), 8);
}

TEST(Batch, outlives_the_plan_that_it_was_made_of) {
  std::optional<Plan> plan = compile(scenes::chain8());
  Batch<float> batch(*plan, 9, serial);
  plan.reset();
  batch.step();
  EXPECT_EQ(batch.plan().model().name, "chain8");
  EXPECT_EQ(batch.faulted(), 0);
}

TEST(Batch, steps_each_of_262144_environments_independently) {
  constexpr int environments = 262144;
  const Plan plan = compile(scenes::chain8());
  Batch<float> huge(plan, environments), small = scattered<float>(plan, 4);
  const int places[] = {0, 131071, 200001, environments - 1};
  for (int i = 0; i < 4; ++i) contract::scatter(huge, places[i], static_cast<std::uint64_t>(i));
  huge.step(2), small.step(2);
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(same_bits(huge, places[i], small, i));
  EXPECT_EQ(huge.faulted(), 0);
  EXPECT_TRUE((huge.positions().row(3).segment(1, 131000) == huge.positions()(3, 1)).all());
}

}  // namespace
}  // namespace lockstep
