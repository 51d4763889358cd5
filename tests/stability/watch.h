// A batch that is checked after every step. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "kernels.h"
#include "lockstep/plan.h"
#include "model/softness_numbers.h"
#include "physics.h"

namespace lockstep::stability {

constexpr double steps[] = {1.0 / 30, 1.0 / 60, 1.0 / 120, 1.0 / 240, 1.0 / 1000};

inline StepSettings recorded(double dt, Method method = Method::automatic) {
  StepSettings settings = physics::settings(method, 4, 1, dt);
  settings.record_diagnostics = true;
  return settings;
}

/// Calls test(S{}) with both precisions.
template <class Test>
void in_both_precisions(Test&& test) {
  for (int bits : {32, 64}) {
    SCOPED_TRACE(bits == 32 ? "float" : "double");
    bits == 32 ? test(float{}) : test(double{});
  }
}

/// Calls test(S{}, dt) with all steps in both precisions.
template <class Test>
void at_all_steps(Test&& test) {
  in_both_precisions([&](auto scalar) {
    for (double dt : steps) {
      SCOPED_TRACE("step 1/" + std::to_string(std::lround(1.0 / dt)));
      test(scalar, dt);
    }
  });
}

/// Calls test(S{}, dt, method) with the methods that solve all couplings exactly.
template <class Test>
void with_exact_methods(Test&& test) {
  at_all_steps([&](auto scalar, double dt) {
    for (Method method : {Method::automatic, Method::direct}) {
      SCOPED_TRACE(to_string(method));
      test(scalar, dt, method);
    }
  });
}

/// Largest allowed error of a hard coupling, rad or m.
template <class S>
constexpr double hard_tolerance = sizeof(S) == 4 ? 1e-5 : 1e-10;

/// Steps a batch and records the worst errors of all environments.
template <class S>
class Watch {
 public:
  Batch<S> batch;

  explicit Watch(const Plan& plan, int environments = 1) : batch(collected(plan), environments, options()) {
    expect_kernel(batch);
    excess_ = Eigen::ArrayXd::Zero(environments);
    start();
  }

  Watch(const Model& model, const StepSettings& settings, int environments = 1)
      : Watch(compile(model, settings), environments) {}

  /// Forgets the errors so far and starts from the current ones. To be called after changes of state or parameters.
  void start() {
    remaining_ = batch.coupling_errors().template cast<double>();
    error_ = late_error_ = beyond_rounding_ = 0.0;
    check();
  }

  /// Calls before(time at the end of the step), which may set inputs, and after() around every step.
  void run(double seconds, const std::function<void(double t)>& before = {}, const std::function<void()>& after = {}) {
    const double dt = batch.plan().settings().dt;
    for (int last = taken_ + static_cast<int>(std::lround(seconds / dt)); taken_ < last;) {
      if (before) before((taken_ + 1) * dt);
      batch.step();
      ++taken_;
      add_up();
      check();
      if (after) after();
    }
  }

  double time() const { return taken_ * batch.plan().settings().dt; }
  double position(int dof, int environment = 0) const { return batch.positions()(dof, environment); }
  double velocity(int dof, int environment = 0) const { return batch.velocities()(dof, environment); }

  bool finite() const { return finite_; }
  /// Largest difference of C of a hard coupling from what remains of its error at the start, (1 - erp)^n of it.
  /// Environments that were frozen by a fault do not count.
  double error() const { return error_; }
  /// The same, after the remaining error has decayed below 1e-6.
  double late_error() const { return late_error_; }
  /// error() minus four units in the last place of the positions and the offset in C.
  double error_beyond_rounding() const { return beyond_rounding_; }
  /// Largest unexplained energy at any time, J: the change of the energy minus all work and corrections.
  double excess() const { return excess_most_; }
  double speed() const { return batch.speeds().maxCoeff(); }

 private:
  void add_up() {
    const Model& model = batch.plan().model();
    for (Eigen::Index c = 0; c < remaining_.rows(); ++c)
      remaining_.row(c) *= 1.0 - numbers_of(model.couplings[static_cast<std::size_t>(c)].softness).first;
    if (!batch.plan().settings().record_diagnostics) return;
    const Eigen::ArrayXXd balance = batch.energy_balances().template cast<double>();
    excess_ += (balance.row(3) - balance.row(0) - balance.row(2)).transpose();
    excess_most_ = std::max(excess_most_, excess_.maxCoeff());
  }

  void check() {
    finite_ = finite_ && batch.positions().isFinite().all() && batch.velocities().isFinite().all() &&
              batch.root_poses().isFinite().all() && batch.root_velocities().isFinite().all();
    const Eigen::ArrayXXd errors = batch.coupling_errors().template cast<double>();
    const Model& model = batch.plan().model();
    for (Eigen::Index c = 0; c < errors.rows(); ++c) {
      const Coupling& coupling = model.couplings[static_cast<std::size_t>(c)];
      if (!is_hard(coupling.softness) || coupling.force_limit < infinity) continue;
      for (Eigen::Index e = 0; e < errors.cols(); ++e) {
        if (batch.faults()[static_cast<std::size_t>(e)] != Fault::none) continue;
        const double error = std::abs(errors(c, e) - remaining_(c, e));
        error_ = std::max(error_, error);
        beyond_rounding_ = std::max(beyond_rounding_, error - last_places(coupling, e));
        if (std::abs(remaining_(c, e)) < 1e-6) late_error_ = std::max(late_error_, error);
      }
    }
  }

  double last_places(const Coupling& coupling, Eigen::Index environment) const {
    const auto size = [&](const std::string& joint) {
      return std::abs(static_cast<double>(batch.positions()(batch.plan().dof(joint), environment)));
    };
    double sum = size(coupling.joint) + std::abs(coupling.offset);
    for (const CouplingTerm& term : coupling.terms) sum += std::abs(term.ratio) * size(term.joint);
    return 4.0 * std::numeric_limits<S>::epsilon() * sum;
  }

  Eigen::ArrayXXd remaining_;
  Eigen::ArrayXd excess_;
  bool finite_ = true;
  int taken_ = 0;
  double error_ = 0.0, late_error_ = 0.0, beyond_rounding_ = 0.0, excess_most_ = 0.0;
};

/// Expects what every possible scene promises: finite numbers, no fault, couplings that hold, and unexplained energy up
/// to `energy`. Errors at the start decay by erp. `direct` adds impulses to a free velocity, so it may be ten times
/// less exact until these errors have decayed.
template <class S>
void expect_sound(const Watch<S>& watch, double energy, double tolerance = hard_tolerance<S>) {
  EXPECT_TRUE(watch.finite());
  EXPECT_EQ(watch.batch.faulted(), 0) << to_string(watch.batch.faults()[0]);
  EXPECT_LE(watch.late_error(), tolerance);
  EXPECT_LE(watch.error(), watch.batch.plan().method() == Method::reduced ? tolerance : 10.0 * tolerance);
  EXPECT_LE(watch.excess(), energy);
}

}  // namespace lockstep::stability
