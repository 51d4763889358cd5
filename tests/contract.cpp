// Helpers that the contract tests share. SPDX-License-Identifier: Apache-2.0
#include "contract.h"

#include <limits>

#include "batch/values.h"
#include "plan/program.h"

namespace lockstep::contract {

SoftnessNumbers another(const Softness& softness, Random& random) {
  switch (kind_of(softness)) {
    case SoftnessKind::hard: return {random.uniform(0.0, 0.5), random.chance(0.5) ? 0.0 : random.uniform(0.01, 1.0)};
    case SoftnessKind::erp_cfm: return {random.uniform(0.0, 0.9), random.uniform(0.01, 1.0)};
    case SoftnessKind::spring: return {random.uniform(0.0, 100.0), random.uniform(0.0, 2.0)};
    case SoftnessKind::frequency: break;
  }
  return {random.uniform(1.0, 40.0), random.uniform(0.0, 1.5)};
}

namespace {

// The same kind of softness with these numbers. A hard softness with a cfm becomes an ErpCfm.
Softness with_numbers(const Softness& softness, SoftnessNumbers numbers) {
  const auto [first, second] = numbers;
  switch (kind_of(softness)) {
    case SoftnessKind::hard:
      if (second == 0.0) return Hard{first};
      [[fallthrough]];
    case SoftnessKind::erp_cfm: return ErpCfm{first, second};
    case SoftnessKind::spring: return Spring{first, second};
    case SoftnessKind::frequency: break;
  }
  return Frequency{first, second};
}

}  // namespace

template <class S>
void scatter(Batch<S>& batch, int environment, std::uint64_t seed) {
  Random random(seed);
  const Plan& plan = batch.plan();
  const auto shift = [&](auto view, double reach) {
    for (Eigen::Index row = 0; row < view.rows(); ++row)
      view(row, environment) += static_cast<S>(random.uniform(-reach, reach));
  };
  shift(batch.positions(), 0.2);
  shift(batch.velocities(), 0.5);
  shift(batch.root_velocities(), 0.5);
  shift(batch.position_targets(), 0.5);
  shift(batch.velocity_targets(), 0.5);
  shift(batch.efforts(), 0.5);
  for (Eigen::Index first = 0; first < batch.root_poses().rows(); first += 7) {
    Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
    for (double& component : turn.coeffs()) component += random.uniform(-1.0, 1.0);
    turn.normalize();
    auto pose = batch.root_poses().col(environment).segment(first, 7);
    for (int k = 0; k < 3; ++k) pose[k] += static_cast<S>(random.uniform(-1.0, 1.0));
    pose[3] = static_cast<S>(turn.w()), pose[4] = static_cast<S>(turn.x());
    pose[5] = static_cast<S>(turn.y()), pose[6] = static_cast<S>(turn.z());
  }

  const auto each = [&](Parameter parameter, auto change) {
    if (!plan.settings().per_environment.contains(parameter)) return;
    auto view = batch.parameter(parameter);
    for (Eigen::Index row = 0; row < view.rows(); ++row)
      view(row, environment) = static_cast<S>(change(static_cast<double>(view(row, environment))));
  };
  each(Parameter::gear_ratio, [&](double x) { return x * random.uniform(0.8, 1.25); });
  each(Parameter::offset, [&](double x) { return x + random.uniform(-0.05, 0.05); });
  each(Parameter::drive_gains, [&](double) { return random.chance(0.3) ? 0.0 : random.uniform(0.0, 20.0); });
  each(Parameter::damping, [&](double) { return random.uniform(0.0, 0.5); });
  each(Parameter::armature, [&](double x) { return random.chance(0.3) ? x : random.uniform(0.0, 0.1); });
  each(Parameter::stiffness, [&](double x) { return random.chance(0.3) ? x : random.uniform(0.0, 20.0); });
  each(Parameter::friction, [&](double x) { return random.chance(0.3) ? x : random.uniform(0.0, 0.3); });
  each(Parameter::position_limits, [&](double x) { return x + random.uniform(-0.1, 0.1); });
  each(Parameter::velocity_limit, [&](double x) { return x * random.uniform(0.5, 1.5); });
  each(Parameter::effort_limit, [&](double x) { return x * random.uniform(0.5, 1.5); });
  if (plan.settings().per_environment.contains(Parameter::position_limits)) {
    auto limits = batch.parameter(Parameter::position_limits);
    for (Eigen::Index row = 0; row < limits.rows(); row += 2)
      if (limits(row, environment) > limits(row + 1, environment))
        std::swap(limits(row, environment), limits(row + 1, environment));
  }
  each(Parameter::center_of_mass, [&](double x) { return x + random.uniform(-0.02, 0.02); });
  if (plan.settings().per_environment.contains(Parameter::inertia)) {
    auto inertia = batch.parameter(Parameter::inertia);
    for (std::size_t l = 0; l < plan.model().links.size(); ++l) {  // spread along a random direction
      if (plan.model().links[l].inertia.mass == 0.0) continue;
      Eigen::Vector3d way;
      for (double& component : way) component = random.uniform(-0.05, 0.05);
      const Eigen::Matrix3d more = way.squaredNorm() * Eigen::Matrix3d::Identity() - way * way.transpose();
      for (int k = 0; k < 6; ++k)
        inertia(6 * static_cast<Eigen::Index>(l) + k, environment) +=
            static_cast<S>(more(tensor_rows[k], tensor_columns[k]));
    }
  }
  each(Parameter::mass, [&](double x) { return x * random.uniform(0.5, 2.0); });
  each(Parameter::gravity, [&](double x) { return x + random.uniform(-3.0, 3.0); });
  each(Parameter::link_wrench, [&](double) { return random.uniform(-1.0, 1.0); });
  each(Parameter::coupling_switch, [&](double) { return random.chance(0.3) ? 0.0 : 1.0; });
  if (!plan.settings().per_environment.contains(Parameter::softness)) return;
  auto softness = batch.parameter(Parameter::softness);
  for (int c = 0; c < plan.couplings(); ++c) {
    const SoftnessNumbers own = another(plan.model().couplings[static_cast<std::size_t>(c)].softness, random);
    softness(2 * c, environment) = static_cast<S>(own.first);
    softness(2 * c + 1, environment) = static_cast<S>(own.second);
  }
}

template void scatter(Batch<float>&, int, std::uint64_t);
template void scatter(Batch<double>&, int, std::uint64_t);

Model model_of(Batch<double>& batch, int environment) {
  Model model = batch.plan().model();
  const auto own = [&](Parameter parameter, int row, double& number) {
    if (batch.plan().settings().per_environment.contains(parameter))
      number = batch.parameter(parameter)(row, environment);
  };
  int gear = 0, dof = 0;
  for (std::size_t c = 0; c < model.couplings.size(); ++c) {
    Coupling& coupling = model.couplings[c];
    const int row = static_cast<int>(c);
    for (CouplingTerm& term : coupling.terms) own(Parameter::gear_ratio, gear++, term.ratio);
    own(Parameter::offset, row, coupling.offset);
    SoftnessNumbers numbers = numbers_of(coupling.softness);
    own(Parameter::softness, 2 * row, numbers.first);
    own(Parameter::softness, 2 * row + 1, numbers.second);
    coupling.softness = with_numbers(coupling.softness, numbers);
    double on = 1.0;
    own(Parameter::coupling_switch, row, on);
    if (on == 0.0) coupling.softness = Spring{0.0, 0.0};
  }
  for (Joint& joint : model.joints) {
    if (!joint.moves()) continue;
    joint.position = batch.positions()(dof, environment);
    joint.velocity = batch.velocities()(dof, environment);
    joint.drive.position_target = batch.position_targets()(dof, environment);
    joint.drive.velocity_target = batch.velocity_targets()(dof, environment);
    joint.effort = batch.efforts()(dof, environment);
    own(Parameter::drive_gains, 2 * dof, joint.drive.kp);
    own(Parameter::drive_gains, 2 * dof + 1, joint.drive.kd);
    own(Parameter::damping, dof, joint.damping);
    own(Parameter::armature, dof, joint.armature);
    own(Parameter::stiffness, dof, joint.stiffness);
    own(Parameter::friction, dof, joint.friction);
    own(Parameter::position_limits, 2 * dof, joint.lower);
    own(Parameter::position_limits, 2 * dof + 1, joint.upper);
    own(Parameter::velocity_limit, dof, joint.velocity_limit);
    own(Parameter::effort_limit, dof++, joint.effort_limit);
  }
  for (std::size_t l = 0; l < model.links.size(); ++l) {
    Inertia& inertia = model.links[l].inertia;
    const double before = inertia.mass;
    own(Parameter::mass, static_cast<int>(l), inertia.mass);
    if (before > 0.0) inertia.about_center *= inertia.mass / before;
    for (int k = 0; k < 3; ++k) own(Parameter::center_of_mass, 3 * static_cast<int>(l) + k, inertia.center[k]);
    if (!batch.plan().settings().per_environment.contains(Parameter::inertia)) continue;
    for (int k = 0; k < 6; ++k) {
      double& entry = inertia.about_center(tensor_rows[k], tensor_columns[k]);
      own(Parameter::inertia, 6 * static_cast<int>(l) + k, entry);
      inertia.about_center(tensor_columns[k], tensor_rows[k]) = entry;
    }
  }
  for (int k = 0; k < 3; ++k) own(Parameter::gravity, k, model.gravity[k]);
  const reference::State state = physics::state_of(batch, environment);
  int floating = 0;
  for (std::size_t tree = 0; tree < model.roots.size(); ++tree) {
    Root& root = model.roots[tree];
    if (!root.floating) continue;
    root.pose.linear() = state.roots[tree].orientation.normalized().toRotationMatrix();
    root.pose.translation() = state.roots[tree].position;
    root.velocity = state.v.segment<6>(6 * floating++);
  }
  return model;
}

Eigen::MatrixXd wrenches_of(Batch<double>& batch, int environment) {
  Eigen::MatrixXd wrenches = Eigen::MatrixXd::Zero(6, static_cast<Eigen::Index>(batch.plan().model().links.size()));
  if (!batch.plan().settings().per_environment.contains(Parameter::link_wrench)) return wrenches;
  const auto field = batch.parameter(Parameter::link_wrench);
  for (Eigen::Index i = 0; i < wrenches.size(); ++i) wrenches(i % 6, i / 6) = field(i, environment);
  return wrenches;
}

namespace {

bool is_tendon(const Plan& plan, int dof) {
  const Model& model = plan.model();
  const std::string& name = plan.dof_names()[static_cast<std::size_t>(dof)];
  return model.joints[static_cast<std::size_t>(model.joint_index(name))].kind == JointKind::tendon;
}

}  // namespace

int first_joint(const Plan& plan) {
  int dof = 0;
  while (is_tendon(plan, dof)) ++dof;
  return dof;
}

template <class S>
void put_consistent(Batch<S>& batch) {
  const Tables<double>& t = program_of(batch.plan()).f64;
  const Reduction<double>& r = t.reduction;
  batch.velocities().setZero();
  for (int i = 0; i < 20; ++i) {  // one pass is enough if the gear ratios are those of the model
    const typename Batch<S>::Array errors = batch.coupling_errors();
    for (int f = 0; f < r.followers; ++f)
      for (int s = r.inverse_start[f]; s < r.inverse_start[f + 1]; ++s)
        batch.positions().row(t.dof[r.follower[f]]) -=
            static_cast<S>(r.inverse_value[s]) * errors.row(r.inverse_coupling[s]);
  }
}

template void put_consistent(Batch<float>&);
template void put_consistent(Batch<double>&);

template <class S>
void expect_the_same_bits_where_consistent(const Plan& plan, int environments, const BatchOptions& options) {
  Batch<S> all = scattered<S>(plan, environments, options), some = scattered<S>(plan, environments, options);
  for (Batch<S>* batch : {&all, &some}) put_consistent(*batch), batch->step(60);
  const auto consistent = [&](int e) { return e % 3 != 1 && all.faults()[e] == Fault::none; };
  const Batch<S> apart = scattered<S>(plan, environments, options);
  for (int e = 0; e < environments; ++e)
    if (!consistent(e)) {
      some.positions().col(e) = apart.positions().col(e);
      some.velocities().col(e) = apart.velocities().col(e);
      some.root_poses().col(e) = apart.root_poses().col(e);
      some.root_velocities().col(e) = apart.root_velocities().col(e);
    }
  all.step(3), some.step(3);
  int compared = 0;
  for (int e = 0; e < environments; ++e)
    if (consistent(e)) {
      EXPECT_TRUE(same_bits(all, e, some, e));
      ++compared;
    }
  EXPECT_GT(compared, environments / 3);

  // An environment that failed stays frozen while the consistent ones beside it step on.
  const int failed = 4;
  const Tables<double>& t = program_of(plan).f64;
  const int follower = t.dof[t.reduction.follower[0]];
  all.positions()(is_tendon(plan, follower) ? first_joint(plan) : follower, failed) =
      std::numeric_limits<S>::quiet_NaN();
  all.step();
  EXPECT_NE(all.faults()[failed], Fault::none);
  const std::vector<S> frozen = outcome(all, failed);
  all.step(3);
  EXPECT_TRUE(same_bits(outcome(all, failed), frozen));
}

template void expect_the_same_bits_where_consistent<float>(const Plan&, int, const BatchOptions&);
template void expect_the_same_bits_where_consistent<double>(const Plan&, int, const BatchOptions&);

ParameterSet all_parameters(Method method, const Model& model) {
  bool limited = false;
  for (const Coupling& coupling : model.couplings) limited |= coupling.force_limit < infinity;
  ParameterSet set;
  for (unsigned p = 0; p < parameter_count; ++p)
    if (const Parameter parameter{p};
        allows(method, parameter) && !(limited && parameter == Parameter::softness) && parameter != Parameter::friction)
      set.insert(parameter);
  return set;
}

}  // namespace lockstep::contract
