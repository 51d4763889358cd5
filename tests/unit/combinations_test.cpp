// Features beside each other: how they move together. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <random>

#include "combination_cells.h"
#include "combination_scenes.h"
#include "contact_scenes.h"
#include "jit/compile.h"
#include "lockstep/error.h"
#include "neighbours.h"
#include "physics.h"
#include "plan/program.h"
#include "targets/dispatch.h"

namespace lockstep {
namespace {

using namespace combinations;

// Delays, lags, motors' curves and colliders, where they are parameters, of each environment its own.
void make_different(Batch<float>& batch) {
  const ParameterSet& own = batch.plan().settings().per_environment;
  for (int e = 0; e < batch.environments(); ++e)
    for (const char* name : {"q0", "q1"}) {
      const int dof = batch.plan().dof(name);
      if (own.contains(Parameter::drive_delay))
        batch.parameter(Parameter::drive_delay)(dof, e) = static_cast<float>(e % 5);
      if (own.contains(Parameter::drive_lag))
        batch.parameter(Parameter::drive_lag)(dof, e) = 0.004f * static_cast<float>(e % 7);
      if (own.contains(Parameter::motor_curve))
        batch.parameter(Parameter::motor_curve)(2 * dof, e) = 3.0f + 0.1f * static_cast<float>(e);
    }
  if (!own.contains(Parameter::collider_size)) return;
  for (int e = 0; e < batch.environments(); ++e) {
    const auto share = static_cast<float>(e) / static_cast<float>(batch.environments());
    batch.parameter(Parameter::contact_restitution).col(e) = 0.5f * share;
    for (int c = 0; c < batch.parameter(Parameter::collider_place).rows() / 4; ++c) {
      auto place = batch.parameter(Parameter::collider_place).col(e);
      place[4 * c] += 0.02f * share, place[4 * c + 3] += 0.3f * share;
    }
    const auto& all = batch.plan().model().colliders;
    for (std::size_t c = 0; c < all.size(); ++c)
      if (!is_ground(all[c].shape.kind))
        batch.parameter(Parameter::collider_size).col(e).segment(3 * static_cast<int>(c), 3) *= 0.8f + 0.4f * share;
  }
}

// Random efforts and targets, of each environment its own.
template <class S>
void act_differently(Batch<S>& batch, std::mt19937& random) {
  std::uniform_real_distribution<float> within(-1.0f, 1.0f);
  for (int e = 0; e < batch.environments(); ++e)
    for (const Joint& joint : batch.plan().model().joints) {
      const int dof = batch.plan().dof(joint.name);
      batch.efforts()(dof, e) = 2.0f * within(random);
      if (joint.drive.kp > 0.0 || joint.drive.kinematic) batch.position_targets()(dof, e) = within(random);
    }
}

// Whatever is accepted moves without a fault under random efforts and targets that differ, for two seconds. Where the
// coupling is hard it holds, ranges hold, but by sweeps, and hard loops stay closed. Contacts press in many of the
// steps.
TEST(Combinations, of_all_features_move_soundly_with_actions_that_differ) {
  constexpr int environments = 40, controls = 40, steps = 12;
  const std::pair<Method, Integrator> ways[] = {{Method::automatic, Integrator::automatic},
                                                {Method::reduced, Integrator::euler},
                                                {Method::reduced, Integrator::leapfrog},
                                                {Method::pgs, Integrator::euler}};
  int runs = 0;
  for (const std::vector<Feature>& features : all_scenes())
    for (const auto& [method, integrator] : ways) {
      Scene scene(features);
      scene.settings.method = method, scene.settings.integrator = integrator;
      if (cell(scene.model, scene.settings, method, integrator).text == "-") continue;
      const Plan plan = compile(scene.model, scene.settings);
      const std::string words = scene.name + " by " + to_string(plan.method()) + ", " + to_string(plan.integrator());
      Batch<float> batch(plan, environments, {.threads = 1});
      make_different(batch);
      std::mt19937 random(11);
      float coupling = 0.0f, range = 0.0f, gap = 0.0f;
      double pressed = 0.0;
      const int first = plan.dof("q0"), second = plan.dof("q1");
      for (int control = 0; control < controls; ++control) {
        act_differently(batch, random);
        batch.step(steps);
        if (scene.has("contact")) pressed += contact_scenes::counts_of(batch).row(3).sum();
        coupling = std::max(coupling, batch.coupling_errors().size() ? batch.coupling_errors().abs().maxCoeff() : 0.0f);
        if (!plan.loops().empty()) gap = std::max(gap, batch.loop_errors().maxCoeff());
        range = std::max(
            {range, batch.positions().row(first).abs().maxCoeff(), batch.positions().row(second).abs().maxCoeff()});
      }
      EXPECT_EQ(batch.faulted(), 0) << words << (batch.faulted() ? ": " + batch.explain_fault(0) : "");
      if (scene.has("contact")) {
        EXPECT_GT(pressed, 0.2 * controls * steps * environments) << words;
      }
      if (method == Method::pgs) continue;
      if (scene.has("hard coupling") && !scene.has("per environment")) {
        EXPECT_LT(coupling, 1e-5f) << words;
      }
      if (!plan.loops().empty() && !scene.has("soft loop") && !scene.has("loop with a force limit")) {
        EXPECT_LT(gap, 1e-3f) << words;
      }
      if (scene.has("position limits")) {
        EXPECT_LT(range, 1.0f + 1e-4f) << words;
      }
      ++runs;
    }
  EXPECT_GT(runs, 280);
}

// Two thirds of a second after the start, where much acts. All that a scene can record is read.
TEST(Combinations, have_no_bit_of_their_neighbours) {
  int runs = 0;
  for (const std::vector<Feature>& features : all_scenes())
    for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog})
      for (const bool diagnosed : {false, true}) {
        Scene scene(features);
        StepSettings& settings = scene.settings;
        settings.integrator = integrator, settings.record_impulses = settings.record_diagnostics = diagnosed;
        settings.record_efforts = !diagnosed && !scene.has("kinematic drive");
        settings.record_contacts = settings.record_accelerations = !diagnosed;
        if (cell(scene.model, settings, settings.method, integrator).text == "-") continue;
        SCOPED_TRACE(scene.name + " by " + to_string(integrator));
        Batch<float> batch(compile(scene.model, settings), 12, {.threads = 1});
        make_different(batch);
        std::mt19937 random(7);
        for (int control = 0; control < 20; ++control) act_differently(batch, random), batch.step(8);
        neighbours::expect_none_matters(batch, 8, [&](Batch<float>& b) { act_differently(b, random); });
        ++runs;
      }
  EXPECT_GT(runs, 200);
}

// What is recorded changes no bit. Efforts keep their limits, accelerations are the changes of velocities, and all
// momentum comes from gravity, contacts and the joints at the base.
TEST(Combinations, are_recorded_as_they_move) {
  using contact_scenes::read;
  constexpr int environments = 9;
  const std::pair<Method, Integrator> ways[] = {{Method::automatic, Integrator::automatic},
                                                {Method::reduced, Integrator::euler},
                                                {Method::pgs, Integrator::euler}};
  int runs = 0;
  for (const std::vector<Feature>& features : all_scenes())
    for (const auto& [method, integrator] : ways) {
      Scene scene(features);
      scene.settings.method = method, scene.settings.integrator = integrator;
      StepSettings kept = scene.settings;
      kept.record_efforts = !scene.has("kinematic drive");
      kept.record_contacts = kept.record_accelerations = true;
      if (cell(scene.model, kept, method, integrator).text == "-") continue;
      const Plan plan = compile(scene.model, kept);
      const std::string words = scene.name + " by " + to_string(plan.method()) + ", " + to_string(plan.integrator());
      Batch<float> recorded(plan, environments, {.threads = 1});
      if (resolve(Target::automatic) != Target::baseline && jit::has_routines(program_of(plan))) {
        EXPECT_EQ(recorded.engine(), Engine::compiled);
      }
      Batch<float> plain(compile(scene.model, scene.settings), environments,
                         {.threads = 1, .engine = recorded.engine()});
      make_different(plain), make_different(recorded);
      std::mt19937 random(3), again(3);
      Eigen::ArrayXXf before;
      Eigen::ArrayXXd momentum;
      for (int control = 0; control < 10; ++control) {
        act_differently(plain, random), act_differently(recorded, again);
        plain.step(8), recorded.step(7);
        before = recorded.velocities(), momentum = recorded.momenta().template cast<double>();
        recorded.step();
      }
      EXPECT_TRUE((plain.positions() == recorded.positions()).all()) << words;
      EXPECT_TRUE((plain.velocities() == recorded.velocities()).all()) << words;

      const double dt = kept.dt;
      const Eigen::ArrayXXd change = (recorded.velocities() - before).cast<double>() / dt;
      EXPECT_LT((read(recorded, Quantity::joint_acceleration) - change).abs().maxCoeff(),
                1e-5 * change.abs().maxCoeff() + 1e-9)
          << words;
      if (kept.record_efforts && scene.has("limited servos")) {
        EXPECT_LE(read(recorded, Quantity::drive_effort).topRows(2).abs().maxCoeff(), 3.0 + 1e-6) << words;
      }

      const Eigen::ArrayXXd wrench = read(recorded, Quantity::joint_wrench),
                            touch = read(recorded, Quantity::link_contact_force),
                            gain = (recorded.momenta().template cast<double>() - momentum) / dt;
      if (scene.has("masses per environment")) continue;  // weights are not the model's
      for (int e = 0; e < environments; ++e) {
        Eigen::Vector3d force = Eigen::Vector3d::Zero();
        for (std::size_t l = 0; l < scene.model.links.size(); ++l)
          force += touch.col(e).segment<3>(3 * static_cast<int>(l)).matrix();
        double mass = 0.0;
        for (const Joint& joint : scene.model.joints) {
          if (joint.child.empty()) continue;
          const int link = scene.model.link_index(joint.child);
          mass += scene.model.links[static_cast<std::size_t>(link)].inertia.mass;
          if (std::any_of(scene.model.joints.begin(), scene.model.joints.end(),
                          [&](const Joint& other) { return other.child == joint.parent; }))
            continue;  // not at the base
          const Eigen::VectorXd pose = recorded.link_poses(link).col(e).matrix().template cast<double>();
          const Eigen::Quaterniond turn(pose(3), pose(4), pose(5), pose(6));
          force += turn * wrench.col(e).segment<3>(6 * plan.dof(joint.name)).matrix();
        }
        force += mass * scene.model.gravity;
        const double size = 1.0 + gain.col(e).abs().maxCoeff() + mass * scene.model.gravity.norm();
        EXPECT_LT((force - gain.col(e).tail<3>().matrix()).norm(), 0.02 * size) << words << ", environment " << e;
      }
      ++runs;
    }
  EXPECT_GT(runs, 230);
}

// A looser tolerance may not cost more. Stiff rows go to and fro between their pieces where steps are not searched.
TEST(Combinations, with_contacts_need_no_more_rounds_for_learning_than_by_default) {
  constexpr int environments = 40;
  double by_default = 0.0, for_learning = 0.0;
  for (const std::vector<Feature>& features : all_scenes()) {
    Scene scene(features);
    if (!scene.has("contact")) continue;
    scene.settings.integrator = Integrator::euler;
    double rounds[2] = {};
    for (int learning = 0; learning < 2; ++learning) {
      if (learning) scene.settings.contacts = ContactSettings::learning();
      Batch<float> batch(compile(scene.model, scene.settings), environments, {.threads = 1});
      std::mt19937 random(11);
      for (int control = 0; control < 20; ++control) {
        act_differently(batch, random);
        batch.step(12);
        rounds[learning] += contact_scenes::counts_of(batch).row(6).sum();
      }
    }
    EXPECT_LT(rounds[1], 1.3 * rounds[0]) << scene.name;
    by_default += rounds[0], for_learning += rounds[1];
  }
  EXPECT_GT(by_default, 0.0);
  EXPECT_LT(for_learning, by_default);
}

// Environments that differ, after a moment of random efforts and targets.
Batch<double> disturbed(const Plan& plan, int environments, int steps) {
  Batch<double> batch(plan, environments, {.threads = 1});
  std::mt19937 random(7);
  act_differently(batch, random);
  batch.step(steps);
  return batch;
}

// The derivatives of two steps are the product of those of each, but for what is held by friction or a bound, where a
// difference may lie on both sides of an edge.
TEST(Combinations, have_derivatives_of_two_steps_that_are_a_product) {
  constexpr int environments = 3;
  int smooth = 0;
  for (const std::vector<Feature>& features : all_scenes()) {
    Scene scene(features);
    SCOPED_TRACE(scene.name);
    scene.settings.contacts = {10, 200, 1e-11};
    Batch<double> batch = disturbed(compile(scene.model, scene.settings), environments, 20);
    const bool gives_way =
        std::ranges::any_of(scene.model.loops, [](const Loop& loop) { return !is_hard(loop.softness); });
    if (scene.has("late") || gives_way) {
      EXPECT_THROW(batch.linearize(), UsageError);
      continue;
    }
    // What has slipped is no function of the state.
    const bool may_slip = std::ranges::any_of(scene.model.couplings,
                                              [](const Coupling& coupling) { return coupling.force_limit < infinity; });
    if (may_slip && batch.coupling_errors().abs().maxCoeff() > 1e-3) {
      if (batch.coupling_errors().abs().maxCoeff() > 2e-3) {
        EXPECT_THROW(batch.linearize(), UsageError);
      }
      batch.project();
      for (const Linearization& own : batch.linearize())
        EXPECT_TRUE(own.fault == Fault::none && own.state_by_state.allFinite());
      continue;
    }
    const auto both = batch.linearize(EnvironmentSet::all(), {.substeps = 2}), first = batch.linearize();
    batch.step();
    const auto second = batch.linearize();
    bool has_edges = false;
    for (const char* edge : {"contact", "limit", "friction", "range", "motors"}) has_edges |= scene.has(edge);
    const double bound = scene.has("loop") ? 8e-4 : 1e-6;  // they are closed before each of the derivatives
    for (std::size_t e = 0; e < environments; ++e) {
      EXPECT_EQ(both[e].fault, Fault::none);
      EXPECT_TRUE(both[e].state_by_state.allFinite() && both[e].state_by_input.allFinite());
      if (has_edges) continue;
      const Eigen::MatrixXd product = second[e].state_by_state * first[e].state_by_state;
      EXPECT_LT((both[e].state_by_state - product).cwiseAbs().maxCoeff(), bound * product.cwiseAbs().maxCoeff());
      ++smooth;
    }
  }
  EXPECT_GT(smooth, 50);
}

// A site that random joints carry somewhere is carried there from the start.
TEST(Combinations, reach_by_inverse_kinematics_where_random_joints_were) {
  constexpr int environments = 20;
  for (const std::vector<Feature>& features : all_scenes()) {
    Scene scene(features);
    SCOPED_TRACE(scene.name);
    scene.model.add_site("tip", scene.has("loop") ? "second rod" : "l2").pose.translation().x() = 0.7;
    const Plan plan = compile(scene.model, scene.settings);
    Batch<double> batch(plan, environments, {.threads = 1});
    EXPECT_TRUE(batch.reset_random(EnvironmentSet::all(), {.spread = 0.5}).empty());
    const Batch<double>::Array targets = batch.site_positions(0);
    batch.reset();
    const Batch<double>::Array left = batch.inverse_kinematics(0, targets);
    EXPECT_LT(left.maxCoeff(), 1e-6);
    if (plan.couplings() > 0) {
      EXPECT_LT(batch.coupling_errors().abs().maxCoeff(), 1e-7);
    }
    if (!plan.loops().empty()) {
      EXPECT_LT(batch.loop_errors().maxCoeff(), 1e-6);
    }
    for (int dof = 0; dof < plan.dofs(); ++dof) {
      const Joint& joint = joint_of(scene.model, plan.dof_names()[static_cast<std::size_t>(dof)].c_str());
      EXPECT_GE(batch.positions().row(dof).minCoeff(), joint.lower - 1e-7) << joint.name;
      EXPECT_LE(batch.positions().row(dof).maxCoeff(), joint.upper + 1e-7) << joint.name;
    }
  }
}

// z M z / 2 is the kinetic energy.
TEST(Combinations, have_mass_matrices_of_their_energies) {
  constexpr int environments = 5;
  for (const std::vector<Feature>& features : all_scenes()) {
    Scene scene(features);
    SCOPED_TRACE(scene.name);
    const Plan plan = compile(scene.model, scene.settings);
    Batch<double> batch = disturbed(plan, environments, 20);
    batch.project();
    const std::vector<int> dofs = open_coordinate_dofs(plan);
    const auto n = static_cast<Eigen::Index>(dofs.size());
    const auto masses = batch.mass_matrices(), energies = batch.kinetic_energies();
    for (int e = 0; e < environments; ++e) {
      Eigen::VectorXd z(n), momentum = Eigen::VectorXd::Zero(n);
      for (Eigen::Index k = 0; k < n; ++k) z[k] = batch.velocities()(dofs[static_cast<std::size_t>(k)], e);
      for (Eigen::Index k = 0; k < n * n; ++k) momentum[k / n] += masses(k, e) * z[k % n];
      const double energy = 0.5 * z.dot(momentum);
      EXPECT_NEAR(energy, energies(0, e), 1e-10 * (1.0 + energies(0, e)));
      EXPECT_GT(energy, 0.0);
    }
  }
}

}  // namespace
}  // namespace lockstep
