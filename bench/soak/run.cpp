// SPDX-License-Identifier: Apache-2.0
#include "run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <vector>

#include "lockstep/lockstep.h"
#include "scenes/any_model.h"

namespace lockstep::soak {
namespace {

// How a model moves: gently, as people drive robots, or as an agent does that knows nothing yet.
struct Motion {
  double spread, speed, effort, wrench;
};
constexpr Motion gentle_motion{0.2, 0.1, 0.2, 0.0}, wild_motion{1.0, 3.0, 5.0, 20.0};

// Seeds of what is drawn beside the model, so that the same seed is the same run.
using Random = std::mt19937_64;
double uniform(Random& random, double low, double high) {
  return low + (high - low) * (static_cast<double>(random() >> 11) * 0x1p-53);
}

std::vector<Parameter> own_parameters(const StepSettings& settings) {
  std::vector<Parameter> own;
  for (int i = 0; i < parameter_count; ++i)
    if (settings.per_environment.contains(static_cast<Parameter>(i))) own.push_back(static_cast<Parameter>(i));
  return own;
}

void count_features(const Model& model, const StepSettings& settings, Counts& features) {
  const auto add = [&](bool has, const std::string& name) { features[name] += has ? 1 : 0; };
  const auto any = [&](auto&& has) { return std::any_of(model.joints.begin(), model.joints.end(), has); };
  add(!model.couplings.empty(), "couplings"), add(!model.loops.empty(), "loops");
  add(!model.contacts.empty(), "contacts"), add(!model.roots.empty(), "floating root");
  add(any([](const Joint& j) { return j.kind == JointKind::tendon; }), "spatial tendon");
  add(any([](const Joint& j) { return j.kind == JointKind::ball; }), "ball joint");
  add(any([](const Joint& j) { return j.lower > -infinity; }), "position limits");
  add(any([](const Joint& j) { return j.velocity_limit < infinity; }), "velocity limits");
  add(any([](const Joint& j) { return j.effort_limit < infinity; }), "effort limits");
  add(any([](const Joint& j) { return j.friction > 0.0; }), "dry friction");
  add(any([](const Joint& j) { return j.drive.kinematic; }), "kinematic drive");
  add(any([](const Joint& j) { return j.drive.delay > 0 || j.drive.lag > 0.0; }), "delay or lag");
  add(any([](const Joint& j) { return j.drive.stall_effort < infinity; }), "motor curve");
  for (const Parameter p : own_parameters(settings)) features[fmt::format("own {}", to_string(p))] += 1;
}

template <class S>
class Run {
 public:
  Run(const Plan& plan, std::uint64_t seed, int environments, Totals& totals)
      : plan_(plan),
        seed_(seed),
        gentle_(seed / 2 % 2 == 0),
        motion_(gentle_ ? gentle_motion : wild_motion),
        random_(seed ^ 0x50a6),
        batch_(plan, environments, {.threads = 1, .seed = seed}),
        totals_(totals) {
    kinematic_.resize(static_cast<std::size_t>(plan.dofs()));
    for (const Joint& joint : plan.model().joints)
      if (joint.drive.kinematic && joint.moves()) kinematic_[static_cast<std::size_t>(plan.dof(joint.name))] = true;
    driven_.resize(static_cast<Eigen::Index>(plan.driven_dofs().size()), environments);
    start(EnvironmentSet::all(), environments);
  }

  void run(int periods) {
    const int compared = periods / 3;
    for (int period = 0; period < periods; ++period) {
      const int substeps = 1 << (random_() % 4);
      act(batch_);
      batch_.step(substeps);
      count(substeps);
      if (period == compared) compare();
      if (period % 4 == 3) look();
      if (failed()) return;
      restart();
    }
  }

  Engine engine() const { return batch_.engine(); }

 private:
  int environments() const { return batch_.environments(); }
  bool failed() const { return !totals_.failures.empty(); }
  Gentle& gentle() { return totals_.gentle[std::is_same_v<S, double>]; }
  void fail(const std::string& words) { totals_.failures.push_back(fmt::format("seed {}: {}", seed_, words)); }
  void count(int substeps) { totals_.steps += static_cast<std::uint64_t>(substeps) * environments(); }

  // New parameters and a new state.
  void start(const EnvironmentSet& which, int count) {
    for (const Parameter p : own_parameters(plan_.settings())) {
      Randomization how{.low = 0.9, .high = 1.1};
      if (p == Parameter::link_wrench) how = {.change = Change::add, .low = -motion_.wrench, .high = motion_.wrench};
      if (p == Parameter::collider_place) how = {.change = Change::add, .low = -0.01, .high = 0.01};
      try {
        batch_.randomize(p, how, which);
      } catch (const UsageError&) {  // a rule about several rows, or whole numbers, may not take such a factor
      }
    }
    unmet_ |= !batch_.reset_random(which, {.spread = motion_.spread, .speed = motion_.speed}).empty();
    if (gentle_) gentle().starts += static_cast<std::uint64_t>(count);
  }

  void act(Batch<S>& batch) {
    if (gentle_)
      aim_near(batch);
    else if (driven_.rows() > 0) {
      for (S& action : driven_.reshaped()) action = static_cast<S>(uniform(random_, -1.0, 1.0));
      const std::vector<double> scale(plan_.driven_dofs().size(), 0.5);
      batch.set_actions({driven_.data(), driven_.outerStride()}, {.dofs = plan_.driven_dofs(), .scale = scale});
    }
    for (int row = 0; row < batch.efforts().rows(); ++row)
      for (int e = 0; e < environments(); ++e)
        batch.efforts()(row, e) = static_cast<S>(uniform(random_, -motion_.effort, motion_.effort));
  }

  // Targets near to where the joints are. A kinematic drive would jump to one that is farther away.
  void aim_near(Batch<S>& batch) {
    for (int row = 0; row < batch.position_targets().rows(); ++row) {
      const int dof = row % plan_.dofs();
      const double most = kinematic_[static_cast<std::size_t>(dof)] ? 0.1 * plan_.settings().dt : 0.1;
      for (int e = 0; e < environments(); ++e)
        batch.position_targets()(row, e) = batch.positions()(dof, e) + static_cast<S>(uniform(random_, -most, most));
    }
  }

  // From a savepoint, with the same actions, two threads keep the bits of one.
  void compare() {
    Batch<S> other(plan_, environments(), {.threads = 2});
    other.restore(batch_.save());
    ++totals_.saves;
    for (int period = 0; period < 8; ++period) {
      const Random before = random_;
      act(batch_);
      random_ = before;
      act(other);
      batch_.step(4), other.step(4);
      count(4);
      totals_.compared_steps += static_cast<std::uint64_t>(4) * environments();
    }
    const auto same = [&](const auto& ours, const auto& theirs) {
      for (Eigen::Index row = 0; row < ours.rows(); ++row)
        if (std::memcmp(&ours(row, 0), &theirs(row, 0), sizeof(S) * static_cast<std::size_t>(environments())) != 0)
          return false;
      return true;
    };
    if (!same(batch_.positions(), other.positions()) || !same(batch_.velocities(), other.velocities()) ||
        !same(batch_.root_poses(), other.root_poses()) || !same(batch_.root_velocities(), other.root_velocities()))
      fail("two threads after restore() do not keep the bits of one");
    for (int e = 0; e < environments(); ++e)
      if (batch_.faults()[e] != other.faults()[e]) fail("two threads after restore() find other faults");
  }

  // Faults and resets, as a training loop has them.
  void restart() {
    std::vector<int> ended;
    for (int e = 0; e < environments(); ++e) {
      const Fault fault = batch_.faults()[e];
      const bool finite = batch_.positions().col(e).allFinite() && batch_.velocities().col(e).allFinite() &&
                          batch_.root_poses().col(e).allFinite() && batch_.root_velocities().col(e).allFinite();
      if (!finite) fail(fmt::format("environment {} is not finite, fault {}", e, to_string(fault)));
      if (fault != Fault::none) {
        ++totals_.faults[to_string(fault)];
        if (gentle_) count_gentle_fault(e);
      }
      if (fault != Fault::none || random_() % 100 == 0) ended.push_back(e);
    }
    totals_.resets += ended.size();
    if (!ended.empty()) start(ended, static_cast<int>(ended.size()));
  }

  void count_gentle_fault(int e) {
    const FaultReport report = batch_.fault_report(e);
    ++gentle().faults[fmt::format("{}, {}", to_string(report.fault), to_string(report.stage))];
    if (told_) return;
    told_ = true;
    totals_.reasons.push_back(
        fmt::format("seed {}, step {}: {}", seed_, static_cast<unsigned>(report.step), batch_.explain_fault(e)));
  }

  // Couplings, ranges and energy in gentle motion.
  void look() {
    if (!gentle_) return;
    const Model& model = plan_.model();
    const ParameterSet& own = plan_.settings().per_environment;
    const auto errors = batch_.coupling_errors();
    for (std::size_t c = 0; c < model.couplings.size(); ++c) {
      const Coupling& coupling = model.couplings[c];
      const std::vector<int>& eliminated = plan_.eliminated_dofs();
      const bool holds = !unmet_ && plan_.method() == Method::reduced && is_hard(coupling.softness) &&
                         coupling.force_limit == infinity && model.loops.empty() &&
                         std::find(eliminated.begin(), eliminated.end(), plan_.dof(coupling.joint)) != eliminated.end();
      for (int e = 0; holds && e < environments(); ++e)
        if (batch_.faults()[e] == Fault::none)
          gentle().coupling_error.add(std::abs(static_cast<double>(errors(static_cast<Eigen::Index>(c), e))), seed_);
    }
    const bool hard_ranges = std::all_of(model.joints.begin(), model.joints.end(), [](const Joint& j) {
      return is_hard(j.limit_softness) || (j.lower == -infinity && j.upper == infinity);
    });
    const auto beyond = batch_.limit_violations();
    for (int e = 0; hard_ranges && !own.contains(Parameter::position_limits) && e < environments(); ++e) {
      if (batch_.faults()[e] != Fault::none) continue;
      const double violation = static_cast<double>(beyond(0, e));
      gentle().beyond_limit.add(violation, seed_);
      gentle().beyond += violation > 1e-3 ? 1 : 0;
      ++gentle().looked;
    }
    if (plan_.settings().record_diagnostics && model.contacts.empty() && model.loops.empty()) audit();
  }

  // (M65): the change beyond the work, by the energy at hand.
  void audit() {
    const auto balance = batch_.energy_balances(), kinetic = batch_.kinetic_energies();
    for (int e = 0; e < environments(); ++e) {
      if (batch_.faults()[e] != Fault::none) continue;
      const double work = static_cast<double>(balance(0, e)), correction = static_cast<double>(balance(2, e)),
                   change = static_cast<double>(balance(3, e));
      const double at_hand = static_cast<double>(kinetic(0, e)) + std::abs(work) + std::abs(correction) + 1e-3;
      const double gain = (change - work - correction) / at_hand;
      gentle().gain.add(gain, seed_);
      gentle().gains += gain > 0.1 ? 1 : 0;
      ++gentle().audited;
    }
  }

  const Plan& plan_;
  std::uint64_t seed_;
  bool gentle_, told_ = false;
  bool unmet_ = false;  // couplings contradict each other, so a reset cannot place all followers
  Motion motion_;
  Random random_;
  Batch<S> batch_;
  std::vector<bool> kinematic_;      // by dof
  typename Batch<S>::Array driven_;  // actions
  Totals& totals_;
};

template <class S>
void step(const Plan& plan, std::uint64_t seed, int environments, int periods, Totals& totals) {
  Run<S> run(plan, seed, environments, totals);
  run.run(periods);
  ++totals.ways[fmt::format("{}, {}", to_string(plan.integrator()), to_string(run.engine()))];
}

}  // namespace

Totals run(std::uint64_t seed, int environments, int periods) {
  Totals totals;
  const std::vector<std::uint8_t> bytes = scenes::bytes_of(seed);
  scenes::AnyModel any(bytes);
  const Model model = any.model();
  const StepSettings settings = any.settings();
  try {
    const Plan plan = compile(model, settings);
    ++totals.models;
    count_features(model, settings, totals.features);
    seed % 2 == 1 ? step<double>(plan, seed, environments, periods, totals)
                  : step<float>(plan, seed, environments, periods, totals);
  } catch (const Error& error) {
    ++totals.refused[error.code()];
    if (totals.models > 0) totals.failures.push_back(fmt::format("seed {}: compiled, then {}", seed, error.what()));
  } catch (const std::exception& error) {
    totals.failures.push_back(fmt::format("seed {}: {}", seed, error.what()));
  }
  return totals;
}

}  // namespace lockstep::soak
